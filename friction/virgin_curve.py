"""Springs with sliders in parallel from the virgin curve that they have together."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction import defaults
from steer_env.friction.numerics.check import number, numbers, positive

Array = NDArray[np.float64]

MAX_ELEMENTS = 32  # springs of a law


def exponential(F_c: float, x_c: float, elements: float) -> tuple[Array, Array]:
    """Knots (N,) [rad] and torques (N,) [N m] of a polygon on ``F_c (1 - exp(-x/x_c))``.

    Raises
    ------
    ValueError
        Unless ``elements`` is a whole number from 1 to ``MAX_ELEMENTS``.
    """
    n = number("elements", elements, minimum=1, maximum=MAX_ELEMENTS)
    if n != int(n):
        raise ValueError(f"elements must be a whole number from 1 to {MAX_ELEMENTS}, got {elements!r}")
    # The chords of 1 - exp(-u) are equally far from the curve where the knots are spaced evenly in exp(-u/2). The last
    # knot carries the full torque and stands where the rest of the curve is as far off as the chords are.
    tail = 1.0 / (n + 1.0)
    u = -2.0 * np.log(np.linspace(1.0, tail, int(n) + 1)[1:])
    f = -np.expm1(-u)
    f[-1] = 1.0
    return x_c * u, F_c * f


def stiffnesses(x: Array, T: Array) -> tuple[Array, Array]:
    """Stiffnesses (N,) [N m/rad] of springs that yield at the knots ``x``, and the slopes (N,) of the polygon."""
    slopes = np.diff(T, prepend=0.0) / np.diff(x, prepend=0.0)
    return slopes - np.append(slopes[1:], 0.0), slopes


def sliders(
    k: ArrayLike | None, y: ArrayLike | None, F_c: float | None, x_c: float | None, elements: int | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stiffnesses and yields of sliders from explicit ``k`` and ``y``, or from an exponential virgin curve.

    By default the curve has 10 elements and ``x_c = F_c/(2 SIGMA_0)``.

    Raises
    ------
    ValueError
        For values out of range, more than ``MAX_ELEMENTS`` elements, or both descriptions at once.
    """
    if k is not None or y is not None:
        if k is None or y is None:
            raise ValueError(f"k and y must be given together, got {'y' if k is None else 'k'} alone")
        if any(value is not None for value in (F_c, x_c, elements)):
            raise ValueError("give either k and y, or F_c, x_c and elements, not both")
        return checked(k, y)
    F = positive("F_c", defaults.F_C if F_c is None else F_c)
    length = positive("x_c", F / (2.0 * defaults.SIGMA_0) if x_c is None else x_c)
    xs, Ts = exponential(F, length, 10 if elements is None else elements)
    return checked(np.maximum(stiffnesses(xs, Ts)[0], 0.0), xs)


def checked(k: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stiffnesses and yields in ascending order of the yields; raises ValueError for values out of range."""
    ks, ys = numbers("k", k), numbers("y", y)
    if ks.shape != ys.shape or ks.size > MAX_ELEMENTS:
        raise ValueError(f"k and y must hold 1 to {MAX_ELEMENTS} values each, got {ks.size} and {ys.size}")
    if np.any(ks < 0.0) or not ks.sum() > 0.0:
        raise ValueError(f"k must not be negative anywhere nor zero everywhere, got {ks}")
    if np.any(ys <= 0.0):
        raise ValueError(f"y must be positive, got {ys}")
    order = np.argsort(ys, kind="stable")
    return ks[order], ys[order]
