"""The force on the rack, as its observer tells it: what tyres and road do is felt."""

from typing import NamedTuple

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.steering.feels.common import FEELS, Feel, of_force


class RackForce(NamedTuple):
    """The feel of the rack force."""


@kernel
def torque(feel, w, angle, force, speed):
    """As :func:`steer_env.vehicle.steering.feels.common.torque`."""
    return of_force(w, force)


FEELS.register("rack_force", Feel(RackForce, torque), RackForce)
