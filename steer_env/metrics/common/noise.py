"""How much of a low-passed channel is noise, judged from what the low-pass takes out."""

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from steer_env.metrics.common.reading import Reading
from steer_env.recording.recording import low_pass


def white(reading: Reading, name: str, cutoff: float) -> float:
    """Standard deviation of the white noise in a channel before its low-pass at ``cutoff`` [Hz], in the channel's unit.

    All that is above the cutoff is taken for noise of a white spectrum, and its median size for its deviation, so that
    a few jumps do not count.
    """
    smooth = reading[name]  # first, for it refuses what cannot be read
    above = reading.recording[name] - smooth
    deviation = 1.4826 * float(np.median(np.abs(above - np.median(above))))
    return deviation / float(np.sqrt(np.mean((1 - _gain(reading, cutoff)) ** 2)))


def in_band(reading: Reading, name: str, cutoff: float) -> float:
    """Standard deviation that white noise leaves in a channel low-passed at ``cutoff`` [Hz], in the channel's unit."""
    return white(reading, name, cutoff) * float(np.sqrt(np.mean(_gain(reading, cutoff) ** 2)))


def _gain(reading: Reading, cutoff: float) -> NDArray[np.float64]:
    """Of the low-pass, forwards and backwards, at frequencies up to half the sampling rate."""
    return np.abs(signal.sosfreqz(low_pass(cutoff, reading.recording.rate), 4096)[1]) ** (2 * reading.passes)
