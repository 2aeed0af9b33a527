"""Dahl: an exponential spring that saturates.

    T = s0 z,    dz/dt = v - s0 |v| z/F_c,    hence dT/dx = s0 (1 - T sgn(v)/F_c)

It is also the exponential-spring friction of steering models. Source: Dahl, Aerospace Corporation
TOR-0158(3107-18)-1, 1968, with exponent 1.
"""

import math
from typing import NamedTuple

from steer_env.friction import defaults
from steer_env.friction.bristle import decay, displaced, held
from steer_env.friction.law import register
from steer_env.friction.numerics.check import positive
from steer_env.friction.numerics.kernel import kernel


class Dahl(NamedTuple):
    """Unchecked parameters; ``friction.make("dahl", ...)`` checks."""

    sigma_0: float  # stiffness at zero torque [N m/rad]
    F_c: float  # saturated torque [N m]


def make(*, sigma_0: float = defaults.SIGMA_0, F_c: float = defaults.F_C) -> Dahl:
    """Checked Dahl parameters; ValueError on a value out of range."""
    return Dahl(positive("sigma_0", sigma_0), positive("F_c", F_c))


@kernel
def mean_torque(p, level, memory, w, h):
    slope = p.sigma_0 * h / (level * p.F_c)
    _, p1, p2, d1, d2 = decay(slope * abs(w))
    z = held(memory[0], level * p.F_c / p.sigma_0)
    F = p.sigma_0 * (z * p1 + h * w * p2)
    return F, p.sigma_0 * (h * p2 + (z * d1 + h * w * d2) * math.copysign(slope, w))


@kernel
def advance(p, level, memory, w, h):
    z_g = level * p.F_c / p.sigma_0
    memory[0] = displaced(memory[0], z_g, z_g, w, h)


@kernel
def torque(p, level, memory, w):
    return p.sigma_0 * held(memory[0], level * p.F_c / p.sigma_0)


@kernel
def rate(p, level, memory, w, out):
    out[0] = w - p.sigma_0 * abs(w) * memory[0] / (level * p.F_c)


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
    fitted=("sigma_0", "F_c"),
)
