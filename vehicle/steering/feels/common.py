"""What a feel by wire is, the registry of feels, and the tables that they read.

A feel is a class without numbers of its own and a kernel; the tables are those of
:class:`steer_env.vehicle.steering.by_wire.Wire`.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from steer_env.friction.numerics.interpolation import bracket
from steer_env.friction.numerics.kernel import dispatch, kernel
from steer_env.friction.numerics.registry import Registry


class Feel(NamedTuple):
    """A feel."""

    parameters: type
    torque: Callable  # (feel, w, angle, force, speed) -> torque that resists a turn to the left [N m]


FEELS: Registry[Feel] = Registry("feel", "steer_env.vehicle.steering.feels")


@kernel
def of_angle(w, angle, speed):
    """Torque of the map at a handwheel angle [rad] and a vehicle speed [m/s], odd in the angle [N m]."""
    i, u = bracket(w.speeds, abs(speed))
    j, s = bracket(w.angles, abs(angle))
    low = w.feel[i, j] + s * (w.feel[i, j + 1] - w.feel[i, j])
    high = w.feel[i + 1, j] + s * (w.feel[i + 1, j + 1] - w.feel[i + 1, j])
    return math.copysign(low + u * (high - low), angle)  # (W4)


@kernel
def of_force(w, force):
    """Torque over the force that the rack's observer tells [N], odd in it [N m]."""
    j, s = bracket(w.forces, abs(force))
    return math.copysign(w.force_feel[j] + s * (w.force_feel[j + 1] - w.force_feel[j]), force)  # (W11)


def torque(feel, w, angle, force, speed):
    """Torque that resists at a handwheel angle [rad], a told rack force [N] and a vehicle speed [m/s]."""
    found: Any = FEELS.of(type(feel))
    return found.torque(feel, w, angle, force, speed)


dispatch(torque, lambda kind, _: getattr(FEELS.of(kind), "torque", None))
