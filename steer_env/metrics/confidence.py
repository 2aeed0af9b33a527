"""The 95 % interval of a mean over few repeats.

From eight repeats on by the bootstrap: percentiles of the studentised mean of resamples, which keep the level where
plain percentiles of ten values cover some 90 %. Fewer cannot be resampled usefully; Student's t serves there.

Source: Efron, Tibshirani, An Introduction to the Bootstrap, 1993, section 12.5.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import special

LEVEL = 0.95
RESAMPLES = 1999
FEWEST = 8  # repeats for a bootstrap; assumed


@cache
def _resamples(n: int) -> NDArray[np.int64]:
    return np.random.default_rng(0).integers(0, n, (RESAMPLES, n))


def interval(values: NDArray[np.float64]) -> tuple[float, float]:
    """Lower and upper end for values (n,), one a repeat; NaN for a single one. The draw is seeded, so it repeats."""
    n, mean = values.size, float(values.mean())
    if n < 2:
        return np.nan, np.nan
    error = float(values.std(ddof=1)) / np.sqrt(n)
    if error <= 1e-12 * abs(mean):  # a simulation repeats itself
        return mean, mean
    tail = 0.5 * (1 - LEVEL)
    if n < FEWEST:
        low, high = special.stdtrit(n - 1, [tail, 1 - tail])  # quantiles of t
    else:
        drawn = values[_resamples(n)]
        errors = drawn.std(axis=1, ddof=1) / np.sqrt(n)
        some = errors > 0
        low, high = np.quantile((drawn[some].mean(axis=1) - mean) / errors[some], [tail, 1 - tail])
    return float(mean - high * error), float(mean - low * error)
