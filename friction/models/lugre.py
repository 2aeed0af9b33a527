"""LuGre: bristles with damping and a Stribeck curve.

    T = s0 z + s1 dz/dt + s2 v,    dz/dt = v - s0 |v| z/G(v),    G(v) = F_c + (F_s - F_c) exp(-(v/v_s)^2)

Source: Canudas de Wit, Olsson, Åström, Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419-425.
"""

import math
from typing import NamedTuple

from steer_env.friction import defaults
from steer_env.friction.bristle import decay, displaced, held
from steer_env.friction.law import register
from steer_env.friction.numerics.check import not_negative, positive
from steer_env.friction.numerics.kernel import kernel


class LuGre(NamedTuple):
    """Unchecked parameters, as the kernels take them; ``friction.make("lugre", ...)`` checks."""

    sigma_0: float  # bristle stiffness [N m/rad]
    sigma_1: float  # bristle damping [N m s/rad]
    sigma_2: float  # viscous friction [N m s/rad]
    F_c: float  # sliding (Coulomb) torque [N m]
    F_s: float  # break-away torque [N m]
    v_s: float  # Stribeck speed [rad/s]


def make(
    *,
    sigma_0: float = defaults.SIGMA_0,
    sigma_1: float = defaults.SIGMA_1,
    sigma_2: float = 0.0,
    F_c: float = defaults.F_C,
    F_s: float | None = None,
    v_s: float = 0.1,
) -> LuGre:
    """Checked LuGre parameters. ``F_s`` defaults to ``F_c``: steering rigs show no Stribeck effect; ``v_s`` is assumed.

    Raises
    ------
    ValueError
        A value out of range, ``F_s < F_c``, or a set that creates energy: with constant ``sigma_1`` the law is
        passive at all speeds only if ``sigma_2 >= sigma_1 (F_s - F_c)/F_c``.
    """
    F_c = positive("F_c", F_c)
    F_s = F_c if F_s is None else positive("F_s", F_s)
    p = LuGre(
        positive("sigma_0", sigma_0),
        not_negative("sigma_1", sigma_1),
        not_negative("sigma_2", sigma_2),
        F_c,
        F_s,
        positive("v_s", v_s),
    )
    if F_s < F_c:
        raise ValueError(f"F_s must be at least F_c = {F_c:g} N m, got {F_s:g}")
    least = p.sigma_1 * (F_s - F_c) / F_c
    if p.sigma_2 < least * (1 - 1e-12):
        raise ValueError(
            f"sigma_2 must be at least sigma_1 (F_s - F_c)/F_c = {least:g} N m s/rad for a passive LuGre law, "
            f"got {p.sigma_2:g}; lower sigma_1 or F_s (an active set for study: steer_env.friction.models.lugre.LuGre itself)"
        )
    return p


@kernel
def saturation(p, level, w):
    """Steady torque without the viscous part, ``G`` [N m], and its derivative by speed."""
    if p.F_s == p.F_c:
        return level * p.F_c, 0.0
    x = w / p.v_s
    bump = level * (p.F_s - p.F_c) * math.exp(-x * x)
    return level * p.F_c + bump, -2.0 * x / p.v_s * bump


@kernel
def mean_torque(p, level, memory, w, h):
    G, dG = saturation(p, level, w)
    z = held(memory[0], level * p.F_s / p.sigma_0)
    X = p.sigma_0 * abs(w) * h / G
    dX = p.sigma_0 * h / G * (math.copysign(1.0, w) - abs(w) * dG / G)
    E, p1, p2, d1, d2 = decay(X)
    z_mean = z * p1 + h * w * p2
    z_rate = p1 * (w - z * X / h)  # as E - 1 = -X p1; the difference would cancel in short steps
    F = p.sigma_0 * z_mean + p.sigma_1 * z_rate + p.sigma_2 * w
    dz_mean = h * p2 + (z * d1 + h * w * d2) * dX
    dz_rate = p1 + (w * d1 - z * E / h) * dX
    return F, p.sigma_0 * dz_mean + p.sigma_1 * dz_rate + p.sigma_2


@kernel
def advance(p, level, memory, w, h):
    G, _ = saturation(p, level, w)
    memory[0] = displaced(memory[0], G / p.sigma_0, level * p.F_s / p.sigma_0, w, h)


@kernel
def torque(p, level, memory, w):
    G, _ = saturation(p, level, w)
    z = held(memory[0], level * p.F_s / p.sigma_0)
    z_rate = w - p.sigma_0 * abs(w) * z / G
    return p.sigma_0 * z + p.sigma_1 * z_rate + p.sigma_2 * w


@kernel
def rate(p, level, memory, w, out):
    G, _ = saturation(p, level, w)
    out[0] = w - p.sigma_0 * abs(w) * memory[0] / G


@kernel
def stored_energy(p, memory):
    return 0.5 * p.sigma_0 * memory[0] ** 2


register(
    "lugre",
    LuGre,
    make=make,
    memory_size=lambda p: 1,
    advance=advance,
    torque=torque,
    rate=rate,
    stored_energy=stored_energy,
    mean_torque=mean_torque,
    fitted=("sigma_0", "F_c"),
)
