"""Hold: the vibration that remains while the hands pull with a constant torque.

The hold is the longest section in which the hand torque stays within 5 % of its median over the time in which the hands
pull. It begins at the end of the rise to that torque. Noise hides the end of a smooth rise, so that end is estimated
from the middle of the rise.
"""

import numpy as np
from scipy import stats

from steer_env.metrics.common.definitions import Bounded, RefusedError, metric, register_evaluation
from steer_env.metrics.common.events import true_runs
from steer_env.metrics.common.filtered_channels import TORQUE, FilteredChannels
from steer_env.metrics.common.noise import in_band
from steer_env.recording.recording import Recording

CUTOFF = 40.0  # low-pass, above the frequencies at which a friction law causes vibration [Hz]
HAND_CUTOFF = 10.0  # low-pass of the hand torque with which the hold is found [Hz]
BAND = 0.05  # largest deviation of a held torque, as a fraction of it; assumed [1]
# A smooth rise s = 3 x^2 - 2 x^3 takes 0.94 times as long from three quarters to its end as from one to three quarters.
TAIL = 0.94
SETTLING = 2.0  # time until the vibration that the rise excites has died out [s]
EDGE = 0.1  # time before the hands let go that the low-pass blurs [s]
LEAST_NOISE_SPANS = 3.0  # a ripple must exceed this many times the span of the noise; assumed [1]
BAR = "torsion_bar_torque"


class Hold:
    """The section of a recording in which the torque is held and the vibration from the rise has died out."""

    def __init__(self, recording: Recording, conditions: object) -> None:
        self.smooth, time = FilteredChannels(recording, CUTOFF), recording.time
        torque = FilteredChannels(recording, HAND_CUTOFF)[TORQUE]
        pulled = np.abs(torque) > 0.5 * np.quantile(np.abs(torque), 0.95)
        level = np.median(torque[pulled]) if pulled.any() else 0.0
        held = true_runs(np.abs(torque - level) < BAND * abs(level))
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
        """Highest minus lowest value of a channel; refused where the span of the noise is a third of it or more.

        Noise increases the span by at most its own span, and decreases it by at most two deviations at each end.
        """
        span = float(np.ptp(self.smooth[name][self.inside]))
        independent = 2 * CUTOFF * (self.time[-1] - self.time[0])  # number of independent samples of noise of this band
        deviation = in_band(self.smooth, name, CUTOFF)
        noise = 2 * stats.norm.isf(0.5 / independent) * deviation
        if span < LEAST_NOISE_SPANS * noise:
            raise RefusedError(
                f"{name} spans {span:.2g} N m, of which noise alone would make {noise:.2g}: use a better sensor"
            )
        return Bounded(np.array([span]), noise, 2 * np.sqrt(2) * deviation)


def _end_of_rise(time: np.ndarray, part: np.ndarray, begin: float) -> float:
    """Time at which a torque that rises to 1 is reached [s], from its quarter and three quarters.

    ``begin`` where the torque does not rise.
    """
    below = [np.flatnonzero(part < level) for level in (0.25, 0.75)]
    if below[0].size == 0 or below[1][-1] + 1 == time.size:
        return begin
    k = [int(samples[-1]) for samples in below]
    quarter, three = (float(np.interp(level, part[i : i + 2], time[i : i + 2])) for i, level in zip(k, (0.25, 0.75)))
    return three + TAIL * (three - quarter)


register_evaluation("hold", Hold, constant_speed=False)


@metric("N m", "hold", usual=(0.0, 0.05), source="after JSME D&D 2021, paper 557")
def torsion_bar_ripple(hold: Hold) -> Bounded:
    """Highest minus lowest torsion-bar torque from two seconds into the hold to its end, low-passed at 40 Hz.

    The interval reaches down by the span that noise alone would have, estimated from the part above 40 Hz.
    """
    return hold.span(BAR)
