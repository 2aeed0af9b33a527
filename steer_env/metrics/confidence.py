"""The 95 % interval of a mean over few repeats.

From eight repeats on by the bootstrap: percentiles of the studentised mean of resamples, which keep the level where
plain percentiles of ten values cover some 90 %. Fewer cannot be resampled usefully; Student's t serves there.

Source: Efron, Tibshirani, An Introduction to the Bootstrap, 1993, section 12.5.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import stats

LEVEL = 0.95
RESAMPLES = 1999
FEWEST = 8  # repeats for a bootstrap; assumed


def interval(values: NDArray[np.float64]) -> tuple[float, float]:
    """Lower and upper end for values (n,), one a repeat; NaN for a single one. The draw is seeded, so it repeats."""
    n, mean = values.size, float(values.mean())
    if n < 2:
        return np.nan, np.nan
    error = float(stats.sem(values))
    if error <= 1e-12 * abs(mean):  # a simulation repeats itself
        return mean, mean
    tail = 0.5 * (1 - LEVEL)
    if n < FEWEST:
        low, high = stats.t.ppf([tail, 1 - tail], n - 1)
    else:
        drawn = values[np.random.default_rng(0).integers(0, n, (RESAMPLES, n))]
        errors = stats.sem(drawn, axis=1)
        some = errors > 0
        low, high = np.quantile((drawn[some].mean(axis=1) - mean) / errors[some], [tail, 1 - tail])
    return float(mean - high * error), float(mean - low * error)
