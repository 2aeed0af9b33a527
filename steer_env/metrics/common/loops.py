"""Loops between handwheel angle, torque and lateral acceleration in a periodic test.

A recording is low-passed and cut into cycles at the zero crossings of the handwheel angle, less the linear drift of its
zero where the means of the cycles show one. Each cycle is interpolated at 1000 instants. The first and the last cycle
are left out, and so are cycles at either end that do not reach the full amplitude.

The loop y(x) of a cycle has a rising and a falling branch, separated by the turning points of x.
* A value at a level of x is interpolated where each branch crosses that level.
* A slope is that of a parabola through the samples of a branch within a fixed window around the level, +-0.05 g or
  +-4 deg whatever the amplitude; it is averaged over both branches.
* At a level other than zero, both +level and -level count, the latter mirrored, so that an offset of a sensor drops
  out.
* Levels count from where the car goes straight. A test on a straight road turns the car neither way on the whole, so
  the means of lateral acceleration and yaw rate over whole cycles are the readings of these sensors at zero. Angle and
  torque have theirs on the mean of both branches, where the lateral acceleration passes its zero. Where both sensors
  show the same mean turn, the road may have been bent: then the intervals include the values without that assumption.
* The delay of every channel behind the handwheel angle is constant unless the clocks of two devices drift apart, or the
  drive itself changes, as on a banked road, down which the car runs. Where it changes significantly from cycle to
  cycle, the intervals include the change that accrues in half the recording.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from steer_env.friction.numerics.interpolation import spline
from steer_env.metrics.common.confidence import trend
from steer_env.metrics.common.definitions import SPEED_SPREAD, Doubt, RefusedError
from steer_env.metrics.common.filtered_channels import ANGLE, AY, CHANNELS, SPEED, TORQUE, YAW, FilteredChannels
from steer_env.metrics.common.kept import anew, kept
from steer_env.metrics.common.straight import NOTED_ZEROS, STANDING, describe_zeros
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
RESOLVED_TURN = 0.01 * DEGREE  # least mean yaw rate that is a turn; assumed [rad/s]
RESOLVED_ZERO = 0.05 * DEGREE  # least drift of the angle's zero over a recording that counts; assumed [rad]
FEWEST_OF_DRIFT = 5  # cycles, the first and the last included, that show a drift of the angle's zero; assumed
RESOLVED_DRIFT = 1e-4  # least drift of a clock within half a recording that counts; assumed [s]
CHANGING = "a delay that changes from cycle to cycle, of"
STEADY_DELAY = "record all channels with one clock; if they are, drive on a level road, as a bank changes it too"
FREQUENCY_SPREAD = 0.1  # largest deviation from the expected frequency, as a fraction of it; assumed [1]


class Loops:
    """The settled cycles of a periodic test, and the values of their loops.

    Raises ValueError if the recording cannot be filtered, or if fewer than ``fewest`` similar cycles of about
    ``frequency_hz`` remain without the first and the last; the text says what to do.
    """

    def __init__(self, recording: Recording, conditions: Mapping[str, Any], fewest: int) -> None:
        self._smooth, self._speed = FilteredChannels(recording, CUTOFF), conditions.get("speed_m_s") or 0.0
        starts = _steady_starts(self._smooth.time, self._smooth[ANGLE], conditions["frequency_hz"])
        self.count = max(len(starts) - 3, 0)
        if self.count < fewest:
            raise RefusedError(f"{self.count} settled cycles between first and last: steer {fewest + 2} or more")
        self.period = np.diff(starts)[1:-1]  # [s]
        # The dropped cycles remain as margins, because a branch may begin up to half a cycle before its cycle.
        self._time = np.interp(np.arange((self.count + 2) * SAMPLES) / SAMPLES, np.arange(self.count + 3), starts)
        self._sharp = FilteredChannels(recording, min(PEAK_CUTOFF, recording.rate / 4))
        self._bend, self._late = 0.0, dict.fromkeys(CHANNELS, 0.0)  # mean yaw rate [rad/s], delays to remove [s]
        span = np.ptp(self.cycles(AY if AY in self._smooth else ANGLE), axis=1)
        if np.any(np.abs(span - np.median(span)) > SPREAD * np.median(span)):
            raise RefusedError(f"the cycles' amplitudes are over {SPREAD:.0%} apart: hold angle and speed")
        if SPEED in self._smooth:
            speed = self._settled(self._raw(self._smooth, SPEED)).mean(axis=1)
            self._speed = speed.mean()
            if np.any(np.abs(speed - self._speed) > SPEED_SPREAD * np.abs(self._speed)):
                raise RefusedError(f"{SPEED} differs between cycles by over {SPEED_SPREAD:.0%}: hold it constant")

    def _otherwise(self, bend: float = 0.0, **late: float) -> "Loops":
        """The same loops on a road with a mean yaw rate of ``bend`` [rad/s], or with channels that are ``late`` [s]."""
        other = anew(self)
        other._bend, other._late = bend, {**self._late, **late}
        return other

    def _raw(self, channels: FilteredChannels, name: str) -> np.ndarray:
        """Samples ((count + 2) SAMPLES,) of a channel."""
        thin = slice(None, None, max(int(channels.recording.rate / (SAMPLES_PER_CUTOFF * CUTOFF)), 1))
        x, y, found = channels.time[thin].copy(), channels[name][thin].copy(), np.empty(self._time.size)
        spline(x, y, self._time + self._late[name], np.empty(x.size), np.empty(x.size), found)
        return found

    @kept
    def _drift_free(self, name: str) -> np.ndarray:
        return self._without_drift(self._raw(self._smooth, name))

    @kept
    def _samples(self, name: str) -> np.ndarray:
        return self._drift_free(name) - self.zero(name)

    @property
    def _motion(self) -> tuple[str, ...]:
        """The channels that show the turning of the car; none for a car that stands, also where a rig is at speed."""
        shown = (name for name in (AY, YAW) if name in self._smooth and _moves(self._smooth.recording, name))
        return tuple(shown) if self._speed > STANDING else ()

    @kept
    def zero(self, name: str) -> float:
        """Reading of a channel where the car goes straight; 0 where the recording does not tell."""
        if not self._motion or name not in NOTED_ZEROS:
            return 0.0
        if name in self._motion:
            bend = self._bend * (self._speed if name == AY else 1.0)
            return float(self._settled(self._drift_free(name)).mean()) - bend
        x = self._motion[0]
        u, v = (self._split(samples, x) for samples in (self._drift_free(name), self._samples(x)))
        return float(_crossed(u, v, x, 0.0).mean())

    def turn(self) -> float:
        """Mean yaw rate that all sensors of the car's turning show [rad/s]; 0 where they contradict each other."""
        shown = []
        for name in self._motion:
            try:
                shown.append(self.zero(name) / (self._speed if name == AY else 1.0))
            except RefusedError:  # the metrics of that channel are refused with this reason
                continue
        if not shown or not np.all(np.isfinite(shown)) or min(shown) * max(shown) <= 0:
            return 0.0
        return min(shown, key=abs)

    def _clock(self, name: str) -> float:
        """Change of a channel's delay behind the handwheel angle over half the recording [s]; 0 if not significant."""
        if self.count < 3:
            return 0.0
        turns = [np.fft.rfft(self._drift_free(n).reshape(-1, SAMPLES))[:, 1] for n in (ANGLE, name)]
        lags = np.angle(turns[0] * turns[1].conj()) / (2 * np.pi) * self.period.mean()
        rate, told = trend(np.arange(lags.size), lags)
        over = float(rate * 0.5 * np.ptp(self._smooth.time) / self.period.mean())
        return over if told and abs(over) > RESOLVED_DRIFT else 0.0

    @kept
    def doubts(self) -> list[Doubt]:
        """What the recording leaves open: whether the road was straight, and how the clocks of the channels go."""
        found = []
        if abs(self.turn()) > RESOLVED_TURN:
            remedy = "drive along a straight road, or give the offsets of the sensors in a mapping"
            found.append(Doubt("a bend of the road", remedy, (self._otherwise(self.turn()),)))
        for name in (TORQUE, AY, YAW):
            try:
                over = self._clock(name) if name in self._smooth else 0.0
            except RefusedError:  # the metrics of that channel are refused with this reason
                continue
            if over:
                others = tuple(self._otherwise(**{name: sign * over}) for sign in (1.0, -1.0))
                found.append(Doubt(f"{CHANGING} {name}", STEADY_DELAY, others))
        return found

    def notes(self) -> list[str]:
        """What was found out about the sensors, in sentences."""
        zeros = {}
        for name in NOTED_ZEROS:
            try:
                zeros[name] = self.zero(name) if name in self._smooth else 0.0
            except RefusedError:  # the metrics of that channel are refused with this reason
                continue
        found = describe_zeros(zeros, "where the car goes straight")
        for doubt in self.doubts():
            found.append(f"the intervals allow for {doubt.about}: {doubt.remedy}")
        return found

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

    @kept
    def fundamental(self, name: str) -> np.ndarray:
        """Complex amplitude (n,) of the first harmonic; refused if it opposes that of the handwheel angle."""
        angle, harmonic = self._harmonic(ANGLE), self._harmonic(name)
        if np.mean(harmonic * angle.conj()).real <= 0:
            raise RefusedError(f"{name} does not follow {ANGLE}: check the signs, a left turn is positive in both")
        return harmonic

    @kept
    def _harmonic(self, name: str) -> np.ndarray:
        return np.fft.rfft(self._settled(self._drift_free(name)))[:, 1] * (2 / SAMPLES)

    def peak_acceleration(self) -> float:
        """Mean over the cycles of the peak lateral acceleration [g]."""
        return float(self.peak(AY).mean()) / G

    def _branches(self, y: str, x: str) -> tuple[np.ndarray, np.ndarray]:
        """Samples of y and x, each (2 n, SAMPLES/2), on the falling and the rising branch of x in each cycle."""
        self.fundamental(y)
        self.fundamental(x)
        return self._split(self._samples(y), x), self._split(self._samples(x), x)

    def _split(self, samples: np.ndarray, x: str) -> np.ndarray:
        """Samples (2 n, SAMPLES/2) on the falling and the rising branch of x in each cycle."""
        peak = round(-np.angle(self._harmonic(x).mean()) / (2 * np.pi) * SAMPLES)
        return self._settled(samples, peak).reshape(-1, SAMPLES // 2)

    @kept
    def at(self, y: str, x: str, level: float) -> np.ndarray:
        """y (n, 2) where the falling and the rising branch of x cross ``level``.

        Where noise causes several crossings of a branch, y is their mean.
        """
        return _crossed(*self._branches(y, x), x, level)

    def width(self, y: str, x: str) -> np.ndarray:
        """Width (n,) of the loop y(x) at x = 0: y on the rising minus y on the falling branch."""
        return np.diff(self.at(y, x, 0.0))[:, 0]

    def mean_branch(self, y: str, x: str, level: float) -> np.ndarray:
        """y (n,) on the mean of the branches at x = level."""
        return (self.at(y, x, level) - self.at(y, x, -level)).mean(axis=1) / 2

    @kept
    def slope(self, y: str, x: str, level: float = 0.0) -> np.ndarray:
        """dy/dx (n,) on the mean of the branches at x = level, within the window of x."""
        window = WINDOW[x]
        u, v = self._branches(y, x)
        slopes = []
        for centre in dict.fromkeys((level, -level)):  # one at level zero
            place = (v - centre) / window  # -1 to 1 in the window
            near = np.abs(place) <= 1
            few = near.sum(axis=1).min() < FEWEST_IN_WINDOW
            if place.max(axis=1).min() < 1 or place.min(axis=1).max() > -1 or few:
                raise RefusedError(f"{x} does not span {centre:.3g} +- {window:.3g} {CHANNELS[x]}: steer further")
            powers = np.stack([near, near * place, near * place**2], axis=1)  # of the normal equations
            fit = np.linalg.solve(powers @ powers.swapaxes(1, 2), powers @ u[..., None])
            slopes.append(fit[:, 1, 0] / window)
        return np.mean(np.reshape(slopes, (len(slopes), -1, 2)), axis=(0, 2))

    @kept
    def peak(self, name: str) -> np.ndarray:
        """Half the difference (n,) of samples half a cycle apart, where it is largest in the mean of the cycles.

        A separate search for each extreme would take more of the noise for signal.
        """
        self.fundamental(name)
        half = SAMPLES // 2
        mean = self.cycles(name).mean(axis=0)
        k = np.abs(mean[:half] - mean[half:]).argmax()
        cycles = self._settled(self._without_drift(self._raw(self._sharp, name)))
        return np.abs(cycles[:, k] - cycles[:, k + half]) / 2

    def lag(self, name: str) -> np.ndarray:
        """Delay (n,) of a channel's first harmonic behind that of the handwheel angle [s]."""
        return np.angle(self.fundamental(ANGLE) * self.fundamental(name).conj()) / (2 * np.pi) * self.period


@kept
def _moves(recording: Recording, name: str) -> bool:
    """Whether a channel is anywhere other than zero."""
    return bool(np.any(recording[name]))


def _crossed(u: np.ndarray, v: np.ndarray, x: str, level: float) -> np.ndarray:
    """u (n, 2) where v, samples of the channel x, crosses ``level``; both are (2 n, SAMPLES/2), by branch."""
    above = v >= level
    row, k = np.nonzero(above[:, 1:] != above[:, :-1])
    crossings = np.bincount(row, minlength=len(v))
    if np.any(crossings % 2 == 0):
        raise RefusedError(f"{x} does not cross {level:.3g} {CHANNELS[x]} on each branch: centre the weave")
    v0, u0 = v[row, k], u[row, k]
    read = u0 + (level - v0) / (v[row, k + 1] - v0) * (u[row, k + 1] - u0)
    return (np.bincount(row, read) / crossings).reshape(-1, 2)


def _steady_starts(time: np.ndarray, angle: np.ndarray, frequency: float) -> np.ndarray:
    """As :func:`_cycle_starts`; where the zero of the angle clearly drifts, the drift is subtracted before.

    A zero that drifts shortens or lengthens every cycle between crossings, and with it biases the lags.
    """
    starts = _cycle_starts(time, angle, frequency)
    if starts.size < FEWEST_OF_DRIFT + 1:
        return starts
    cuts = np.searchsorted(time, starts)
    means = np.add.reduceat(angle[: cuts[-1]], cuts[:-1])[1:-1] / np.diff(cuts)[1:-1]
    rate, told = trend((starts[1:-2] + starts[2:-1]) / 2, means)
    if not (told and abs(rate) * np.ptp(time) > RESOLVED_ZERO):
        return starts
    return _cycle_starts(time, angle - rate * (time - time.mean()), frequency)


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
    cuts = zip(np.searchsorted(time, starts[:-1]), np.searchsorted(time, starts[1:], "right"))
    span = np.array([np.ptp(angle[i:j]) for i, j in cuts])
    steered, full = (np.flatnonzero(span > fraction * np.median(span)) for fraction in (SPREAD, 1 - SPREAD))
    first, last = max(steered[0] + 1, full[0]), min(steered[-1] - 1, full[-1])
    return starts[first - 1 : last + 3]
