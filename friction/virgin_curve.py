"""Springs with sliders in parallel from the virgin curve that they have together."""

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.check import number

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
