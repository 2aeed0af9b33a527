"""Noise of a measured displacement: how large it is, and the motion behind it (F33)."""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.branches import turns_of

BAND = 9.0  # deviations of the noise: a smaller swing is no reversal; 20,000 samples of noise alone stay below it [1]
HARMLESS = 0.05  # noise of the speed between samples, of the speed itself [1]: less is left as it is
SMOOTH = 0.05  # noise of the speed after smoothing, of the speed itself [1]
LONGEST = 0.125  # window of the smoothing, of the branch [1]


def noise_of(values: NDArray) -> float:
    """Standard deviation of white noise on a smooth history, from its third differences; outliers do not count.

    The third differences of white noise have 20 times its variance; those of a smooth motion are small.
    """
    return 1.4826 * float(np.median(np.abs(np.diff(values, 3)))) / math.sqrt(20.0) if values.size > 3 else 0.0


def motion_of(x: NDArray, noise: float) -> NDArray[np.float64]:
    """The motion behind a displacement with white noise (F33).

    Between reversals the motion goes one way: it is the monotone history nearest to the samples, by isotonic
    regression, and then a moving mean that narrows towards the reversals, so that it does not round them. The number of
    samples in the mean brings the noise of the speed to ``SMOOTH``. Noise too small to matter is left alone.

    Source: Barlow, Bartholomew, Bremner, Brunk, Statistical Inference under Order Restrictions, 1972. The moving mean
    is this project's.
    """
    step = float(np.mean(np.abs(np.diff(x, 1)))) if noise == 0.0 else _step(x, noise)
    if math.sqrt(2.0) * noise <= HARMLESS * step:
        return x
    from scipy.optimize import isotonic_regression  # imported here, because that takes longer than all laws

    turns = turns_of(x, BAND * noise)
    window = (12.0 * (noise / (SMOOTH * max(step, 1e-12 * noise))) ** 2) ** (1.0 / 3.0)
    motion = x.copy()
    motion[: turns[0]] = x[: turns[0] + 1].mean()
    for a, b in pairwise(turns):
        increasing = bool(x[b] > x[a])
        monotone = isotonic_regression(x[a : b + 1], increasing=increasing).x
        motion[a : b + 1] = _narrowing_mean(monotone, round(0.5 * min(window, LONGEST * (b - a))))
    return motion


def _step(x: NDArray, noise: float) -> float:
    """Mean distance between samples without that of the noise: the path from reversal to reversal."""
    turns = turns_of(x, BAND * noise)
    return float(np.sum(np.abs(np.diff(x[turns])))) / x.size


def _narrowing_mean(values: NDArray, half: int) -> NDArray[np.float64]:
    """Mean over up to ``half`` neighbours on each side, and over fewer near the ends."""
    n = values.size
    i = np.arange(n)
    reach = np.minimum(np.minimum(i, n - 1 - i), half)
    total = np.concatenate([[0.0], np.cumsum(values)])
    return (total[i + reach + 1] - total[i - reach]) / (2 * reach + 1)
