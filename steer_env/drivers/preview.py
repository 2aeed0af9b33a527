"""Preview driver: linear-quadratic optimal control over the path ahead."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.courses.preview import AHEAD, LATERAL_OFFSET, PREVIEW_TIMES
from steer_env.drivers.common.definition import NEUROMUSCULAR_STATES, Driver, arm, register, register_preview_model
from steer_env.drivers.common.known_torque import acceleration_gain
from steer_env.episode.timing import UPDATE_INTERVAL
from steer_env.friction.numerics.check import positive
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]

# Lateral offset that costs as much as a lateral acceleration of 1 m/s2 [s2]. From 0.020 to 0.024 all packaged cars take
# the double lane change at 80 km/h without a cone; below, they overshoot by what the linear car leaves out, and above,
# they cut corners. Chosen with these results in view.
EFFORT = 0.023
_POINTS = len(PREVIEW_TIMES)


class Preview(NamedTuple):
    """Parameters of the preview model."""

    effort: float  # [s2]


def _gains(p: Preview, car: Car, speed: float) -> Array:
    """Gains on the lateral offset and the path's points, on lateral speed and yaw rate, and on z.

    An angle costs by the lateral acceleration that it leads to in a steady turn, so that one effort gives every car at
    every speed about the same loop: for a car that answers at once, one that follows the path up to 1/sqrt(effort)
    [rad/s].
    """
    from steer_env.drivers.common import lq  # here, because python-control takes longer to import than an environment
    from steer_env.vehicle.analysis import linear

    effort = p.effort * acceleration_gain(car, speed)
    K, g, _ = lq.gains(linear.from_car(car, speed), PREVIEW_TIMES[-1], effort=effort)
    # The path is taken as straight between the points, so gains on its samples add up to gains on the points.
    times, seen = UPDATE_INTERVAL * np.arange(1, g.size + 1), np.array([0.0, *PREVIEW_TIMES])
    shares = np.array([np.interp(times, seen, np.eye(seen.size)[k]) for k in range(seen.size)])
    return np.concatenate([shares @ g, K[:2], K[4:]])


@kernel
def _command(p, gains, path, lateral_speed, yaw_rate, z, memory):
    # In the car's frame its own y and psi are zero, and the path beside the car lies at minus the lateral offset.
    u = -gains[0] * path[LATERAL_OFFSET]
    for k in range(_POINTS):
        u += gains[1 + k] * path[AHEAD + k]
    u -= gains[1 + _POINTS] * lateral_speed + gains[2 + _POINTS] * yaw_rate
    for k in range(NEUROMUSCULAR_STATES):
        u -= gains[3 + _POINTS + k] * z[k]
    return u


def _on_road(p: Preview, road_friction: float) -> Preview:
    # On a slippery road the tyres saturate and the linear car overshoots, so accelerations cost more. The exponent fits
    # the best efforts at 0.3 to 0.5 of the dry friction: assumed, with the touched cones in view.
    return Preview(p.effort / math.sqrt(min(road_friction, 1.0)))


register_preview_model(Preview, _gains, _command, _on_road)


def preview(effort: float = EFFORT, co_contraction: float = 0.5) -> Driver:
    """Linear-quadratic preview control over 1.5 s (Sharp, Valtetsis 2001), through arms.

    ``effort`` is the lateral offset that costs as much as a lateral acceleration of 1 m/s2 [s2]. The default car takes
    the obstacle avoidance up to 53 km/h without a cone; at 60 km/h its path asks for more than the tyres' grip.
    """
    return Driver("preview", Preview(positive("effort [s2]", effort)), arm(co_contraction))


register("preview", preview)
