"""Noise of a measured displacement: how large it is, and the motion behind it (F33)."""

import math
from collections.abc import Sequence
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.branches import find_reversals

BAND = 9.0  # deviations of the noise: a smaller swing is no reversal; 20,000 samples of noise alone stay below it [1]
REVERSAL_NEIGHBOURHOOD = 6.0  # deviations of the noise: so near to a reversal its place is sought [1]
HARMLESS = 0.005  # noise of the speed between samples, of the speed itself [1]: less is left as it is
LATTICE = 1e-6  # departure of steps from multiples of the least one [1]
SMOOTH = 0.05  # noise of the speed after smoothing, of the speed itself [1]
ORDER = 4  # of local polynomials
WINDOWS = tuple(sorted({2 * round(3.0 * 1.25**i) + 1 for i in range(20)}))  # tried, of local polynomials [samples]
STAIRS = 0.1  # samples in motion after which the step changes, of a staircase at least [1]; assumed


def white_noise_deviation(values: NDArray) -> float:
    """Standard deviation of white noise on a smooth history, from its third differences; outliers do not count.

    The third differences of white noise have 20 times its variance; those of a smooth motion are small.
    """
    return 1.4826 * float(np.median(np.abs(np.diff(values, 3)))) / math.sqrt(20.0) if values.size > 3 else 0.0


def displacement_noise(x: NDArray) -> float:
    """Standard deviation of the noise of a displacement, which steps of its sensor or its file are too (F33)."""
    return max(white_noise_deviation(x), sensor_step(x) / math.sqrt(12.0))


def sensor_step(x: NDArray) -> float:
    """Step of a displacement that is recorded in steps, at which a motion hesitates; 0 for any other (F33).

    An even motion of one step for each sample is no such staircase.
    """
    steps = np.diff(x)
    sizes = np.abs(steps[steps != 0.0])
    if sizes.size < 2:
        return 0.0
    shares = sizes / np.min(sizes)
    uneven = np.mean(np.abs(np.diff(steps))[steps[:-1] != 0.0] > 0.5 * np.min(sizes))
    even = np.all(np.abs(shares - np.round(shares)) < LATTICE * shares)
    return float(np.min(sizes)) if even and uneven > STAIRS else 0.0


def smoothed_motion(x: NDArray, noise: float) -> NDArray[np.float64]:
    """The motion behind a displacement with white noise (F33).

    Between reversals the motion goes one way. Each branch is smoothed by itself with local polynomials (Savitzky,
    Golay), which does not round the reversals, and then replaced by the nearest monotone history (isotonic
    regression). The window of the polynomials is that of the least expected error (Mallows, Stein), among those that
    bring the noise of the speed to ``SMOOTH``; of a staircase, whose noise is not random, it is the shortest of them.
    Noise too small to matter is left alone.

    Sources: Savitzky, Golay, Analytical Chemistry 36 (1964) 1627-1639; Barlow, Bartholomew, Bremner, Brunk, Statistical
    Inference under Order Restrictions, 1972; Stein, Annals of Statistics 9 (1981) 1135-1151.
    """
    if noise == 0.0:
        return x
    step = float(np.sum(np.abs(np.diff(x[find_reversals(x, BAND * noise)])))) / x.size  # without the path of the noise
    if math.sqrt(2.0) * noise <= HARMLESS * step:
        return x
    least = (75.0 * (noise / (SMOOTH * max(step, 1e-3 * noise))) ** 2) ** (1.0 / 3.0)
    first = 2 * round(0.5 * least) + 1
    windows = [first] if sensor_step(x) else [first, *(each for each in WINDOWS if each > first)]
    smooth, window = _smoothed(x, noise, windows)
    turns = find_reversals(smooth, BAND * noise * 1.5 / math.sqrt(window))  # (F33) the noise that they leave
    inner = [_vertex(x, *each, REVERSAL_NEIGHBOURHOOD * noise) for each in zip(turns, turns[1:], turns[2:])]
    turns = [turns[0], *inner, turns[-1]]
    motion = x.copy()
    motion[: turns[0]] = x[: turns[0] + 1].mean()
    for a, b in pairwise(turns):
        motion[a : b + 1] = _monotone(_smoothed(x[a : b + 1], noise, windows)[0])
    return motion


def _smoothed(x: NDArray, noise: float, windows: Sequence[int]) -> tuple[NDArray[np.float64], int]:
    """The history of the window with the least expected error, and this window [samples].

    The mean square error is ``mean((x - smooth)^2) + 2 noise^2 w`` less a constant, with the weight w of a sample in
    its own polynomial.
    """
    tried, risks = [], []
    for window in sorted({min(each, x.size - 1 + x.size % 2) for each in windows}):
        smooth, own = _local(x, window) if window > ORDER else (x, 1.0)
        tried.append((smooth, window))
        risks.append(np.mean((x - smooth) ** 2) + 2.0 * noise**2 * own)
    return tried[int(np.argmin(risks))]


def _vertex(x: NDArray, before: int, turn: int, after: int, band: float) -> int:
    """The sample of a reversal, by a parabola through the samples about it that are within ``band`` of it [rad].

    It reaches half-way to the reversals ``before`` and ``after`` at most.
    """
    far = np.abs(x - x[turn]) > band
    far[[(before + turn) // 2, (turn + after) // 2]] = True
    a = turn - int(np.argmax(far[turn::-1]))
    b = turn + int(np.argmax(far[turn:]))
    if b - a < 4 or not a < turn < b:
        return turn
    curvature, slope, _ = np.polyfit(np.arange(a, b + 1) - turn, x[a : b + 1] - x[turn], 2)
    return turn if curvature == 0.0 else int(np.clip(turn - round(0.5 * slope / curvature), a + 1, b - 1))


def _monotone(x: NDArray) -> NDArray[np.float64]:
    """The nearest motion in one direction."""
    from scipy.optimize import isotonic_regression  # imported here, because that takes longer than all laws

    return isotonic_regression(x, increasing=bool(x[-1] > x[0])).x


def _local(x: NDArray, window: int) -> tuple[NDArray[np.float64], float]:
    """Local polynomials of a window, which at the ends are those of the outermost one, and the weight of a sample in
    its own.

    scipy's filter fits the polynomials of the ends anew in every call, which was most of its time, and loses digits in
    long windows (findings/scipy_savgol_long_window.sh).
    """
    Q, half = _polynomials(window), window // 2
    middle = Q @ Q[half]
    start, end = Q[:half] @ (Q.T @ x[:window]), Q[half + 1 :] @ (Q.T @ x[-window:])
    return np.concatenate([start, np.convolve(x, middle, "valid"), end]), float(middle[half])


@cache
def _polynomials(window: int) -> NDArray[np.float64]:
    """Orthonormal polynomials up to ``ORDER`` over a window, (window, ORDER + 1)."""
    return np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, window), ORDER + 1))[0]
