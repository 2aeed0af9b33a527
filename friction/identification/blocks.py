"""Blocks of a record that are drawn anew: intervals that allow for errors which last, as those of a wrong law do.

Source: Kuensch, Annals of Statistics 17 (1989) 1217-1241.
"""

import numpy as np
from numpy.typing import NDArray

CONFIDENCE_LEVEL = 0.95  # of the intervals
DRAWS = 400


def redrawn(count: int, seed: int | np.random.Generator, draws: int = DRAWS) -> NDArray[np.float64]:
    """How often each of ``count`` blocks counts when as many are drawn anew, (draws, count)."""
    return np.random.default_rng(seed).multinomial(count, np.full(count, 1.0 / count), draws).astype(float)


def drawn_means(
    values: NDArray[np.float64], block: NDArray[np.int64], seed: int, draws: int = DRAWS
) -> NDArray[np.float64]:
    """Mean of values (T,) in each draw of their blocks (draws,), which are numbered from zero on, (T,)."""
    samples = np.bincount(block)
    times = redrawn(samples.size, seed, draws)
    return np.asarray(times @ np.bincount(block, values) / (times @ samples))


def widened(count: int, degrees: int) -> float:
    """Factor on the interval of draws of few blocks, with so many degrees of freedom left, by Student's t [1]."""
    from scipy.special import ndtri, stdtrit  # imported here, because that takes longer than the import of all laws

    tail = 0.5 + 0.5 * CONFIDENCE_LEVEL
    return float(np.sqrt(count / degrees) * stdtrit(degrees, tail) / ndtri(tail))


def percentile_interval(values: NDArray[np.float64]) -> tuple[float, float]:
    """Ends of the interval that holds ``CONFIDENCE_LEVEL`` of the values."""
    low, high = np.quantile(values, [0.5 - 0.5 * CONFIDENCE_LEVEL, 0.5 + 0.5 * CONFIDENCE_LEVEL])
    return float(low), float(high)


def not_negative_factors(
    A: NDArray[np.float64], y: NDArray[np.float64], free: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Least squares of ``A @ factors - y`` with factors that are not negative, but for the ``free`` ones.

    Of many rows, pass the triangle of their QR decomposition, or a root of their sums of products.
    """
    from scipy.optimize import nnls  # imported here, as above

    factors = nnls(np.column_stack([A, -A[:, free]]), y)[0]  # a free one is the difference of two that are not negative
    factors[: free.size][free] -= factors[free.size :]
    return np.asarray(factors[: free.size])
