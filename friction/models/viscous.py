"""Viscous friction: a linear damper, the baseline without dry friction.

    T = sigma_2 v           (F2)
    w = R/(S + sigma_2)     (F7)

This w solves the step equation ``S w + T = R``. With ``sigma_2 = 0`` there is no friction at all. The numbers are those
of docs/model.md.
"""

from typing import NamedTuple

from steer_env.friction import defaults
from steer_env.friction.law import register
from steer_env.friction.numerics.check import not_negative
from steer_env.friction.numerics.kernel import kernel


class Viscous(NamedTuple):
    """Parameters, which ``friction.make("viscous", ...)`` checks and this class does not."""

    sigma_2: float  # damping [N m s/rad]


def make(*, sigma_2: float = defaults.SIGMA_2_EQUIVALENT) -> Viscous:
    """Checked viscous parameters; raises ValueError for a negative damping.

    The default damper loses as much energy in a cycle of the weave as the dry laws do.
    """
    return Viscous(not_negative("sigma_2", sigma_2))


@kernel
def torque(p, torque_scale, memory, w):
    return p.sigma_2 * w  # (F2)


@kernel
def mean_torque(p, torque_scale, memory, w, h):
    return p.sigma_2 * w, p.sigma_2  # (F2)


@kernel
def solve(p, torque_scale, memory, S, R, h, w_guess):
    return R / (S + p.sigma_2)  # (F7)


register(
    "viscous",
    Viscous,
    make=make,
    torque=torque,
    mean_torque=mean_torque,
    solve=solve,
    continuous=True,
    fitted=("sigma_2",),
    wide=True,
    units={"sigma_2": "N m s/rad"},
)
