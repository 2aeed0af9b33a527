"""Features of a noisy curve that several tests need: runs of samples, crossings and peaks."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicHermiteSpline

from steer_env.metrics.common.definitions import RefusedError

Array = NDArray[np.floating[Any]]

TOP = 0.7  # fraction of a peak's height above its base from which on samples enter the fit; assumed [1]
FEWEST = 5  # samples that the fit of a peak needs; assumed


def true_runs(mask: NDArray[np.bool_], gap: int = 0) -> list[tuple[int, int]]:
    """Runs ``[i, j)`` of samples where a mask (T,) is true; runs at most ``gap`` samples apart are joined."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    joined: list[tuple[int, int]] = []
    for i, j in edges.reshape(-1, 2).tolist():
        if joined and i - joined[-1][1] <= gap:
            joined[-1] = (joined[-1][0], j)
        else:
            joined.append((i, j))
    return joined


def integral(x: Array, y: Array) -> CubicHermiteSpline:
    """Integral over x of a smooth, evenly sampled y (T,), as a function that can be evaluated between the samples."""
    step, slope = x[1] - x[0], np.gradient(y, x)
    total = cumulative_trapezoid(y, x, initial=0.0) - step**2 / 12.0 * (slope - slope[0])
    return CubicHermiteSpline(x, total, y)


def crossing(x: Array, y: Array, level: float) -> float:
    """Where y (T,) over x (T,) first rises to a level, interpolated linearly; RefusedError if it does not."""
    above = np.flatnonzero((y[1:] >= level) & (y[:-1] < level))
    if not above.size:
        raise RefusedError(f"the response does not cross {level:.3g} in its unit: record more of it")
    k = int(above[0])
    return float(x[k] + (level - y[k]) / (y[k + 1] - y[k]) * (x[k + 1] - x[k]))


def peak(x: Array, y: Array, base: float = 0.0) -> tuple[float, float]:
    """Place and height of the highest peak of y (T,), from a cubic through the samples of its top.

    The fit averages the noise. RefusedError where the highest sample is at an end, or the top has too few samples.
    """
    k = int(np.argmax(y))
    if k in (0, y.size - 1):
        raise RefusedError("the response has no peak within the section that is evaluated")
    low = np.flatnonzero(y < base + TOP * (y[k] - base))
    i = int(low[low < k].max(initial=-1)) + 1
    j = int(low[low > k].min(initial=y.size))
    if j - i < FEWEST:
        raise RefusedError(f"{j - i} samples at the peak are too few: sample faster, or steer further")
    half = max(x[j - 1] - x[k], x[k] - x[i])
    u = (x[i:j] - x[k]) / half
    powers = u ** np.arange(4)[:, None]
    fit = np.linalg.solve(powers @ powers.T, powers @ y[i:j])
    c, b, a = (fit[1:] * [1.0, 2.0, 3.0]).tolist()
    discriminant = b * b - 4.0 * a * c
    if not (b < 0.0 < discriminant):
        raise RefusedError("the response has no clear peak within the section that is evaluated")
    top = 2.0 * c / (-b + np.sqrt(discriminant))  # the zero of the slope at the maximum; also right for a small a
    if not u[0] <= top <= u[-1]:
        raise RefusedError("the response has no clear peak within the section that is evaluated")
    return float(x[k] + top * half), float(fit @ top ** np.arange(4))
