"""Static friction with a Stribeck curve, a set-valued law: Coulomb friction whose torque depends on the speed.

    T = [L F_c + L (F_s - F_c) exp(-(v/v_s)^2)] sgn v + sigma_2 v,   any |T| <= L F_s at rest      (F17)
    S w + T(w) = R:    w = 0 for |R| <= L F_s                                                      (F17)
    one solution if S > L (F_s - F_c) sqrt(2/e)/v_s - sigma_2                                      (F18)

Beyond the bound (F18) the equation has up to three solutions, of which the law takes rest where it is one, and else one
that the bisection finds. L is ``torque_scale``. The numbers are those of docs/model.md.

Source: Stribeck, Z. VDI 46 (1902) 1341; the form with the exponential of the squared speed: Armstrong-Hélouvry, Dupont,
Canudas de Wit, Automatica 30 (1994) 1083-1138.
"""

import math
from typing import NamedTuple

from steer_env.friction import defaults
from steer_env.friction.law import register
from steer_env.friction.numerics.check import not_negative, positive
from steer_env.friction.numerics.kernel import kernel


class Stribeck(NamedTuple):
    """Parameters, which ``friction.make("stribeck", ...)`` checks and this class does not."""

    F_c: float  # sliding (Coulomb) torque [N m]
    F_s: float  # break-away torque [N m]
    v_s: float  # Stribeck speed [rad/s]
    sigma_2: float  # viscous friction [N m s/rad]


def make(
    *,
    F_c: float = defaults.F_C,
    F_s: float | None = None,
    v_s: float = defaults.V_S,
    sigma_2: float = 0.0,
) -> Stribeck:
    """Checked Stribeck parameters; ``F_s`` defaults to ``BREAK_AWAY`` times ``F_c``.

    Raises
    ------
    ValueError
        For a value out of range, or ``F_s < F_c``.
    """
    F_c = positive("F_c", F_c)
    F_s = defaults.BREAK_AWAY * F_c if F_s is None else positive("F_s", F_s)
    if F_s < F_c:
        raise ValueError(f"F_s must be at least F_c = {F_c:g} N m, got {F_s:g}")
    return Stribeck(F_c, F_s, positive("v_s", v_s), not_negative("sigma_2", sigma_2))


@kernel
def torque(p, torque_scale, memory, w):
    # At rest the torque is whatever the balance needs; a displacement history has no balance, and zero is assumed.
    if w == 0.0:
        return 0.0
    x = w / p.v_s
    sliding = torque_scale * (p.F_c + (p.F_s - p.F_c) * math.exp(-x * x))
    return math.copysign(sliding, w) + p.sigma_2 * w  # (F17)


@kernel
def mean_torque(p, torque_scale, memory, w, h):
    x = w / p.v_s
    bump = torque_scale * (p.F_s - p.F_c) * math.exp(-x * x)
    side = math.copysign(1.0, w)  # also at rest
    T = side * (torque_scale * p.F_c + bump) + p.sigma_2 * w  # (F17)
    return T, p.sigma_2 - 2.0 * abs(x) / p.v_s * bump


@kernel
def solve(p, torque_scale, memory, S, R, h, w_guess):
    """Rest, or the root of (F17) between its bounds, by Newton steps within a bracket."""
    drive = abs(R)
    sliding = torque_scale * p.F_c
    if drive <= torque_scale * p.F_s:
        return 0.0
    slope = S + p.sigma_2
    low = (drive - torque_scale * p.F_s) / slope  # with the torque of rest, and with that of the highest speeds
    high = (drive - sliding) / slope
    s = abs(w_guess) if low < abs(w_guess) < high else high
    for _ in range(100):
        x = s / p.v_s
        bump = torque_scale * (p.F_s - p.F_c) * math.exp(-x * x)
        residual = slope * s + sliding + bump - drive  # (F17)
        gradient = slope - 2.0 * x / p.v_s * bump
        if residual > 0.0:
            high = s
        else:
            low = s
        new = s - residual / gradient if gradient > 0.0 else -1.0
        if abs(new - s) <= 1e-9 * s:  # quadratic convergence: the step after this one would be below rounding
            return math.copysign(new, R)
        if not low < new < high:
            new = 0.5 * (low + high)
            if not low < new < high:  # the bracket is down to neighbouring floats
                break
        s = new
    return math.copysign(s, R)


def steepest_fall(p: Stribeck, torque_scale: float, h: float) -> float:
    """Largest fall of the torque with the speed (F18) [N m s/rad], at ``v_s/sqrt(2)``."""
    return max(torque_scale * (p.F_s - p.F_c) * math.sqrt(2.0 / math.e) / p.v_s - p.sigma_2, 0.0)  # (F18)


register(
    "stribeck",
    Stribeck,
    make=make,
    torque=torque,
    mean_torque=mean_torque,
    solve=solve,
    steepest_fall=steepest_fall,
    fitted=("F_c",),
    units={"F_c": "N m", "F_s": "N m", "v_s": "rad/s", "sigma_2": "N m s/rad"},
)
