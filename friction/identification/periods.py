"""The period of a displacement, and how far the friction of one period differs from that of the next (F36)."""

import numpy as np
from numpy.typing import NDArray

ALIKE = 0.9  # correlation of the displacement with itself one period later, at least [1]
EQUAL = 0.02  # difference of two periods' displacement over their travel, in which they are equal strokes, at most [1]


def moving(x: NDArray[np.float64]) -> NDArray[np.bool_]:
    """The samples (T,) at which a displacement moves, as a fit of a law without memory weighs them."""
    return np.diff(x, prepend=x[0]) != 0.0


def period(x: NDArray[np.float64]) -> int | None:
    """Samples of the period with which the displacement repeats, at least twice in the record; None if it does not."""
    from scipy.signal import correlate, find_peaks  # imported here, because that takes longer than all laws

    u = x - x.mean()
    found = correlate(u, u, method="fft")[x.size - 1 :]
    power = np.concatenate([[0.0], np.cumsum(u**2)])
    lags = np.arange(x.size // 2)
    norm = np.sqrt(power[x.size - lags] * (power[-1] - power[lags]))
    alike = found[: lags.size] / np.where(norm > 0.0, norm, 1.0)
    peaks = find_peaks(alike, height=ALIKE)[0]
    return int(peaks[0]) if peaks.size else None


def repeatability(x: NDArray[np.float64], friction: NDArray[np.float64], start: int = 0) -> float | None:
    """RMS difference of the friction one period later, over the samples from ``start`` on where it moves.

    [unit of the friction]; None where the displacement does not repeat. A period counts where the next one has the
    same strokes: the displacement differs by at most ``EQUAL`` of its travel, and did so for half a period before, so
    that the memory of the contact is the same.
    """
    n = period(x)
    if n is None:
        return None
    moves, squares = moving(x), []
    for a in range(max(start, n // 2), x.size - 2 * n + 1, n):
        both = x[a - n // 2 : a + n], x[a - n // 2 + n : a + 2 * n]
        if np.max(np.abs(both[1] - both[0])) <= EQUAL * min(map(np.ptp, both)):
            squares.append((friction[a + n : a + 2 * n] - friction[a : a + n])[moves[a : a + n]] ** 2)
    return float(np.sqrt(np.mean(np.concatenate(squares)))) if squares else None
