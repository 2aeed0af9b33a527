"""Map and rack force, blended by the vehicle speed: at standstill the tyres' stick and slip need not be felt."""

from typing import NamedTuple

from steer_env.friction.numerics.interpolation import bracket
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.steering.assist.by_speed import interpolate_cell
from steer_env.vehicle.steering.feels.common import FEELS, Feel, of_angle, of_force


class Blended(NamedTuple):
    """The feel of both."""


@kernel
def torque(feel, w, angle, force, speed):
    """As :func:`steer_env.vehicle.steering.feels.common.torque`."""
    i, u = bracket(w.speeds, abs(speed))
    share = interpolate_cell(w.force_share, i, u)
    return (1.0 - share) * of_angle(w, angle, speed) + share * of_force(w, force)  # (W12)


FEELS.register("blended", Feel(Blended, torque), Blended)
