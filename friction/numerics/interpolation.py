"""Interpolation as kernels: the cubic that meets values and slopes at both ends, and the cell of a grid."""

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
