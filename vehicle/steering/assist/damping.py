"""Damping: a torque against a speed, of the motor (the key ``damping``) or of the handwheel (E12).

    T = -D(v) th1'                                                  (E12)

The motor's own damping D(v) th2' is part of (E1). That of the handwheel also damps the motion of the handwheel on its
torsion bar, since the motor follows it.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.steering.assist.by_speed import by_speed, shortest


class HandwheelDamping(NamedTuple):
    """Parameters as the kernels take them."""

    gain: NDArray[np.float64]  # (V,) damping of the handwheel by the motor [N m s/rad]


STATES: tuple[tuple[str, str], ...] = ()


def make(count: int, *, handwheel_damping: ArrayLike = (0.0,)) -> HandwheelDamping:
    """Damping of the handwheel speed [N m s/rad], 0 to 10, for each of ``count`` speeds or one for all; 0 is off."""
    return HandwheelDamping(by_speed("handwheel_damping", handwheel_damping, count))


def keys(p: HandwheelDamping) -> dict[str, Any]:
    """The keys of a car file that make these parameters."""
    return {"handwheel_damping": shortest(p.gain)}


@kernel
def torque(gain, speed):
    """Torque [N m] against a speed [rad/s] with a damping [N m s/rad]."""
    return -gain * speed  # (E1), (E12)
