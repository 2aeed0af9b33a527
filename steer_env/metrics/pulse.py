"""Pulse: the motion of the car after a short pulse of hand torque with free hands, after ISO 17288-2."""

from functools import partial

import numpy as np

from steer_env.metrics.common.definitions import metric, register_evaluation
from steer_env.metrics.common.filtered_channels import YAW
from steer_env.metrics.common.free_control import FREE, LINEAR, FreeControl
from steer_env.metrics.common.free_hands import Pulses

register_evaluation("pulse", partial(FreeControl, kind=Pulses), speed_m_s=100 / 3.6)

_pulse = partial(metric, validity=LINEAR, source="after ISO 17288-2")


@_pulse("deg/s", "pulse")
def pulse_yaw_rate_peak(free: FreeControl) -> np.ndarray:
    """Largest yaw rate to the side of the pulse, less the mean yaw rate before the pulse."""
    return free.excitation()


@_pulse("%", "pulse")
def pulse_overshoot(free: FreeControl) -> np.ndarray:
    """Largest yaw rate to the other side, divided by the largest yaw rate to the side of the pulse."""
    return -free.opposite()[1] / free.excitation()


@_pulse("deg", "pulse", usual=(-2.0, 2.0))
def heading_after_pulse(free: FreeControl) -> np.ndarray:
    """Change of the heading from before the pulse to 4 s after it: the integral of the yaw rate."""
    free.checked_excitation()
    sections = (free.events.section(YAW, k, -2.0, FREE) for k in range(len(free.events)))
    return np.array([np.trapezoid(y, t) for t, y in sections])
