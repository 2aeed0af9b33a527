"""Viscous: a linear damper, ``T = s2 v``; the baseline without dry friction (``sigma_2=0`` for none at all)."""

from typing import NamedTuple

from steer_env.friction import defaults
from steer_env.friction.law import register
from steer_env.friction.numerics.check import not_negative
from steer_env.friction.numerics.kernel import kernel


class Viscous(NamedTuple):
    """Unchecked parameters; ``friction.make("viscous", ...)`` checks."""

    sigma_2: float  # damping [N m s/rad]


def make(*, sigma_2: float = defaults.SIGMA_2_EQUIVALENT) -> Viscous:
    """Checked damper; the default loses as much per weave cycle as the dry laws do. ValueError if negative."""
    return Viscous(not_negative("sigma_2", sigma_2))


@kernel
def advance(p, level, memory, w, h):
    pass


@kernel
def torque(p, level, memory, w):
    return p.sigma_2 * w


@kernel
def rate(p, level, memory, w, out):
    pass


@kernel
def stored_energy(p, memory):
    return 0.0


@kernel
def solve(p, level, memory, S, R, h, guess):
    return R / (S + p.sigma_2)


register(
    "viscous",
    Viscous,
    make=make,
    memory_size=lambda p: 0,
    advance=advance,
    torque=torque,
    rate=rate,
    stored_energy=stored_energy,
    solve=solve,
    fitted=("sigma_2",),
)
