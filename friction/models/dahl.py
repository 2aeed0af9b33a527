"""Dahl friction: an exponential spring that saturates, known in steering models as exponential-spring friction.

    T = sigma_0 z                                                                             (F3)
    dz/dt = v - sigma_0 |v| z/(L F_c),    hence dT/dx = sigma_0 (1 - T sgn(v)/(L F_c))        (F3)
    mean T over a step = sigma_0 (z p1 + h w p2),    X = sigma_0 |w| h/(L F_c)                (F8)

L is ``torque_scale``; p1(X) and p2(X) are those of :mod:`steer_env.friction.bristle`.

Source: Dahl, Aerospace Corporation TOR-0158(3107-18)-1, 1968, with exponent 1. The numbers are
those of docs/model.md.
"""

from typing import NamedTuple

from steer_env.friction import defaults
from steer_env.friction.bristle import limit_deflection, slide, spring
from steer_env.friction.law import register
from steer_env.friction.numerics.check import positive
from steer_env.friction.numerics.kernel import kernel


class Dahl(NamedTuple):
    """Parameters, which ``friction.make("dahl", ...)`` checks and this class does not."""

    sigma_0: float  # stiffness at zero torque [N m/rad]
    F_c: float  # saturated torque [N m]


def make(*, sigma_0: float = defaults.SIGMA_0, F_c: float = defaults.F_C) -> Dahl:
    """Checked Dahl parameters; raises ValueError for a value out of range."""
    return Dahl(positive("sigma_0", sigma_0), positive("F_c", F_c))


@kernel
def mean_torque(p, torque_scale, memory, w, h):
    return spring(p.sigma_0, torque_scale * p.F_c, memory[0], w, h)


@kernel
def advance(p, torque_scale, memory, w, h):
    z_g = torque_scale * p.F_c / p.sigma_0
    memory[0] = slide(memory[0], z_g, z_g, w, h)


@kernel
def torque(p, torque_scale, memory, w):
    return p.sigma_0 * limit_deflection(memory[0], torque_scale * p.F_c / p.sigma_0)  # (F3)


@kernel
def rate(p, torque_scale, memory, w, out):
    out[0] = w - p.sigma_0 * abs(w) * memory[0] / (torque_scale * p.F_c)  # (F3)


@kernel
def stored_energy(p, memory):
    return 0.5 * p.sigma_0 * memory[0] ** 2


register(
    "dahl",
    Dahl,
    make=make,
    memory_size=lambda p: 1,
    advance=advance,
    torque=torque,
    rate=rate,
    stored_energy=stored_energy,
    mean_torque=mean_torque,
    wide=True,
    continuous=True,
    fitted=("sigma_0", "F_c"),
    units={"sigma_0": "N m/rad", "F_c": "N m"},
)
