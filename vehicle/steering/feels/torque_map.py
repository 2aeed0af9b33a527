"""The map of torque over handwheel angle and vehicle speed: what the rack does is not felt."""

from typing import NamedTuple

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.steering.feels.common import FEELS, Feel, of_angle


class TorqueMap(NamedTuple):
    """The feel of the map."""


@kernel
def torque(feel, w, angle, force, speed):
    """As :func:`steer_env.vehicle.steering.feels.common.torque`."""
    return of_angle(w, angle, speed)


FEELS.register("torque_map", Feel(TorqueMap, torque), TorqueMap)
