"""Preview driver: linear-quadratic optimal control over the path ahead."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.drivers.common.definition import INTENT, Driver, arm, register, register_eyes
from steer_env.friction.numerics.check import positive
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common.terms import PREVIEW
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]

EFFORT = 0.2  # lateral offset that is as bad as one radian of handwheel angle; with arms, less makes them swing [m/rad]
_POINTS = len(PREVIEW)


class Preview(NamedTuple):
    """Parameters of the eyes."""

    effort: float  # [m/rad]


def _gains(p: Preview, car: Car, speed: float) -> Array:
    """On the offset and the path's points, on lateral speed and yaw rate, on z."""
    from steer_env.drivers.common import (
        lq,  # here, for python-control takes longer to import than an environment to start
    )
    from steer_env.vehicle import linear

    K, g, _ = lq.gains(linear.from_car(car, speed), PREVIEW[-1], effort=p.effort)
    # The path between the points that are seen is straight, so that the gains on it add up in theirs.
    times, seen = lq.SAMPLE * np.arange(1, g.size + 1), np.array([0.0, *PREVIEW])
    shares = np.array([np.interp(times, seen, np.eye(seen.size)[k]) for k in range(seen.size)])
    return np.concatenate([shares @ g, K[:2], K[4:]])


@kernel
def _command(p, gains, sight, lateral_speed, yaw_rate, z, memory):
    # In the car's own frame its y and psi are zero, and the path beside it lies at minus the offset.
    u = -gains[0] * sight[0]
    for k in range(_POINTS):
        u += gains[1 + k] * sight[2 + k]
    u -= gains[1 + _POINTS] * lateral_speed + gains[2 + _POINTS] * yaw_rate
    for k in range(INTENT):
        u -= gains[3 + _POINTS + k] * z[k]
    return u


register_eyes(Preview, _gains, _command)


def preview(effort: float = EFFORT, co_contraction: float = 0.5) -> Driver:
    """Looks 1.5 s ahead and steers by linear-quadratic preview (Sharp, Valtetsis 2001), arms in between."""
    return Driver("preview", Preview(positive("effort [m/rad]", effort)), arm(co_contraction))


register("preview", preview)
