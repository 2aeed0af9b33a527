"""Masing: springs with sliders in parallel (parallel Jenkins elements).

    T = sum k_i e_i + s1 sum k_i de_i/dt / sum k_i,    de_i/dt = v unless |e_i| = y_i and v drives it on

An element is a spring up to its yield displacement and a constant torque after it, so every branch after a
reversal is the virgin curve scaled by two. The optional micro-damper ``sigma_1`` acts on the elastic motion only,
as LuGre's does, and so leaves the saturated torque alone.

Source: Masing, 2nd Int. Congress of Applied Mechanics, Zürich 1926; Iwan, J. Applied Mechanics 33 (1966) 893-900.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction import defaults
from steer_env.friction.confidence import half_widths
from steer_env.friction.law import register
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import not_negative, number, numbers, positive
from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.response import response

MAX_ELEMENTS = 32


class Masing(NamedTuple):
    """Unchecked parameters; ``friction.make("masing", ...)`` checks. Elements in ascending order of yield."""

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

    The virgin curve is ``F_c (1 - exp(-x/x_c))``; by default ``x_c = F_c/(2 SIGMA_0)``, for which the branch after a
    saturated reversal equals LuGre's and Dahl's, with 10 elements.

    Raises
    ------
    ValueError
        Values out of range, more than 32 elements, or both descriptions at once.
    """
    damping = not_negative("sigma_1", sigma_1)
    if k is not None or y is not None:
        if k is None or y is None:
            raise ValueError(f"k and y come together, got {'y' if k is None else 'k'} alone")
        if any(value is not None for value in (F_c, x_c, elements)):
            raise ValueError("give either k and y, or F_c, x_c and elements, not both")
        return _elements(k, y, damping)
    F = positive("F_c", defaults.F_C if F_c is None else F_c)
    length = positive("x_c", F / (2.0 * defaults.SIGMA_0) if x_c is None else x_c)
    n = number("elements", 10 if elements is None else elements, minimum=1, maximum=MAX_ELEMENTS)
    if n != int(n):
        raise ValueError(f"elements must be a whole number from 1 to {MAX_ELEMENTS}, got {elements!r}")
    # Chords of 1 - exp(-u) are equally far from it where the knots are even in exp(-u/2); the last knot stands
    # where the rest of the curve is as far off as the chords, and carries the full torque.
    tail = 1.0 / (n + 1.0)
    u = -2.0 * np.log(np.linspace(1.0, tail, int(n) + 1)[1:])
    f = -np.expm1(-u)
    f[-1] = 1.0
    return from_virgin_curve(length * u, F * f, sigma_1=damping)


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
    slopes = np.diff(Ts, prepend=0.0) / np.diff(xs, prepend=0.0)
    k = slopes - np.append(slopes[1:], 0.0)
    if np.any(k < -1e-12 * np.abs(slopes).max()):  # points on one line differ by rounding
        raise ValueError(f"a virgin curve must be concave with slopes that do not fall below zero, got slopes {slopes}")
    return _elements(np.maximum(k, 0.0), xs, not_negative("sigma_1", sigma_1))


def _elements(k: ArrayLike, y: ArrayLike, sigma_1: float) -> Masing:
    ks, ys = numbers("k", k), numbers("y", y)
    if ks.shape != ys.shape or ks.size > MAX_ELEMENTS:
        raise ValueError(f"k and y must hold 1 to {MAX_ELEMENTS} values each, got {ks.size} and {ys.size}")
    if np.any(ks < 0.0) or not ks.sum() > 0.0:
        raise ValueError(f"k must not be negative anywhere nor zero everywhere, got {ks}")
    if np.any(ys <= 0.0):
        raise ValueError(f"y must be positive, got {ys}")
    order = np.argsort(ys, kind="stable")
    ks, ys = np.ascontiguousarray(ks[order]), np.ascontiguousarray(ys[order])
    ks.flags.writeable = ys.flags.writeable = False
    return Masing(ks, ys, sigma_1)


def virgin_torque(p: Masing, x: float | Sequence[float] | NDArray) -> NDArray[np.float64]:
    """Torque on first loading to the displacement ``x``, of any shape [rad] -> same shape [N m]."""
    xs = np.asarray(x, float)[..., None]
    return np.sum(p.k * np.clip(xs, -p.y, p.y), axis=-1)


@kernel
def solve(p, level, memory, S, R, h, guess):
    """March over the elements that yield within the step.

    With D = |w| h and the elements of Y past their yield (gap g_i at the start of the step) the balance times D is
    (S/h + K/2 + s/h) D^2 + (A - |R|) D - C/2 = 0, where K sums the springs that still follow, A the torques at the
    start (at yield for Y) and C = sum over Y of k g^2. A spring that yields gives way, so D only grows with Y and no
    element ever has to leave it: each pass adds the gaps that D passes, until none is left.
    """
    n = p.k.size
    rest = 0.0
    K = 0.0
    for i in range(n):
        limit = level * p.y[i]
        memory[i] = within(memory[i], -limit, limit)  # the level may have fallen since the last step
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
        B = S / h  # summed afresh: taking the yielded springs from the whole leaves rounding where S/h is small
        C = 0.0
        for i in range(n):
            gap = level * p.y[i] - side * memory[i]
            if gap < D:
                A += p.k[i] * (1.0 + damping) * gap
                C += p.k[i] * gap * gap
                yielded += 1
            else:
                B += p.k[i] * (0.5 + damping)
        if yielded <= known:
            return side * D / h
        known = yielded
        # the root of B D^2 + A D - C/2 = 0 that is positive, in the form that does not cancel
        root = math.sqrt(A * A + 2.0 * B * C)
        D = C / (A + root) if A > 0.0 else (root - A) / (2.0 * B)


@kernel
def advance(p, level, memory, w, h):
    D = w * h
    for i in range(p.k.size):
        limit = level * p.y[i]
        e = within(memory[i], -limit, limit)  # the level may have fallen since the last step
        memory[i] = within(e + D, -limit, limit)


@kernel
def torque(p, level, memory, w):
    T = 0.0
    K = 0.0
    elastic = 0.0
    for i in range(p.k.size):
        limit = level * p.y[i]
        e = within(memory[i], -limit, limit)
        T += p.k[i] * e
        K += p.k[i]
        if w * e < limit * abs(w):
            elastic += p.k[i]
    return T + p.sigma_1 * w * elastic / K


@kernel
def rate(p, level, memory, w, out):
    for i in range(p.k.size):
        out[i] = w if w * memory[i] < level * p.y[i] * abs(w) else 0.0


@kernel
def stored_energy(p, memory):
    E = 0.0
    for i in range(p.k.size):
        E += 0.5 * p.k[i] * memory[i] ** 2
    return E


def fit_elements(x: NDArray, T: NDArray, dt: float, weighed: NDArray) -> tuple[Masing, float, dict[str, tuple]]:
    """Elements by non-negative least squares on a fixed grid of yields: no initial guess, no local minimum.

    The grid ends where an element only just yields, at half the widest swing of the weighed samples: a stiffer part
    is a spring to the record, and counts with the torque that it has reached. Intervals: ``F_c``, and ``virgin_torque``
    at each yield, as neighbouring elements trade stiffness freely and only their sum is determined.

    Source: Rizos, Fassois, Chaos 14 (2004) 431-445 (Maxwell slip as a regression); Lawson, Hanson, Solving Least
    Squares Problems, 1974.
    """
    from scipy.optimize import nnls  # here, for it takes longer to import than all laws

    widest = 0.5 * np.ptp(x[weighed])
    y = np.geomspace(1e-3 * widest, widest, MAX_ELEMENTS)
    ones = np.ones(np.count_nonzero(weighed))
    A = np.column_stack([*(response(_elements(1.0 / each, each, 0.0), x, dt)[weighed] for each in y), ones, -ones])
    _, R = np.linalg.qr(np.column_stack([A, T[weighed]]))  # the same squares in as many rows as columns
    F, _ = nnls(R[:, :-1], R[:, -1])
    residual = A @ F - T[weighed]
    offset = F[-2] - F[-1]
    used = np.flatnonzero(F[:-2])
    y, F = y[used], F[used]
    shares = np.minimum(y[:, None] / y, 1.0)  # of each element's torque in the virgin torque at each yield
    half = half_widths(A[:, np.append(used, -1)], residual, np.column_stack([shares, np.zeros(y.size)]))
    low, high = np.maximum(shares @ F - half, 0.0), shares @ F + half
    return _elements(F / y, y, 0.0), offset, {"F_c": (low[-1], high[-1]), "virgin_torque": (low, high)}


register(
    "masing",
    Masing,
    make=make,
    memory_size=lambda p: p.k.size,
    advance=advance,
    torque=torque,
    rate=rate,
    stored_energy=stored_energy,
    solve=solve,
    fitted=fit_elements,
)
