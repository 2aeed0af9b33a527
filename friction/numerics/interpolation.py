"""Interpolation as kernels: the cubic that meets values and slopes at both ends, splines, and the cell of a grid."""

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.numerics.simd import any_of, where


@kernel
def hermite(s, start, end, start_slope, end_slope):
    """Value and slope of the cubic with given values and slopes at the ends of an interval (N5).

    Parameters
    ----------
    s : float
        Position in the interval, from 0 to 1.
    start, end : float
        Values at both ends.
    start_slope, end_slope : float
        Slopes at both ends, per length of the interval.

    Returns
    -------
    value, slope : float
        The slope is per length of the interval.
    """
    rise = end - start
    a, b = start_slope - rise, rise - end_slope
    bend = (1.0 - s) * a + s * b  # (N5)
    return start + s * rise + s * (1.0 - s) * bend, rise + (1.0 - 2.0 * s) * bend + s * (1.0 - s) * (b - a)  # (N5)


@kernel
def bracket(grid, x):
    """Cell of an ascending grid that holds ``x``, and the position in it from 0 to 1; the nearest end outside."""
    x = within(x, grid[0], grid[grid.size - 1])
    i = 0
    further = grid[1] < x
    while any_of(further):
        i = where(further, i + 1, i)
        further = grid[i + 1] < x
    return i, (x - grid[i]) / (grid[i + 1] - grid[i])


@kernel
def spline(x, y, at, slopes, ratios, found):
    """Read the cubic spline through points, without a knot at the second and at the last but one, at ascending places.

    Neighbouring cubics have the same second derivative at the knot between them, which their slopes s there solve; the
    first two, and the last two, are one cubic. With the widths h and the chords' slopes d of the cells at a knot:

        s_-/h_- + 2 (1/h_- + 1/h_+) s + s_+/h_+ = 3 (d_-/h_- + d_+/h_+)
        h_1 s_0 + (h_0 + h_1) s_1 = (h_0 + 2 (h_0 + h_1)) h_1/(h_0 + h_1) d_0 + h_0^2/(h_0 + h_1) d_1

    Parameters
    ----------
    x, y : (N,) array
        Knots, strictly ascending, at least four, and the values there.
    at : (M,) array
        Places, ascending; beyond the ends the outermost cubic goes on.
    slopes, ratios : (N,) array
        Receive the slopes at the knots, and what the elimination keeps.
    found : (M,) array
        Receives the values at the places.
    """
    last = x.size - 1
    h, g = x[1] - x[0], x[2] - x[1]
    ratios[0] = (h + g) / g
    slopes[0] = ((h + 2.0 * (h + g)) * g * (y[1] - y[0]) / h + h * h * (y[2] - y[1]) / g) / ((h + g) * g)
    for i in range(1, last):
        a, b = 1.0 / (x[i] - x[i - 1]), 1.0 / (x[i + 1] - x[i])
        pivot = 2.0 * (a + b) - a * ratios[i - 1]
        right = 3.0 * ((y[i] - y[i - 1]) * a * a + (y[i + 1] - y[i]) * b * b)
        slopes[i], ratios[i] = (right - a * slopes[i - 1]) / pivot, b / pivot
    h, g = x[last] - x[last - 1], x[last - 1] - x[last - 2]
    right = (h + 2.0 * (h + g)) * g * (y[last] - y[last - 1]) / h + h * h * (y[last - 1] - y[last - 2]) / g
    slopes[last] = (right / (h + g) - (h + g) * slopes[last - 1]) / (g - (h + g) * ratios[last - 1])
    for i in range(last - 1, -1, -1):
        slopes[i] -= ratios[i] * slopes[i + 1]
    i = 0
    for j in range(at.size):
        while i < last - 1 and x[i + 1] < at[j]:
            i += 1
        h = x[i + 1] - x[i]
        found[j] = hermite((at[j] - x[i]) / h, y[i], y[i + 1], h * slopes[i], h * slopes[i + 1])[0]
