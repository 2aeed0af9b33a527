"""Masing friction: springs with sliders in parallel (parallel Jenkins elements).

    T = sum k_i e_i + sigma_1 sum k_i de_i/dt / sum k_i                            (F5)
    de_i/dt = v, but 0 where |e_i| = L y_i and v increases |e_i|                   (F5)

An element is a spring up to its yield displacement and a constant torque after it, so every branch after a reversal is
the virgin curve scaled by two. The optional micro-damper ``sigma_1`` acts on the elastic motion only, as that of LuGre
does, and so leaves the saturated torque unchanged. L is ``torque_scale``.

The mean torque over a step h is piecewise quadratic in the distance D = |w| h, so the step equation times D becomes

    B D^2 + A D - C/2 = 0                                                          (F9)
    A = sum over yielded k_i (1 + d) g_i - |R - sum k e|,    d = sigma_1/(h sum k)
    B = S/h + sum over springs k_i (1/2 + d)
    C = sum over yielded k_i g_i^2,    g_i = L y_i - sgn(R - sum k e) e_i

Source: Masing, 2nd Int. Congress of Applied Mechanics, Zürich 1926; Iwan, J. Applied Mechanics 33 (1966) 893-900.
The numbers are those of docs/model.md.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.law import Sliders, register
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import not_negative, numbers
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.virgin_curve import checked, sliders, stiffnesses


class Masing(NamedTuple):
    """Parameters, which ``friction.make("masing", ...)`` checks and this class does not.

    The elements stand in ascending order of their yield displacements.
    """

    k: NDArray[np.float64]  # (N,) stiffnesses [N m/rad]
    y: NDArray[np.float64]  # (N,) yield displacements [rad]
    sigma_1: float  # micro-damping [N m s/rad]


def make(
    *,
    k: ArrayLike | None = None,
    y: ArrayLike | None = None,
    F_c: float | None = None,
    x_c: float | None = None,
    elements: int | None = None,
    sigma_1: float = 0.0,
) -> Masing:
    """Checked Masing parameters, from explicit elements ``k``, ``y`` or from an exponential virgin curve.

    The virgin curve is ``F_c (1 - exp(-x/x_c))``, by default with 10 elements and ``x_c = F_c/(2 SIGMA_0)``, for which
    the branch after a saturated reversal equals that of LuGre and Dahl.

    Raises
    ------
    ValueError
        For values out of range, more than 32 elements, or both descriptions at once.
    """
    damping = not_negative("sigma_1", sigma_1)
    return frozen(Masing(*sliders(k, y, F_c, x_c, elements), damping))


def from_virgin_curve(x: ArrayLike, T: ArrayLike, *, sigma_1: float = 0.0) -> Masing:
    """Elements whose virgin curve is the polygon from the origin through the points ``(x, T)``, flat after the last.

    Parameters
    ----------
    x : (N,) array_like
        Displacements, positive and ascending [rad].
    T : (N,) array_like
        Torques [N m], concave: each slope at most the one before, none negative.

    Raises
    ------
    ValueError
        If the polygon is not concave or not ascending.
    """
    xs, Ts = numbers("x", x), numbers("T", T)
    if xs.shape != Ts.shape:
        raise ValueError(f"x and T must be of equal length, got {xs.size} and {Ts.size} values")
    if np.any(np.diff(xs, prepend=0.0) <= 0.0):
        raise ValueError(f"x must be positive and ascending, got {xs}")
    k, slopes = stiffnesses(xs, Ts)
    if np.any(k < -1e-12 * np.abs(slopes).max()):  # the slopes of points on one line differ by rounding
        raise ValueError(f"a virgin curve must be concave with slopes that do not fall below zero, got slopes {slopes}")
    return frozen(Masing(*checked(np.maximum(k, 0.0), xs), not_negative("sigma_1", sigma_1)))


def virgin_torque(p: Masing, x: float | Sequence[float] | NDArray) -> NDArray[np.float64]:
    """Torque on first loading [N m] to the displacements ``x`` [rad], of any shape, which the result has too."""
    xs = np.asarray(x, float)[..., None]
    return np.sum(p.k * np.clip(xs, -p.y, p.y), axis=-1)


@kernel
def solve(p, torque_scale, memory, S, R, h, w_guess):
    """March over the elements that yield within the step (F9).

    ``gap`` is g_i, the distance of an element from its yield at the start of the step. A spring that yields reduces the
    resistance. D therefore only grows with the set of yielded elements, and no element has to leave the set: each pass
    adds the elements whose gaps D exceeds, until no element is added.
    """
    n = p.k.size
    rest = 0.0
    K = 0.0
    for i in range(n):
        limit = torque_scale * p.y[i]
        memory[i] = within(memory[i], -limit, limit)  # the torque scale may have fallen since the last step
        rest += p.k[i] * memory[i]
        K += p.k[i]
    if R == rest:
        return 0.0
    side = 1.0 if R > rest else -1.0
    damping = p.sigma_1 / (K * h)
    D = side * (R - rest) / (S / h + (0.5 + damping) * K)
    known = 0
    while True:
        yielded = 0
        A = side * (rest - R)
        B = S / h  # summed anew: subtracting the yielded springs from the whole leaves rounding where S/h is small
        C = 0.0
        for i in range(n):
            gap = torque_scale * p.y[i] - side * memory[i]
            if gap < D:
                A += p.k[i] * (1.0 + damping) * gap  # A of (F9)
                C += p.k[i] * gap * gap  # C of (F9)
                yielded += 1
            else:
                B += p.k[i] * (0.5 + damping)  # B of (F9)
        if yielded <= known:
            return side * D / h
        known = yielded
        # The positive root of (F9), in the form that does not cancel
        root = math.sqrt(A * A + 2.0 * B * C)
        D = C / (A + root) if A > 0.0 else (root - A) / (2.0 * B)


@kernel
def mean_torque(p, torque_scale, memory, w, h):
    """Mean of (F5) over the step: a spring that yields at the share s of it keeps its yield from there on."""
    side = math.copysign(1.0, w)
    D = abs(w) * h
    K = 0.0
    for i in range(p.k.size):
        K += p.k[i]
    damping = p.sigma_1 / (K * h)
    T = 0.0
    slope = 0.0  # by D
    for i in range(p.k.size):
        limit = torque_scale * p.y[i]
        e = within(memory[i], -limit, limit)  # the torque scale may have fallen since the last step
        gap = limit - side * e
        if gap < D:
            T += side * p.k[i] * (limit + damping * gap - 0.5 * gap * gap / D)
            slope += 0.5 * p.k[i] * gap * gap / (D * D)
        else:
            T += p.k[i] * (e + side * (0.5 + damping) * D)
            slope += (0.5 + damping) * p.k[i]
    return T, slope * h


@kernel
def advance(p, torque_scale, memory, w, h):
    D = w * h
    for i in range(p.k.size):
        limit = torque_scale * p.y[i]
        e = within(memory[i], -limit, limit)  # the torque scale may have fallen since the last step
        memory[i] = within(e + D, -limit, limit)


@kernel
def torque(p, torque_scale, memory, w):
    T = 0.0
    K = 0.0
    elastic = 0.0
    for i in range(p.k.size):
        limit = torque_scale * p.y[i]
        e = within(memory[i], -limit, limit)
        T += p.k[i] * e
        K += p.k[i]
        if w * e < limit * abs(w):
            elastic += p.k[i]
    return T + p.sigma_1 * w * elastic / K  # (F5)


@kernel
def rate(p, torque_scale, memory, w, out):
    for i in range(p.k.size):
        out[i] = w if w * memory[i] < torque_scale * p.y[i] * abs(w) else 0.0  # (F5)


@kernel
def stored_energy(p, memory):
    E = 0.0
    for i in range(p.k.size):
        E += 0.5 * p.k[i] * memory[i] ** 2
    return E


def _of_sliders(F: NDArray, y: NDArray) -> Masing:
    return frozen(Masing(*checked(F / y, y), 0.0))


register(
    "masing",
    Masing,
    make=make,
    memory_size=lambda p: p.k.size,
    advance=advance,
    torque=torque,
    rate=rate,
    stored_energy=stored_energy,
    mean_torque=mean_torque,
    solve=solve,
    continuous=True,
    fitted=Sliders(_of_sliders),
    units={"k": "N m/rad", "y": "rad", "sigma_1": "N m s/rad"},
)
