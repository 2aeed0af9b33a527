"""How much of a low-passed channel is noise, estimated from the part that the low-pass removes."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from steer_env.metrics.common.filtered_channels import FilteredChannels
from steer_env.recording.zero_phase import low_pass


def white(channels: FilteredChannels, name: str, cutoff: float) -> float:
    """Standard deviation of the white noise in a channel before its low-pass at ``cutoff`` [Hz], in the channel's unit.

    Everything above the cutoff is taken to be white noise. The deviation is estimated from the median of its size, so
    that a few jumps have no influence.
    """
    smooth = channels[name]  # first, because this refuses a channel that cannot be used
    above = channels.recording[name] - smooth
    deviation = 1.4826 * float(np.median(np.abs(above - np.median(above))))
    return deviation / float(np.sqrt(np.mean((1 - _gain(channels, cutoff)) ** 2)))


def in_band(channels: FilteredChannels, name: str, cutoff: float) -> float:
    """Standard deviation of the white noise left in a channel low-passed at ``cutoff`` [Hz], in the channel's unit."""
    return white(channels, name, cutoff) * float(np.sqrt(np.mean(_gain(channels, cutoff) ** 2)))


def _gain(channels: FilteredChannels, cutoff: float) -> NDArray[np.float64]:
    """Gain of the low-pass, applied forwards and backwards, at frequencies up to half the sampling rate."""
    return _response(cutoff, channels.recording.rate) ** (2 * channels.passes)


@lru_cache(maxsize=64)
def _response(cutoff: float, rate: float) -> NDArray[np.float64]:
    """Gain of one application of the low-pass."""
    return np.abs(signal.sosfreqz(low_pass(cutoff, rate), 4096)[1])
