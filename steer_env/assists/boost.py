"""The car's boost table alone."""

import numpy as np

from steer_env.assists.common.definition import Array, Baseline, register


class Boost(Baseline):
    """No torque in addition to the boost table's."""

    def torque(self, seen: Array) -> Array:
        """Zero [N m]."""
        return np.zeros(len(seen))


register("boost", Boost)
