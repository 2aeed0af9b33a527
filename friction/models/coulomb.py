"""Coulomb: a set-valued law, ``T = F_c sgn(v)`` in motion and any ``|T| <= F_c`` at rest.

The step equation is an inclusion with one solution, ``w = sgn(R) max(|R| - F_c, 0)/S``: the site sticks
exactly, without drift and without a regularised slope.
"""

import math
from typing import NamedTuple

from steer_env.friction import defaults
from steer_env.friction.law import register
from steer_env.friction.numerics.check import positive
from steer_env.friction.numerics.kernel import kernel


class Coulomb(NamedTuple):
    """Unchecked parameters; ``friction.make("coulomb", ...)`` checks."""

    F_c: float  # sliding torque [N m]


def make(*, F_c: float = defaults.F_C) -> Coulomb:
    """Checked Coulomb parameters; ValueError on a value out of range."""
    return Coulomb(positive("F_c", F_c))


@kernel
def advance(p, level, memory, w, h):
    pass


@kernel
def torque(p, level, memory, w):
    # At rest the torque is whatever the balance needs; without one (a displacement history) it is taken as zero.
    return level * p.F_c * math.copysign(1.0, w) if w != 0.0 else 0.0


@kernel
def rate(p, level, memory, w, out):
    pass


@kernel
def stored_energy(p, memory):
    return 0.0


@kernel
def solve(p, level, memory, S, R, h, guess):
    return math.copysign(max(abs(R) - level * p.F_c, 0.0), R) / S


register(
    "coulomb",
    Coulomb,
    make=make,
    memory_size=lambda p: 0,
    advance=advance,
    torque=torque,
    rate=rate,
    stored_energy=stored_energy,
    solve=solve,
    fitted=("F_c",),
)
