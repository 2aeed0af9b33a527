"""Held torque: what still moves while the hands pull with a constant torque.

The hold is where the hand torque stays longest within 5 % of what it is in most of the time that the hands pull; it
begins where the rise to it ends, which is told from its middle, as noise hides the end of a smooth rise.
"""

import numpy as np
from scipy import stats

from steer_env.metrics.common.definitions import Bounded, RefusedError, metric, procedure
from steer_env.metrics.common.events import runs
from steer_env.metrics.common.noise import in_band
from steer_env.metrics.common.reading import TORQUE, Reading
from steer_env.recording.recording import Recording

CUTOFF = 40.0  # low-pass, above what a friction law makes vibrate [Hz]
HAND = 10.0  # low-pass of the hand torque, to find the hold [Hz]
BAND = 0.05  # of the held torque in which it is held; assumed
# A smooth rise s = 3 x^2 - 2 x^3 is at its end 0.94 times its time from one to three quarters after three quarters.
TAIL = 0.94
SETTLING = 2.0  # until what the rise excites has died out [s]
EDGE = 0.1  # before the hands let go, which the low-pass blurs [s]
CLEAR = 3.0  # times the span of the noise that a ripple must exceed; assumed
TWIST = "torsion_bar_torque"


class Hold:
    """The part of a recording in which torque is held and the rise has died out."""

    def __init__(self, recording: Recording, asked: object) -> None:
        self.smooth, time = Reading(recording, CUTOFF), recording.time
        torque = Reading(recording, HAND)[TORQUE]
        pulled = np.abs(torque) > 0.5 * np.quantile(np.abs(torque), 0.95)
        level = np.median(torque[pulled]) if pulled.any() else 0.0
        held = runs(np.abs(torque - level) < BAND * abs(level))
        first, last = max(held, key=lambda run: time[run[1] - 1] - time[run[0]], default=(0, 1))
        if not time[last - 1] - time[first] >= SETTLING + 1.0:
            raise RefusedError(
                f"{TORQUE} is held within {BAND:.0%} for {time[last - 1] - time[first]:.2g} s: hold it for "
                f"{SETTLING + 1:g} s or longer"
            )
        start = _end_of_rise(time[:first], torque[:first] / level, time[first])
        end = time[last - 1] - (EDGE if last < time.size else 0.0)
        self.inside = (time >= start + SETTLING) & (time <= end)
        self.time = time[self.inside]

    def span(self, name: str) -> Bounded:
        """Highest less lowest of a channel; refused where the span of the noise is a third of it or more.

        Noise adds up to its own span, and takes from both ends no more than two deviations each.
        """
        span = float(np.ptp(self.smooth[name][self.inside]))
        alike = 2 * CUTOFF * (self.time[-1] - self.time[0])  # samples that noise of this band makes independent
        deviation = in_band(self.smooth, name, CUTOFF)
        noise = 2 * stats.norm.isf(0.5 / alike) * deviation
        if span < CLEAR * noise:
            raise RefusedError(
                f"{name} spans {span:.2g} N m, of which noise alone would make {noise:.2g}: use a better sensor"
            )
        return Bounded(np.array([span]), noise, 2 * np.sqrt(2) * deviation)


def _end_of_rise(time: np.ndarray, part: np.ndarray, begin: float) -> float:
    """When torque that rises to 1 is held, from where it passes its quarters; ``begin`` where it does not rise."""
    below = [np.flatnonzero(part < level) for level in (0.25, 0.75)]
    if below[0].size == 0 or below[1][-1] + 1 == time.size:
        return begin
    k = [int(samples[-1]) for samples in below]
    quarter, three = (float(np.interp(level, part[i : i + 2], time[i : i + 2])) for i, level in zip(k, (0.25, 0.75)))
    return three + TAIL * (three - quarter)


procedure("hold", Hold, constant_speed=False)


@metric("N m", "hold", usual=(0.0, 0.05), source="after JSME D&D 2021, paper 557")
def torsion_bar_ripple(hold: Hold) -> Bounded:
    """Highest less lowest torsion-bar torque from two seconds into the hold to its end, low-passed at 40 Hz.

    The interval reaches down by the span that noise alone would have, judged from what is above 40 Hz.
    """
    return hold.span(TWIST)
