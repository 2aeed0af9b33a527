"""MacAdam's driver: the constant steering angle that brings the car nearest to the path over the preview."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.courses.preview import PREVIEW_TIMES
from steer_env.drivers.common.definition import Driver, arm, register, register_preview_model
from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]

_POINTS = len(PREVIEW_TIMES)


class MacAdam(NamedTuple):
    """Parameters of the preview model."""

    preview_time: float  # [s]


def _gains(p: MacAdam, car: Car, speed: float) -> Array:
    """Gains on the path's points, on lateral speed and on yaw rate.

    With h(t) the lateral displacement of the linear car for a unit handwheel angle and y_free(t) that without steering,
    u = sum h (y_path - y_free)/sum h^2 over the preview.

    Source: MacAdam, Application of an optimal preview control for simulation of closed-loop automobile driving,
    IEEE Trans. SMC 11 (1981).
    """
    from scipy import linalg  # here, because importing it takes longer than starting an environment

    from steer_env.vehicle import linear

    body = linear.from_car(car, speed).state_space("handwheel")
    A = np.zeros((5, 5))  # v_y, r, y, psi, constant handwheel angle
    A[:2, :2], A[:2, 4:] = body.A, body.B
    A[2, [0, 3]], A[3, 1] = (1.0, speed), 1.0
    rows = np.array([linalg.expm(A * t)[2] for t in PREVIEW_TIMES])
    h = np.where(np.array(PREVIEW_TIMES) <= p.preview_time + 1e-9, rows[:, 4], 0.0)
    w = h / (h @ h)
    return np.concatenate([w, w @ rows[:, :2]])


@kernel
def _command(p, gains, path, lateral_speed, yaw_rate, z, memory):
    u = -gains[_POINTS] * lateral_speed - gains[_POINTS + 1] * yaw_rate
    for k in range(_POINTS):
        u += gains[k] * path[2 + k]
    return u


register_preview_model(MacAdam, _gains, _command)


def macadam(preview_time: float = 1.3, co_contraction: float = 0.5) -> Driver:
    """Optimal preview after MacAdam (1981), through arms."""
    time = number("preview_time [s]", preview_time, minimum=0.3, maximum=PREVIEW_TIMES[-1])
    return Driver("macadam", MacAdam(time), arm(co_contraction))


register("macadam", macadam)
