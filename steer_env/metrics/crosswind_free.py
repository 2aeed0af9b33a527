"""Crosswind with free hands."""

import numpy as np

from steer_env.metrics.common.crosswind import Crosswind, crosswind_metric, register_crosswind
from steer_env.metrics.common.filtered_channels import ANGLE

register_crosswind("crosswind-free", fixed=False)


@crosswind_metric("deg", "crosswind-free")
def crosswind_handwheel_angle_peak(wind: Crosswind) -> np.ndarray:
    """Size of the largest angle of the free handwheel, read where the mean of the gusts is largest."""
    return np.abs(wind.peak(ANGLE))
