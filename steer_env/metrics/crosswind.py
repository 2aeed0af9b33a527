"""Crosswind with the handwheel held straight."""

import numpy as np

from steer_env.metrics.common.crosswind import Crosswind, crosswind_metric, register_crosswind
from steer_env.metrics.common.filtered_channels import TORQUE

register_crosswind("crosswind", fixed=True)


@crosswind_metric("N m", "crosswind")
def crosswind_handwheel_torque_peak(wind: Crosswind) -> np.ndarray:
    """Size of the largest hand torque to keep the handwheel straight, read where the mean of the gusts is largest."""
    return np.abs(wind.peak(TORQUE))
