"""Noise of a measured displacement: how large it is, and the motion behind it (F33)."""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.branches import turns_of

BAND = 9.0  # deviations of the noise: a smaller swing is no reversal; 20,000 samples of noise alone stay below it [1]
NEAR = 6.0  # deviations of the noise: so near to a reversal its place is sought [1]
HARMLESS = 0.05  # noise of the speed between samples, of the speed itself [1]: less is left as it is
SMOOTH = 0.05  # noise of the speed after smoothing, of the speed itself [1]


def noise_of(values: NDArray) -> float:
    """Standard deviation of white noise on a smooth history, from its third differences; outliers do not count.

    The third differences of white noise have 20 times its variance; those of a smooth motion are small.
    """
    return 1.4826 * float(np.median(np.abs(np.diff(values, 3)))) / math.sqrt(20.0) if values.size > 3 else 0.0


def motion_of(x: NDArray, noise: float) -> NDArray[np.float64]:
    """The motion behind a displacement with white noise (F33).

    Between reversals the motion goes one way. Each branch is smoothed by itself with local parabolas (Savitzky, Golay),
    which does not round the reversals, and then replaced by the nearest monotone history (isotonic regression). The
    window of the parabolas brings the noise of the speed to ``SMOOTH``. Noise too small to matter is left alone.

    Sources: Savitzky, Golay, Analytical Chemistry 36 (1964) 1627-1639; Barlow, Bartholomew, Bremner, Brunk, Statistical
    Inference under Order Restrictions, 1972.
    """
    if noise == 0.0:
        return x
    turns = turns_of(x, BAND * noise)  # (F33)
    step = float(np.sum(np.abs(np.diff(x[turns])))) / x.size  # without the path of the noise
    if math.sqrt(2.0) * noise <= HARMLESS * step:
        return x
    window = (12.0 * (noise / (SMOOTH * max(step, 1e-3 * noise))) ** 2) ** (1.0 / 3.0)
    turns = [turns[0], *(_vertex(x, turn, NEAR * noise) for turn in turns[1:-1]), turns[-1]]
    motion = x.copy()
    motion[: turns[0]] = x[: turns[0] + 1].mean()
    for a, b in pairwise(turns):
        motion[a : b + 1] = _branch(x[a : b + 1], round(window))
    return motion


def _vertex(x: NDArray, turn: int, band: float) -> int:
    """The sample of a reversal, by a parabola through the samples about it that are within ``band`` of it [rad]."""
    far = np.abs(x - x[turn]) > band
    a = turn - int(np.argmax(far[turn::-1]))
    b = turn + int(np.argmax(far[turn:]))
    if b - a < 4 or not a < turn < b:
        return turn
    curvature, slope, _ = np.polyfit(np.arange(a, b + 1) - turn, x[a : b + 1] - x[turn], 2)
    return turn if curvature == 0.0 else int(np.clip(turn - round(0.5 * slope / curvature), a + 1, b - 1))


def _branch(x: NDArray, window: int) -> NDArray[np.float64]:
    """The smooth and monotone motion of one branch."""
    from scipy.optimize import isotonic_regression  # imported here, because that takes longer than all laws
    from scipy.signal import savgol_filter

    width = min(window, x.size) // 2 * 2 - 1  # odd
    smooth = savgol_filter(x, width, 2, mode="interp") if width > 3 else x
    return isotonic_regression(smooth, increasing=bool(x[-1] > x[0])).x
