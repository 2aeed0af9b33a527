"""Coulomb friction, a set-valued law.

    T = L F_c sgn(v) in motion, and any |T| <= L F_c at rest   (F1)
    w = sgn(R) max(|R| - L F_c, 0)/S                           (F7)

This w is the only solution of the step equation ``S w + T = R``, which is an inclusion here: the friction site sticks
exactly, without drift and without a regularised slope. L is ``torque_scale``. The numbers are those of docs/model.md.
"""

import math
from typing import NamedTuple

from steer_env.friction import defaults
from steer_env.friction.law import register
from steer_env.friction.numerics.check import positive
from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.numerics.simd import maximum, where


class Coulomb(NamedTuple):
    """Parameters, which ``friction.make("coulomb", ...)`` checks and this class does not."""

    F_c: float  # sliding torque [N m]


def make(*, F_c: float = defaults.F_C) -> Coulomb:
    """Checked Coulomb parameters; raises ValueError for a value out of range."""
    return Coulomb(positive("F_c", F_c))


@kernel
def torque(p, torque_scale, memory, w):
    # At rest the torque is whatever the balance needs; a displacement history has no balance, and zero is assumed.
    return where(w != 0.0, torque_scale * p.F_c * math.copysign(1.0, w), 0.0)  # (F1)


@kernel
def mean_torque(p, torque_scale, memory, w, h):
    return torque_scale * p.F_c * math.copysign(1.0, w), 0.0  # (F1), of either side also at rest


@kernel
def solve(p, torque_scale, memory, S, R, h, w_guess):
    return math.copysign(maximum(abs(R) - torque_scale * p.F_c, 0.0), R) / S  # (F7)


register(
    "coulomb",
    Coulomb,
    make=make,
    torque=torque,
    mean_torque=mean_torque,
    solve=solve,
    wide=True,
    fitted=("F_c",),
    units={"F_c": "N m"},
)
