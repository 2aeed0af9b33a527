"""How much of a low-passed channel is noise, judged from what the low-pass takes out."""

import numpy as np
from scipy import signal

from steer_env.metrics.reading import Reading
from steer_env.recording import ORDER


def in_band(reading: Reading, name: str, cutoff: float) -> float:
    """Standard deviation that white noise leaves in a channel low-passed at ``cutoff`` [Hz], in the channel's unit.

    All that is above the cutoff is taken for noise of a white spectrum, and its median size for its deviation, so that
    a few jumps do not count.
    """
    smooth = reading[name]  # first, for it refuses what cannot be read
    above = reading.recording[name] - smooth
    low_pass = signal.butter(ORDER, cutoff, fs=reading.recording.rate, output="sos")
    gain = np.abs(signal.sosfreqz(low_pass, 4096)[1]) ** 2  # forwards and backwards
    deviation = 1.4826 * float(np.median(np.abs(above - np.median(above))))
    return deviation * float(np.sqrt(np.mean(gain**2) / np.mean((1 - gain) ** 2)))
