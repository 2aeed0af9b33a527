"""MacAdam's driver: the constant steering angle that brings the car nearest to the path over the preview."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.courses.preview import AHEAD, PREVIEW_TIMES
from steer_env.drivers.common.definition import (
    DELAYED_COMMANDS,
    NEUROMUSCULAR_STATES,
    Driver,
    arm,
    register,
    register_preview_model,
)
from steer_env.episode.timing import UPDATE_INTERVAL
from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]

# An angle that is constant over the preview cuts corners, the more the longer it is: with 0.6 to 0.8 s all packaged
# cars take the double lane change at 80 km/h without a cone, with 0.9 s not all. Chosen with cones in view [s].
PREVIEW_TIME = 0.6
_POINTS = len(PREVIEW_TIMES)


class MacAdam(NamedTuple):
    """Parameters of the preview model."""

    preview_time: float  # [s]


def _gains(p: MacAdam, car: Car, speed: float) -> Array:
    """Gains on the path's points, on lateral speed and yaw rate, and on z.

    With h(t) the lateral displacement of the linear car for a unit command that is held and y_free(t) that without a
    further command, u = sum h (y_path - y_free)/sum h^2 over the preview. Muscles, arms and delay belong to the model:
    without them the car would be some 0.2 s late on everything that it commands.

    Source: MacAdam, Application of an optimal preview control for simulation of closed-loop automobile driving,
    IEEE Trans. SMC 11 (1981). Deviation: the model contains the driver's own delay and arms.
    """
    from steer_env.drivers.common import lq  # here, because python-control takes longer to import than an environment
    from steer_env.vehicle.analysis import linear

    A, B, _ = lq.sampled_model(linear.from_car(car, speed), DELAYED_COMMANDS)
    free, held, of_state, of_command = np.eye(len(A)), np.zeros(len(A)), [], []
    for _ in range(round(PREVIEW_TIMES[-1] / UPDATE_INTERVAL)):
        free, held = A @ free, A @ held + B[:, 0]
        of_state.append(free[2])
        of_command.append(held[2])
    seen = np.round(np.array(PREVIEW_TIMES) / UPDATE_INTERVAL).astype(int) - 1
    h = np.where(np.array(PREVIEW_TIMES) <= p.preview_time + 1e-9, np.array(of_command)[seen], 0.0)
    w = h / (h @ h)
    on_state = w @ np.array(of_state)[seen]
    return np.concatenate([w, on_state[:2], on_state[4:]])


@kernel
def _command(p, gains, path, lateral_speed, yaw_rate, z, memory):
    u = -gains[_POINTS] * lateral_speed - gains[_POINTS + 1] * yaw_rate
    for k in range(_POINTS):
        u += gains[k] * path[AHEAD + k]
    for k in range(NEUROMUSCULAR_STATES):
        u -= gains[_POINTS + 2 + k] * z[k]
    return u


register_preview_model(MacAdam, _gains, _command)


def macadam(preview_time: float = PREVIEW_TIME, co_contraction: float = 0.5) -> Driver:
    """Optimal preview after MacAdam (1981), through arms."""
    time = number("preview_time [s]", preview_time, minimum=0.5, maximum=PREVIEW_TIMES[-1])
    return Driver("macadam", MacAdam(time), arm(co_contraction))


register("macadam", macadam)
