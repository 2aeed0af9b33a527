"""Elasto-plastic friction: a bristle that is exactly elastic below break-away, so that it does not drift.

    T = sigma_0 z + sigma_1 dz/dt + sigma_2 v                                            (F15)
    dz/dt = v (1 - alpha |z|/z_c) where v and z have one sign, otherwise v               (F15)
    alpha = 0 up to |z| = z_ba, then linear up to 1 at z_c                               (F15)
    z_c = L F_c/sigma_0,    z_ba = L F_ba/sigma_0

The source leaves the rise of alpha open and shows half a sine; the linear one makes the motion beyond break-away a
logistic curve, which has closed forms. With the travel x and z towards the motion, b = z_c - z_ba, k = 1/z_c + 1/b

    dz/dx = (z_c - z) (z + b)/(z_c b)                                                    (F15)
    z(x) = z_0 + (z_c + b) s (1 - s) y/(1 - s y),    s = (z_c - z_0)/(z_c + b)           (F15)
    integral of z - z_0 over x = (z_c - z_0) x + z_c b ln(1 - s y),    y = 1 - exp(-k x) (F15)

The law is passive for every sigma_1, sigma_2 >= 0, with the energy sigma_0 z^2/2: the bristle never runs against the
motion, nor faster than it. (The condition (F10) of LuGre comes from its Stribeck curve, which this law does not have.)
L is ``torque_scale``.

Source: Dupont, Hayward, Armstrong, Altpeter, IEEE Trans. Automatic Control 47 (2002) 787-792. Deviations: alpha is
linear, the sliding torque does not depend on speed but for sigma_2, and a bristle beyond z_c is cut back to it. The
numbers of the equations are those of docs/model.md.
"""

import math
from typing import NamedTuple

from steer_env.friction import defaults
from steer_env.friction.bristle import limit_deflection
from steer_env.friction.law import register
from steer_env.friction.numerics.check import not_negative, positive
from steer_env.friction.numerics.kernel import kernel


class ElastoPlastic(NamedTuple):
    """Parameters, which ``friction.make("elasto_plastic", ...)`` checks and this class does not."""

    sigma_0: float  # stiffness below break-away [N m/rad]
    sigma_1: float  # bristle damping [N m s/rad]
    sigma_2: float  # viscous friction [N m s/rad]
    F_c: float  # sliding torque [N m]
    F_ba: float  # torque at break-away, above which the bristle slips [N m]


def make(
    *,
    sigma_0: float = defaults.SIGMA_0,
    sigma_1: float = defaults.SIGMA_1,
    sigma_2: float = 0.0,
    F_c: float = defaults.F_C,
    F_ba: float | None = None,
) -> ElastoPlastic:
    """Checked elasto-plastic parameters; ``F_ba`` is half of ``F_c`` by default, assumed.

    Raises
    ------
    ValueError
        For a value out of range, and for ``F_ba`` that is not below ``F_c``.
    """
    F_c = positive("F_c", F_c)
    F_ba = positive("F_ba", 0.5 * F_c if F_ba is None else F_ba)
    if not F_ba < F_c:
        raise ValueError(f"F_ba must be below F_c = {F_c:g} N m, got {F_ba:g}")
    return ElastoPlastic(
        positive("sigma_0", sigma_0), not_negative("sigma_1", sigma_1), not_negative("sigma_2", sigma_2), F_c, F_ba
    )


@kernel
def bristle_slope(z, z_c, b):
    """dz/dx of a bristle, both towards the motion (F15)."""
    return (z_c - z) * (z + b) / (z_c * b) if z > z_c - b else 1.0  # (F15)


@kernel
def bent(z, z_c, b, x):
    """Change of a bristle over a travel ``x >= 0``, both towards the motion, and the integral of the change over it."""
    elastic = min(max(z_c - b - z, 0.0), x)
    slipping = x - elastic
    if slipping == 0.0:
        return x, 0.5 * x * x
    gap = z_c - z - elastic
    s = gap / (z_c + b)  # (F15)
    y = -math.expm1(-(1.0 / z_c + 1.0 / b) * slipping)  # (F15)
    change = elastic + (z_c + b) * s * (1.0 - s) * y / (1.0 - s * y)  # (F15)
    # (F15)
    return change, elastic * (0.5 * elastic + slipping) + gap * slipping + z_c * b * math.log1p(-s * y)


@kernel
def mean_torque(p, torque_scale, memory, w, h):
    z_c, b = torque_scale * p.F_c / p.sigma_0, torque_scale * (p.F_c - p.F_ba) / p.sigma_0
    side = math.copysign(1.0, w)
    x = abs(w) * h
    z = side * limit_deflection(memory[0], z_c)
    change, area = bent(z, z_c, b, x)
    F = p.sigma_0 * (z + (area / x if x > 0.0 else 0.0)) + p.sigma_1 * change / h  # (F15)
    # in a short travel the difference of end and mean would cancel
    rise = (change - area / x) / x if x > 1e-6 * b else 0.5 * bristle_slope(z, z_c, b)
    slope = p.sigma_0 * h * rise + p.sigma_1 * bristle_slope(z + change, z_c, b) + p.sigma_2
    return side * F + p.sigma_2 * w, slope


@kernel
def advance(p, torque_scale, memory, w, h):
    z_c, b = torque_scale * p.F_c / p.sigma_0, torque_scale * (p.F_c - p.F_ba) / p.sigma_0
    side = math.copysign(1.0, w)
    z = side * limit_deflection(memory[0], z_c)
    change, _ = bent(z, z_c, b, abs(w) * h)
    memory[0] = side * limit_deflection(z + change, z_c)


@kernel
def torque(p, torque_scale, memory, w):
    z_c, b = torque_scale * p.F_c / p.sigma_0, torque_scale * (p.F_c - p.F_ba) / p.sigma_0
    z = limit_deflection(memory[0], z_c)
    return p.sigma_0 * z + (p.sigma_1 * bristle_slope(math.copysign(1.0, w) * z, z_c, b) + p.sigma_2) * w  # (F15)


@kernel
def rate(p, torque_scale, memory, w, out):
    z_c, b = torque_scale * p.F_c / p.sigma_0, torque_scale * (p.F_c - p.F_ba) / p.sigma_0
    out[0] = w * bristle_slope(math.copysign(1.0, w) * memory[0], z_c, b)  # (F15)


@kernel
def stored_energy(p, memory):
    return 0.5 * p.sigma_0 * memory[0] ** 2


register(
    "elasto_plastic",
    ElastoPlastic,
    make=make,
    memory_size=lambda p: 1,
    advance=advance,
    torque=torque,
    rate=rate,
    stored_energy=stored_energy,
    mean_torque=mean_torque,
    continuous=True,
    fitted=("sigma_0", "F_c"),
    units={"sigma_0": "N m/rad", "sigma_1": "N m s/rad", "sigma_2": "N m s/rad", "F_c": "N m", "F_ba": "N m"},
)
