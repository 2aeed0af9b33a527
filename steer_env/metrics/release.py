"""Release: the motion of the car after the hands let go of the handwheel in a steady turn, after ISO 17288-1."""

from functools import partial

import numpy as np

from steer_env.metrics.common import decay
from steer_env.metrics.common.definitions import metric, register_evaluation
from steer_env.metrics.common.filtered_channels import YAW
from steer_env.metrics.common.free_control import FREE, LINEAR, FreeControl
from steer_env.metrics.common.free_hands import Releases

register_evaluation("release", partial(FreeControl, kind=Releases), speed_m_s=100 / 3.6)

_release = partial(metric, validity=LINEAR, source="after ISO 17288-1")


@_release("%", "release", usual=(-20.0, 20.0))
def yaw_rate_after_1s(free: FreeControl) -> np.ndarray:
    """Mean yaw rate from 0.9 to 1.1 s after the release, divided by the yaw rate held before the release."""
    return free.events.mean(YAW, 0.9, 1.1) / free.excitation()


@_release("%", "release")
def release_overshoot(free: FreeControl) -> np.ndarray:
    """Overshoot of the yaw rate beyond its residual to the other side, divided by held minus residual yaw rate."""
    rest = free.residual(YAW)
    return (rest - free.opposite()[1]) / (free.excitation() - rest)


@_release("s", "release")
def yaw_rate_time_to_half(free: FreeControl) -> np.ndarray:
    """Time from the release until the yaw rate has fallen to half of the yaw rate held before the release."""
    held = free.excitation()
    sections = (free.events.section(YAW, k, -0.2, FREE) for k in range(len(held)))
    return np.array([decay.first_below(t, y, 0.5 * h, YAW) for (t, y), h in zip(sections, held)])
