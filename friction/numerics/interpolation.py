"""Interpolation as kernels: the cubic that meets values and slopes at both ends, and the cell of a grid."""

from steer_env.friction.numerics.kernel import kernel


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
    last = grid.size - 1
    if x <= grid[0]:
        return 0, 0.0
    if x >= grid[last]:
        return last - 1, 1.0
    i = 0
    while grid[i + 1] < x:
        i += 1
    return i, (x - grid[i]) / (grid[i + 1] - grid[i])
