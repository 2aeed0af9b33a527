"""The car's boost table alone, as it comes from the maker."""

import numpy as np

from steer_env.assists.common.definition import Array, Baseline, register


class Boost(Baseline):
    """No torque on top."""

    def torque(self, seen: Array) -> Array:
        """Zero [N m]."""
        return np.zeros(len(seen))


register("boost", Boost)
