"""LuGre friction: bristles with damping and a Stribeck curve.

    T = sigma_0 z + sigma_1 dz/dt + sigma_2 v             (F4)
    dz/dt = v - sigma_0 |v| z/G(v)                        (F4)
    G(v) = L (F_c + (F_s - F_c) exp(-(v/v_s)^2))          (F4)

Over a step h at constant speed w these have closed forms, with E(X), p1(X) and p2(X) of
:mod:`steer_env.friction.bristle`:

    X = sigma_0 |w| h/G(w)                                                    (F8)
    mean z = z p1 + h w p2                                                    (F8)
    mean dz/dt = p1 (w - z X/h)                                               (F8)
    mean T = sigma_0 (mean z) + sigma_1 (mean dz/dt) + sigma_2 w              (F8)

L is ``torque_scale``.

Source: Canudas de Wit, Olsson, Åström, Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419-425. The numbers of the
equations are those of docs/model.md; (F10) is the condition of passivity that :func:`make` checks. Deviation: a bristle
beyond the deflection at break-away is cut back to it.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from steer_env.friction import defaults
from steer_env.friction.bristle import decay, limit_deflection, slide
from steer_env.friction.law import register
from steer_env.friction.numerics.check import flag, not_negative, positive
from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.numerics.simd import all_of


class LuGre(NamedTuple):
    """Parameters, which ``friction.make("lugre", ...)`` checks and this class does not."""

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
    allow_active: Any = False,
) -> LuGre:
    """Checked LuGre parameters.

    ``F_s`` defaults to ``F_c``, because steering rigs show no Stribeck effect; the default ``v_s`` is assumed. With
    ``allow_active`` a set that creates energy at some speeds is taken too, as that of the paper is.

    Raises
    ------
    ValueError
        For a value out of range, for ``F_s < F_c``, and, unless that is allowed, for a set that creates energy: with
        constant ``sigma_1`` the law is passive at all speeds only if ``sigma_2 >= sigma_1 (F_s - F_c)/F_c``.
    """
    allowed = flag("allow_active", allow_active)
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
    if not allowed and _active(p):
        raise ValueError(
            f"sigma_2 must be at least sigma_1 (F_s - F_c)/F_c = {_least_sigma_2(p):g} N m s/rad for a passive LuGre "
            f"law, got {p.sigma_2:g}; lower sigma_1 or F_s, or allow_active=True to study a set that creates energy"
        )
    return p


def _least_sigma_2(p: LuGre) -> float:
    return p.sigma_1 * (p.F_s - p.F_c) / p.F_c  # (F10)


def _active(p: LuGre) -> bool:
    """Whether the set creates energy at some speeds."""
    return p.sigma_2 < _least_sigma_2(p) * (1 - 1e-12)


@kernel
def saturation(p, torque_scale, w):
    """Steady torque without the viscous part, G of (F4) [N m], and its derivative by speed [N m s/rad]."""
    if all_of(p.F_s == p.F_c):
        return torque_scale * p.F_c, 0.0
    x = w / p.v_s
    bump = torque_scale * (p.F_s - p.F_c) * math.exp(-x * x)
    return torque_scale * p.F_c + bump, -2.0 * x / p.v_s * bump  # (F4)


@kernel
def mean_torque(p, torque_scale, memory, w, h):
    G, dG = saturation(p, torque_scale, w)
    z = limit_deflection(memory[0], torque_scale * p.F_s / p.sigma_0)
    X = p.sigma_0 * abs(w) * h / G  # (F8)
    dX = p.sigma_0 * h / G * (math.copysign(1.0, w) - abs(w) * dG / G)
    E, p1, p2, d1, d2 = decay(X)
    z_mean = z * p1 + h * w * p2  # (F8)
    z_rate = p1 * (w - z * X / h)  # (F8), as E - 1 = -X p1; the difference would cancel in short steps
    F = p.sigma_0 * z_mean + p.sigma_1 * z_rate + p.sigma_2 * w  # (F8)
    dz_mean = h * p2 + (z * d1 + h * w * d2) * dX
    dz_rate = p1 + (w * d1 - z * E / h) * dX
    return F, p.sigma_0 * dz_mean + p.sigma_1 * dz_rate + p.sigma_2


@kernel
def advance(p, torque_scale, memory, w, h):
    G, _ = saturation(p, torque_scale, w)
    memory[0] = slide(memory[0], G / p.sigma_0, torque_scale * p.F_s / p.sigma_0, w, h)


@kernel
def torque(p, torque_scale, memory, w):
    G, _ = saturation(p, torque_scale, w)
    z = limit_deflection(memory[0], torque_scale * p.F_s / p.sigma_0)
    z_rate = w - p.sigma_0 * abs(w) * z / G  # (F4)
    return p.sigma_0 * z + p.sigma_1 * z_rate + p.sigma_2 * w  # (F4)


@kernel
def rate(p, torque_scale, memory, w, out):
    G, _ = saturation(p, torque_scale, w)
    out[0] = w - p.sigma_0 * abs(w) * memory[0] / G  # (F4)


@kernel
def stored_energy(p, memory):
    return 0.5 * p.sigma_0 * memory[0] ** 2


def steepest_fall(p: LuGre, torque_scale: float, h: float) -> float:
    """The largest decrease of the mean torque over ``h`` with the speed [N m s/rad], of a bristle at break-away (F14).

    It is found on a grid of speeds. Beyond six Stribeck speeds the terms of the curve are gone, and what is left falls.
    """
    if p.F_s == p.F_c:
        return 0.0
    w = p.v_s * np.geomspace(1e-3, 6.0, 400)
    bump = torque_scale * (p.F_s - p.F_c) * np.exp(-((w / p.v_s) ** 2))
    G = torque_scale * p.F_c + bump
    a, r = 2.0 * w / p.v_s**2 * bump, (torque_scale * p.F_s - G) / G  # (F14)
    X, q = p.sigma_0 * w * h / G, w * a / G  # (F14)
    E, p1, _, d1, _ = np.transpose([decay(each) for each in X])
    of_bristle = a * (1.0 - p1) - r * d1 * (p.sigma_0 * h + a * X)  # (F14)
    of_damping = p.sigma_1 * (r * E * (1.0 + q) + p1 * q)  # (F14)
    return max(0.0, float(np.max(of_bristle + of_damping)) - p.sigma_2)  # (F14)


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
    continuous=True,
    fitted=("sigma_0", "F_c"),
    steepest_fall=steepest_fall,
    wide=True,
    permission=lambda p: {"allow_active": True} if _active(p) else {},
    units={
        "sigma_0": "N m/rad",
        "sigma_1": "N m s/rad",
        "sigma_2": "N m s/rad",
        "F_c": "N m",
        "F_s": "N m",
        "v_s": "rad/s",
    },
)
