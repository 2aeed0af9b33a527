"""Two-point visual driver: steers by the angles to a near and a far point of the path."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.courses.preview import AHEAD, PREVIEW_TIMES
from steer_env.drivers.common.definition import Driver, arm, register, register_preview_model
from steer_env.episode.timing import UPDATE_INTERVAL
from steer_env.friction.numerics.check import number, positive
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]

FAR_ANGLE_GAIN, NEAR_ANGLE_GAIN, NEAR_INTEGRAL_GAIN = (
    16.0,
    4.0,
    3.0,
)  # relative gains on the two angles and on the near angle's integral
_FAR_POINT = 8  # place of the point 0.9 s ahead among the points
# Places among the gains.
_FAR_GAIN, _NEAR_GAIN, _INTEGRAL_GAIN, _FAR_DISTANCE, _NEAR_PLACE, _NEAR_DISTANCE = range(6)


class TwoPoint(NamedTuple):
    """Parameters of the preview model."""

    near: float  # distance of the near point [m]
    scale: float  # on all gains [1]


def _gains(p: TwoPoint, car: Car, speed: float) -> Array:
    """Gains on the far angle, the near angle and its integral; distance of the far point and place of the near point.

    In a steady turn of curvature k the angles at distance d are k d/2. All gains are scaled so that they then command
    the handwheel angle that the linear car needs.

    Source: Salvucci, Gray, A two-point visual control model of steering, Perception 33 (2004); gains rescaled here.
    """
    from steer_env.vehicle.analysis import linear

    system = linear.from_car(car, speed).state_space("handwheel")
    steady = -np.linalg.solve(system.A, system.B)[1, 0]  # yaw rate over handwheel angle
    per_curvature = speed / steady
    far = speed * PREVIEW_TIMES[_FAR_POINT]
    unit = p.scale * per_curvature / (0.5 * (FAR_ANGLE_GAIN * far + NEAR_ANGLE_GAIN * p.near))
    place = min(
        max(p.near / (speed * PREVIEW_TIMES[0]), 1.0), len(PREVIEW_TIMES) - 1.0
    )  # among the points, counted from one
    return np.array(
        [
            unit * FAR_ANGLE_GAIN,
            unit * NEAR_ANGLE_GAIN,
            unit * NEAR_INTEGRAL_GAIN,
            far,
            place,
            place * speed * PREVIEW_TIMES[0],
        ]
    )


@kernel
def _command(p, gains, path, lateral_speed, yaw_rate, z, memory):
    far = math.atan2(path[AHEAD + _FAR_POINT], gains[_FAR_DISTANCE])
    n = int(gains[_NEAR_PLACE])  # counted from one
    part, before = gains[_NEAR_PLACE] - n, path[AHEAD + n - 1]
    near = math.atan2(before + part * (path[min(AHEAD + n, path.size - 1)] - before), gains[_NEAR_DISTANCE])
    memory[0] += near * UPDATE_INTERVAL
    return gains[_FAR_GAIN] * far + gains[_NEAR_GAIN] * near + gains[_INTEGRAL_GAIN] * memory[0]


register_preview_model(TwoPoint, _gains, _command)


def two_point(near: float = 8.0, scale: float = 1.0, co_contraction: float = 0.5) -> Driver:
    """Near and far point after Salvucci and Gray (2004), through arms.

    He keeps a lane, and takes the default car through the double lane change up to 55 km/h; faster he is some 0.2 s
    late, because angles to points make no allowance for his own delay and arms. On winding roads he leaves the lane
    from 60 m/s on.
    """
    parameters = TwoPoint(number("near [m]", near, minimum=2.0, maximum=30.0), positive("scale", scale))
    return Driver("two_point", parameters, arm(co_contraction))


register("two_point", two_point)
