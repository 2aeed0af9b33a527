"""Loops between handwheel angle, torque and lateral acceleration in a periodic test.

A recording is low-passed and cut into cycles at the zero crossings of the handwheel angle, and each cycle is
interpolated at 1000 instants. The first and the last cycle are left out, and so are cycles at either end that do not
reach the full amplitude.

The loop y(x) of a cycle has a rising and a falling branch, separated by the turning points of x.
* A value at a level of x is interpolated where each branch crosses that level.
* A slope is that of a parabola through the samples of a branch within a fixed window around the level, +-0.05 g or
  +-4 deg whatever the amplitude; it is averaged over both branches.
* At a level other than zero, both +level and -level count, the latter mirrored, so that an offset of a sensor drops
  out.
"""

from collections.abc import Mapping
from functools import cache, partial
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from steer_env.metrics.common.definitions import SPEED_SPREAD, RefusedError
from steer_env.metrics.common.filtered_channels import ANGLE, AY, CHANNELS, SPEED, FilteredChannels
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle.constants import GRAVITY as G

CUTOFF = 5.0  # low-pass [Hz]
PEAK_CUTOFF = 10.0  # low-pass of the channels whose peaks are read; 5 Hz moves the corner from dry friction [Hz]
SAMPLES_PER_CUTOFF = 40.0  # sampling rate of the splines through the low-passed channels, over the cutoff [1]
SAMPLES = 1000  # samples of a cycle
WINDOW = {AY: 0.05 * G, ANGLE: 4 * DEGREE}  # half width of the window of a slope; assumed [m/s2, rad]
FEWEST_IN_WINDOW = 8  # samples that a parabola needs; assumed
SPREAD = 0.2  # largest deviation of a settled cycle's amplitude from their median, as a fraction of it; assumed [1]
END_SLACK = 0.02  # part of the first and the last cycle that may be missing, as a fraction of a period; assumed [1]
FREQUENCY_SPREAD = 0.1  # largest deviation from the expected frequency, as a fraction of it; assumed [1]


class Loops:
    """The settled cycles of a periodic test, and the values of their loops.

    Raises ValueError if the recording cannot be filtered, or if fewer than ``fewest`` similar cycles of about
    ``frequency_hz`` remain without the first and the last; the text says what to do.
    """

    def __init__(self, recording: Recording, conditions: Mapping[str, Any], fewest: int) -> None:
        self._smooth = FilteredChannels(recording, CUTOFF)
        starts = _cycle_starts(self._smooth.time, self._smooth[ANGLE], conditions["frequency_hz"])
        self.count = max(len(starts) - 3, 0)
        if self.count < fewest:
            raise RefusedError(f"{self.count} settled cycles between first and last: steer {fewest + 2} or more")
        self.period = np.diff(starts)[1:-1]  # [s]
        # The dropped cycles remain as margins, because a branch may begin up to half a cycle before its cycle.
        time = np.interp(np.arange((self.count + 2) * SAMPLES) / SAMPLES, np.arange(self.count + 3), starts)
        sharp = FilteredChannels(recording, min(PEAK_CUTOFF, recording.rate / 4))
        self._raw, self._sharp = (cache(partial(_interpolated, of, time)) for of in (self._smooth, sharp))
        self._samples = cache(lambda name: self._without_drift(self._raw(name)))
        # Several metrics use the same values.
        self.fundamental, self.peak = cache(self._fundamental), cache(self._peak)
        self.at, self.slope = cache(self._at), cache(self._slope)
        span = np.ptp(self.cycles(AY if AY in self._smooth else ANGLE), axis=1)
        if np.any(np.abs(span - np.median(span)) > SPREAD * np.median(span)):
            raise RefusedError(f"the cycles' amplitudes are over {SPREAD:.0%} apart: hold angle and speed")
        if SPEED in self._smooth:
            speed = self._settled(self._raw(SPEED)).mean(axis=1)
            if np.any(np.abs(speed - speed.mean()) > SPEED_SPREAD * np.abs(speed.mean())):
                raise RefusedError(f"{SPEED} differs between cycles by over {SPEED_SPREAD:.0%}: hold it constant")

    def cycles(self, name: str, shift: int = 0) -> np.ndarray:
        """Samples (n, SAMPLES) of a channel, from ``shift`` samples after the handwheel angle's rising crossing."""
        return self._settled(self._samples(name), shift)

    def mean_cycle(self, name: str) -> np.ndarray:
        """Mean (SAMPLES,) of the settled cycles, closed by its first sample."""
        mean = self.cycles(name).mean(axis=0)
        return np.append(mean, mean[0])

    def _settled(self, samples: np.ndarray, shift: int = 0) -> np.ndarray:
        start = SAMPLES + shift
        return samples[start : start + self.count * SAMPLES].reshape(self.count, SAMPLES)

    def _without_drift(self, samples: np.ndarray) -> np.ndarray:
        """Samples less the linear drift of the means of the cycles, which would open every loop."""
        means, order = self._settled(samples).mean(axis=1), np.arange(self.count) - (self.count - 1) / 2
        rise = order @ means / max(order @ order, 1.0)  # one cycle shows no drift
        return samples - rise * (np.arange(samples.size) - samples.size / 2) / SAMPLES

    def _fundamental(self, name: str) -> np.ndarray:
        """Complex amplitude (n,) of the first harmonic; refused if it opposes that of the handwheel angle."""
        angle, harmonic = self._harmonic(ANGLE), self._harmonic(name)
        if np.mean(harmonic * angle.conj()).real <= 0:
            raise RefusedError(f"{name} does not follow {ANGLE}: check the signs, a left turn is positive in both")
        return harmonic

    def _harmonic(self, name: str) -> np.ndarray:
        return np.fft.rfft(self.cycles(name))[:, 1] * (2 / SAMPLES)

    def peak_acceleration(self) -> float:
        """Mean over the cycles of the peak lateral acceleration [g]."""
        return float(self.peak(AY).mean()) / G

    def _branches(self, y: str, x: str) -> tuple[np.ndarray, np.ndarray]:
        """Samples of y and x, each (2 n, SAMPLES/2), on the falling and the rising branch of x in each cycle."""
        self.fundamental(y)
        peak = round(-np.angle(self.fundamental(x).mean()) / (2 * np.pi) * SAMPLES)
        u, v = (self.cycles(name, peak).reshape(-1, SAMPLES // 2) for name in (y, x))
        return u, v

    def _at(self, y: str, x: str, level: float) -> np.ndarray:
        """y (n, 2) where the falling and the rising branch of x cross ``level``.

        Where noise causes several crossings of a branch, y is their mean.
        """
        u, v = self._branches(y, x)
        above = v >= level
        row, k = np.nonzero(above[:, 1:] != above[:, :-1])
        crossings = np.bincount(row, minlength=len(v))
        if np.any(crossings % 2 == 0):
            raise RefusedError(f"{x} does not cross {level:.3g} {CHANNELS[x]} on each branch: centre the weave")
        v0, u0 = v[row, k], u[row, k]
        read = u0 + (level - v0) / (v[row, k + 1] - v0) * (u[row, k + 1] - u0)
        return (np.bincount(row, read) / crossings).reshape(-1, 2)

    def width(self, y: str, x: str) -> np.ndarray:
        """Width (n,) of the loop y(x) at x = 0: y on the rising minus y on the falling branch."""
        return np.diff(self.at(y, x, 0.0))[:, 0]

    def mean_branch(self, y: str, x: str, level: float) -> np.ndarray:
        """y (n,) on the mean of the branches at x = level."""
        return (self.at(y, x, level) - self.at(y, x, -level)).mean(axis=1) / 2

    def _slope(self, y: str, x: str, level: float = 0.0) -> np.ndarray:
        """dy/dx (n,) on the mean of the branches at x = level, within the window of x."""
        window = WINDOW[x]
        u, v = self._branches(y, x)
        slopes = []
        for centre in (level, -level):
            place = (v - centre) / window  # -1 to 1 in the window
            near = np.abs(place) <= 1
            few = near.sum(axis=1).min() < FEWEST_IN_WINDOW
            if place.max(axis=1).min() < 1 or place.min(axis=1).max() > -1 or few:
                raise RefusedError(f"{x} does not span {centre:.3g} +- {window:.3g} {CHANNELS[x]}: steer further")
            powers = np.stack([near, near * place, near * place**2])  # of the normal equations
            moments = np.einsum("ibt,jbt->bij", powers, powers)
            slopes.append(np.linalg.solve(moments, np.einsum("ibt,bt->bi", powers, u)[..., None])[:, 1, 0] / window)
        return np.mean(np.reshape(slopes, (2, -1, 2)), axis=(0, 2))

    def _peak(self, name: str) -> np.ndarray:
        """Half the difference (n,) of samples half a cycle apart, where it is largest in the mean of the cycles.

        A separate search for each extreme would take more of the noise for signal.
        """
        self.fundamental(name)
        half = SAMPLES // 2
        mean = self.cycles(name).mean(axis=0)
        k = np.abs(mean[:half] - mean[half:]).argmax()
        cycles = self._settled(self._without_drift(self._sharp(name)))
        return np.abs(cycles[:, k] - cycles[:, k + half]) / 2

    def lag(self, name: str) -> np.ndarray:
        """Delay (n,) of a channel's first harmonic behind that of the handwheel angle [s]."""
        return np.angle(self.fundamental(ANGLE) * self.fundamental(name).conj()) / (2 * np.pi) * self.period


def _interpolated(smooth: FilteredChannels, time: np.ndarray, name: str) -> np.ndarray:
    thin = slice(None, None, max(int(smooth.recording.rate / (SAMPLES_PER_CUTOFF * CUTOFF)), 1))
    return CubicSpline(smooth.time[thin], smooth[name][thin])(time)


def _cycle_starts(time: np.ndarray, angle: np.ndarray, frequency: float) -> np.ndarray:
    """Rising zero crossings [s] that bound the cycles of full amplitude and one more cycle at each end as a margin."""
    s = angle - (angle.max() + angle.min()) / 2
    far = np.flatnonzero(np.abs(s) > s.max() / 4)  # a crossing counts once the angle stands out of the noise
    up = np.flatnonzero((s[far[:-1]] < 0) & (s[far[1:]] > 0))
    i, j = far[up], far[up + 1]
    starts = time[i] - s[i] * (time[j] - time[i]) / (s[j] - s[i])
    if starts.size < 2:
        raise RefusedError(f"no whole cycle of {ANGLE} found: cut off what is not the test with between(t0, t1)")
    period = np.median(np.diff(starts))
    if not abs(period * frequency - 1) <= FREQUENCY_SPREAD:
        found = 1 / period
        raise RefusedError(
            f"{ANGLE} is at {found:.4g} Hz, not {frequency:g} Hz: give frequency_hz={found:.4g} if that is right"
        )
    ends = np.array([starts[0] - period, starts[-1] + period])  # cycles may begin or end with the recording
    inside = np.clip(ends, time[0], time[-1])
    starts = np.sort(np.append(starts, inside[np.abs(ends - inside) < END_SLACK * period]))
    span = np.array([np.ptp(angle[(time >= a) & (time <= b)]) for a, b in pairwise(starts)])
    steered, full = (np.flatnonzero(span > fraction * np.median(span)) for fraction in (SPREAD, 1 - SPREAD))
    first, last = max(steered[0] + 1, full[0]), min(steered[-1] - 1, full[-1])
    return starts[first - 1 : last + 3]
