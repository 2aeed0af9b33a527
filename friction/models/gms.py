"""Generalised Maxwell slip: springs with sliders in parallel, whose levels follow a Stribeck curve with a lag.

    T = sum F_i + sigma_2 v,    s(v) = L (F_c + (F_s - F_c) exp(-(v/v_s)^2))                      (F21)
    stick    dF_i/dt = k_i v                        until F_i sgn v reaches alpha_i s(v)           (F21)
    slip     dF_i/dt sgn v = C (alpha_i - F_i sgn v/s(v)), at most k_i |v|    until v crosses zero (F21)

The bound k_i |v| is not in the source. Without it a slipping element whose level rises (the speed falls) would load
its spring faster than the motion does and create energy; with it the slider never runs backwards, and every element is
passive by itself, however v and L change. It also makes the torque continuous at v = 0. Within a slower rise than the
bound, which is that of a spring, the law is the source's.

At constant speed w all of this has a closed form. With u = F_i sgn w, a = alpha_i s(w), t = |w| h and d = u - a,

    stick          u grows by k_i |w| per time up to a, and slips there                             (F22)
    slip, d < -b   u grows by k_i |w| up to a - b,    b = k_i |w| s/C                               (F22)
    slip, else     u = a + d exp(-C t/s)                                                            (F22)

The memory holds the torques F_i, then the modes of the elements: 0 for stick, the sign of the motion for slip. L is
``torque_scale``. Where it falls, elements are cut back to break-away at rest, L alpha_i F_s.

Source: Al-Bender, Lampaert, Swevers, IEEE Trans. Automatic Control 50 (2005) 1883-1887. The numbers are those of
docs/model.md.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction import defaults
from steer_env.friction.law import Sliders, register
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import not_negative, numbers, positive
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.virgin_curve import MAX_ELEMENTS, exponential, stiffnesses


class GMS(NamedTuple):
    """Parameters, which ``friction.make("gms", ...)`` checks and this class does not."""

    k: NDArray[np.float64]  # (N,) stiffnesses [N m/rad]
    alpha: NDArray[np.float64]  # (N,) shares of the level, of sum 1 [1]
    F_c: float  # sliding (Coulomb) torque [N m]
    F_s: float  # break-away torque [N m]
    v_s: float  # Stribeck speed [rad/s]
    C: float  # attraction: how fast a slipping torque follows its level [N m/s]
    sigma_2: float  # viscous friction [N m s/rad]


def make(
    *,
    k: ArrayLike | None = None,
    alpha: ArrayLike | None = None,
    F_c: float = defaults.F_C,
    F_s: float | None = None,
    v_s: float = defaults.V_S,
    C: float = 45.0,
    sigma_2: float = 0.0,
    sigma_0: float | None = None,
    elements: int | None = None,
) -> GMS:
    """Checked parameters, from explicit elements ``k``, ``alpha`` or from those of the Masing law.

    The elements of the Masing law have the virgin curve ``F_c (1 - exp(-2 sigma_0 x/F_c))``, by default 10 of them.
    ``F_s`` defaults to ``BREAK_AWAY`` times ``F_c``; the default ``C``, a lag of 20 ms, is assumed.

    Raises
    ------
    ValueError
        For values out of range, shares whose sum is not 1, ``F_s < F_c``, or both descriptions at once.
    """
    F_c = positive("F_c", F_c)
    F_s = defaults.BREAK_AWAY * F_c if F_s is None else positive("F_s", F_s)
    if F_s < F_c:
        raise ValueError(f"F_s must be at least F_c = {F_c:g} N m, got {F_s:g}")
    if k is None and alpha is None:
        stiffness = defaults.SIGMA_0 if sigma_0 is None else positive("sigma_0", sigma_0)
        x, T = exponential(F_c, F_c / (2.0 * stiffness), 10 if elements is None else elements)
        ks, _ = stiffnesses(x, T)
        shares = ks * x / F_c
    elif k is None or alpha is None:
        raise ValueError(f"k and alpha must be given together, got {'alpha' if k is None else 'k'} alone")
    elif sigma_0 is not None or elements is not None:
        raise ValueError("give either k and alpha, or sigma_0 and elements, not both")
    else:
        ks, shares = numbers("k", k), numbers("alpha", alpha)
    if ks.shape != shares.shape or ks.size > MAX_ELEMENTS:
        raise ValueError(f"k and alpha must hold 1 to {MAX_ELEMENTS} values each, got {ks.size}, {shares.size}")
    if np.any(ks <= 0.0) or np.any(shares <= 0.0):
        raise ValueError(f"k and alpha must be positive, got {ks} and {shares}")
    if abs(shares.sum() - 1.0) > 1e-9:
        raise ValueError(f"alpha must be shares of the whole, of sum 1, got the sum {shares.sum():.9g}")
    made = GMS(ks, shares, F_c, F_s, positive("v_s", v_s), positive("C", C), not_negative("sigma_2", sigma_2))
    return frozen(made)


@kernel
def level(p, torque_scale, w):
    """Level s of (F21) [N m], and its derivative by speed [N m s/rad]."""
    x = w / p.v_s
    bump = torque_scale * (p.F_s - p.F_c) * math.exp(-x * x)
    return torque_scale * p.F_c + bump, -2.0 * x / p.v_s * bump  # (F21)


@kernel
def _move_element(p, torque_scale, memory, i, side, speed, h, s):
    """An element after ``h`` at constant speed (F22).

    Returns
    -------
    u : float
        Torque in the direction of motion at the start, within break-away [N m].
    rising : float
        Time over which it rises by ``k_i |w|`` [s].
    bend : float
        Torque at the end of the rise [N m]; where it is ``a``, the element stays there, and else it decays towards it.
    sticks : bool
        Whether it sticks up to the end of the step.
    """
    limit = torque_scale * p.alpha[i] * p.F_s
    u = within(side * memory[i], -limit, limit)
    a = p.alpha[i] * s
    slips = memory[p.k.size + i] == side or u >= a
    bend = a - p.k[i] * speed * s / p.C if slips else a  # (F22)
    if u >= bend:
        return u, 0.0, u, False
    rising = (bend - u) / (p.k[i] * speed) if speed > 0.0 else math.inf
    if rising > h:
        return u, h, u + p.k[i] * speed * h, not slips
    return u, rising, bend, False


@kernel
def mean_torque(p, torque_scale, memory, w, h):
    """Mean torque: the integral over the rise and over the decay (F22), and its derivative by the speed."""
    side = math.copysign(1.0, w)
    speed = abs(w)
    s, ds = level(p, torque_scale, speed)
    F = 0.0
    dF = 0.0
    for i in range(p.k.size):
        a, da = p.alpha[i] * s, p.alpha[i] * ds
        u, rising, bend, _ = _move_element(p, torque_scale, memory, i, side, speed, h, s)
        if rising >= h:
            F += u + 0.5 * p.k[i] * speed * h
            dF += 0.5 * p.k[i] * h
            continue
        rest = h - rising
        d = bend - a
        X = p.C * rest / s
        gone = -math.expm1(-X)  # the part of d that has decayed
        dbend = 0.0
        drising = 0.0
        if rising > 0.0:
            dbend = da
            if d < 0.0:
                dbend -= p.k[i] * (s + speed * ds) / p.C
            drising = (dbend / p.k[i] - rising) / speed
        F += (rising * 0.5 * (u + bend) + rest * a + d * s / p.C * gone) / h  # (F22)
        rise = drising * (0.5 * (u + bend) - a) + 0.5 * rising * dbend
        decay = (dbend - da) * s / p.C * gone + d / p.C * ds * (gone - X * (1.0 - gone)) - d * (1.0 - gone) * drising
        dF += (rise + rest * da + decay) / h
    return side * F + p.sigma_2 * w, dF + p.sigma_2


@kernel
def advance(p, torque_scale, memory, w, h):
    n = p.k.size
    side = math.copysign(1.0, w)
    speed = abs(w)
    s, _ = level(p, torque_scale, speed)
    for i in range(n):
        if w == 0.0:
            limit = torque_scale * p.alpha[i] * p.F_s
            memory[i] = within(memory[i], -limit, limit)
            continue
        a = p.alpha[i] * s
        _, rising, bend, sticks = _move_element(p, torque_scale, memory, i, side, speed, h, s)
        if rising < h:
            bend = a + (bend - a) * math.exp(-p.C * (h - rising) / s)  # (F22)
        memory[i] = side * bend
        memory[n + i] = 0.0 if sticks and bend < a else side


@kernel
def torque(p, torque_scale, memory, w):
    T = 0.0
    for i in range(p.k.size):
        limit = torque_scale * p.alpha[i] * p.F_s
        T += within(memory[i], -limit, limit)
    return T + p.sigma_2 * w  # (F21)


@kernel
def rate(p, torque_scale, memory, w, out):
    n = p.k.size
    side = math.copysign(1.0, w)
    s, _ = level(p, torque_scale, w)
    for i in range(n):
        u = side * memory[i]
        out[i] = p.k[i] * w
        if w != 0.0 and (memory[n + i] == side or u >= p.alpha[i] * s):
            out[i] = side * min(p.C * (p.alpha[i] - u / s), p.k[i] * abs(w))  # (F21)
        out[n + i] = 0.0


@kernel
def stored_energy(p, memory):
    E = 0.0
    for i in range(p.k.size):
        E += 0.5 * memory[i] ** 2 / p.k[i]
    return E


def steepest_fall(p: GMS, torque_scale: float, h: float) -> float:
    """Bound of the fall of the mean torque with the speed (F18) [N m s/rad].

    It is that of the level, times what an element adds that decays to it from break-away: with r the excess over the
    level, ``1 - exp(-x) (1 - r x)`` is at most ``1 + r exp(-1 - 1/r)``. A short step does not lessen it: an element
    that slips follows its level with the lag only, but one that begins to slip within the step takes it at once.
    """
    r = p.F_s / p.F_c - 1.0
    if r == 0.0:
        return 0.0
    fall = torque_scale * (p.F_s - p.F_c) * math.sqrt(2.0 / math.e) / p.v_s
    return max(fall * (1.0 + r * math.exp(-1.0 - 1.0 / r)) - p.sigma_2, 0.0)  # (F18)


def _of_sliders(F: NDArray, y: NDArray) -> GMS:
    F_c = float(F.sum())
    return make(k=F / y, alpha=F / F_c, F_c=F_c, F_s=F_c)


def _one_slider(y: float, excess: float, v_s: float, C: float) -> GMS:
    return GMS(np.array([1.0 / y]), np.ones(1), 1.0, 1.0 + excess, v_s, C, 0.0)


register(
    "gms",
    GMS,
    make=make,
    memory_size=lambda p: 2 * p.k.size,
    modes=lambda p: p.k.size,
    advance=advance,
    torque=torque,
    rate=rate,
    stored_energy=stored_energy,
    mean_torque=mean_torque,
    steepest_fall=steepest_fall,
    fitted=Sliders(_of_sliders, _one_slider, viscous="sigma_2"),
    units={
        "k": "N m/rad",
        "alpha": "1",
        "F_c": "N m",
        "F_s": "N m",
        "v_s": "rad/s",
        "C": "N m/s",
        "sigma_2": "N m s/rad",
    },
)
