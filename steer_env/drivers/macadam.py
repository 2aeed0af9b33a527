"""MacAdam's driver: the constant steering angle that brings the car nearest to the path over the preview."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.drivers.common.definition import Driver, arm, register, register_eyes
from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common.terms import PREVIEW
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]

_POINTS = len(PREVIEW)


class MacAdam(NamedTuple):
    """Parameters of the eyes."""

    preview_time: float  # [s]


def _gains(p: MacAdam, car: Car, speed: float) -> Array:
    """On the path's points, and on lateral speed and yaw rate.

    With h(t) the lateral way of the linear car for a unit handwheel angle and y_free(t) that without steering,
    u = sum h (y_path - y_free)/sum h^2 over the preview.

    Source: MacAdam, Application of an optimal preview control for simulation of closed-loop automobile driving,
    IEEE Trans. SMC 11 (1981).
    """
    from scipy import linalg  # here, for it takes longer to import than an environment to start

    from steer_env.vehicle import linear

    body = linear.from_car(car, speed).state_space("handwheel")
    A = np.zeros((5, 5))  # v_y, r, y, psi, the angle held
    A[:2, :2], A[:2, 4:] = body.A, body.B
    A[2, [0, 3]], A[3, 1] = (1.0, speed), 1.0
    rows = np.array([linalg.expm(A * t)[2] for t in PREVIEW])
    h = np.where(np.array(PREVIEW) <= p.preview_time + 1e-9, rows[:, 4], 0.0)
    w = h / (h @ h)
    return np.concatenate([w, w @ rows[:, :2]])


@kernel
def _command(p, gains, sight, lateral_speed, yaw_rate, z, memory):
    u = -gains[_POINTS] * lateral_speed - gains[_POINTS + 1] * yaw_rate
    for k in range(_POINTS):
        u += gains[k] * sight[2 + k]
    return u


register_eyes(MacAdam, _gains, _command)


def macadam(preview_time: float = 1.3, co_contraction: float = 0.5) -> Driver:
    """Optimal preview after MacAdam (1981), arms in between."""
    time = number("preview_time [s]", preview_time, minimum=0.3, maximum=PREVIEW[-1])
    return Driver("macadam", MacAdam(time), arm(co_contraction))


register("macadam", macadam)
