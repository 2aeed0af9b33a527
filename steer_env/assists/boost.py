"""The car's own assist alone: boost table, motor damping, and the functions that its file switches on."""

from typing import Any

import numpy as np

from steer_env.assists.common.definition import Array, Baseline, register


class Boost(Baseline):
    """No torque in addition to the car's own assist."""

    def torque(self, seen: Any) -> Array:
        """Zero [N m]."""
        return np.zeros(len(seen))


register("boost", Boost)
