"""On-centre metrics: loops between handwheel angle, torque and lateral acceleration, in a weave and in a slow ramp.

The definitions are after ISO 13674-1. A recording is low-passed, cut into cycles at the handwheel angle's own
crossings, and each cycle is read at 1000 instants. The first and the last cycle are left out, and so is at either end
whatever is short of full amplitude.

The loop y(x) of a cycle has a rising and a falling branch, split at the turning points of x.
* A value at a level of x is interpolated where each branch crosses that level.
* A slope is that of a parabola through the samples of a branch within a fixed window around the level,
  +-0.05 g or +-4 deg whatever the amplitude of the weave, and the mean of both branches.
* Away from zero, both +level and -level count, the latter mirrored: an offset of a sensor drops out.

The usual ranges are for passenger cars at 100 km/h, 0.2 Hz and 2 m/s2: assumed, engineering judgement.
"""

from collections.abc import Callable, Mapping
from functools import cache, partial
from itertools import pairwise
from typing import Any

import numpy as np
from scipy import stats
from scipy.interpolate import CubicSpline

from steer_env.metrics.common.definitions import SPEED_SPREAD, RefusedError, metric, procedure
from steer_env.metrics.common.reading import ANGLE, AY, CHANNELS, SPEED, TORQUE, YAW, Reading
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle.constants import GRAVITY as G

CUTOFF = 5.0  # low-pass [Hz]
PEAK_CUTOFF = (
    10.0  # of what peaks are read from: at 5 Hz, the corner that dry friction leaves in the torque shifts [Hz]
)
SAMPLES_PER_CUTOFF = 40.0  # of the splines through the low-passed channels; more only take time
SAMPLES = 1000  # a cycle
WINDOW = {AY: 0.05 * G, ANGLE: 4 * DEGREE}  # half width of a slope's window; assumed
FEWEST_IN_WINDOW = 8  # samples for a parabola; assumed
LINEAR = 0.35  # peak lateral acceleration up to which on-centre metrics mean anything [g]
SPREAD = 0.2  # of the amplitudes of settled cycles around their median; assumed
END_SLACK = 0.02  # of a period that the first and the last cycle may lack; assumed
FREQUENCY_SPREAD = 0.1  # of the frequency found around the one expected; assumed


class Loops:
    """The settled cycles of a weave, with the readings that the metrics are made of.

    Raises ValueError if the recording cannot be filtered, or if fewer than ``fewest`` alike cycles of about
    ``frequency_hz`` remain after the first and the last are dropped; the text says what to do.
    """

    def __init__(self, recording: Recording, asked: Mapping[str, Any], fewest: int) -> None:
        self._smooth = Reading(recording, CUTOFF)
        starts = _cycle_starts(self._smooth.time, self._smooth[ANGLE], asked["frequency_hz"])
        self.count = max(len(starts) - 3, 0)
        if self.count < fewest:
            raise RefusedError(f"{self.count} settled cycles between first and last: steer {fewest + 2} or more")
        self.period = np.diff(starts)[1:-1]  # [s]
        # The dropped cycles stay as margins: a branch may begin up to half a cycle before its cycle.
        time = np.interp(np.arange((self.count + 2) * SAMPLES) / SAMPLES, np.arange(self.count + 3), starts)
        sharp = Reading(recording, min(PEAK_CUTOFF, recording.rate / 4))
        self._raw, self._sharp = (cache(partial(_interpolated, of, time)) for of in (self._smooth, sharp))
        self._samples = cache(lambda name: self._without_drift(self._raw(name)))
        # Several metrics ask for the same.
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
        """Samples less the straight line that the means of the cycles move along: it would open every loop."""
        means, order = self._settled(samples).mean(axis=1), np.arange(self.count) - (self.count - 1) / 2
        rise = order @ means / max(order @ order, 1.0)  # one cycle shows none
        return samples - rise * (np.arange(samples.size) - samples.size / 2) / SAMPLES

    def _fundamental(self, name: str) -> np.ndarray:
        """Complex amplitude (n,) of the first harmonic; refused if it runs against that of the handwheel angle."""
        angle, harmonic = self._harmonic(ANGLE), self._harmonic(name)
        if np.mean(harmonic * angle.conj()).real <= 0:
            raise RefusedError(f"{name} does not follow {ANGLE}: check the signs, a left turn is positive in both")
        return harmonic

    def _harmonic(self, name: str) -> np.ndarray:
        return np.fft.rfft(self.cycles(name))[:, 1] * (2 / SAMPLES)

    def peak_acceleration(self) -> float:
        """Peak of the lateral acceleration, in the mean of the cycles [g]."""
        return float(self.peak(AY).mean()) / G

    def _branches(self, y: str, x: str) -> tuple[np.ndarray, np.ndarray]:
        """Samples of y and x, each (2 n, SAMPLES/2), on the falling and the rising branch of x in each cycle."""
        self.fundamental(y)
        peak = round(-np.angle(self.fundamental(x).mean()) / (2 * np.pi) * SAMPLES)
        u, v = (self.cycles(name, peak).reshape(-1, SAMPLES // 2) for name in (y, x))
        return u, v

    def _at(self, y: str, x: str, level: float) -> np.ndarray:
        """y, (n, 2), where the falling and the rising branch of x cross ``level``; the mean of crossings in noise."""
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
        """dy/dx (n,) on the mean of the branches at x = level, in the window of x."""
        window = WINDOW[x]
        u, v = self._branches(y, x)
        slopes = []
        for centre in (level, -level):
            part = (v - centre) / window
            near = np.abs(part) <= 1
            if part.max(axis=1).min() < 1 or part.min(axis=1).max() > -1 or near.sum(axis=1).min() < FEWEST_IN_WINDOW:
                raise RefusedError(f"{x} does not span {centre:.3g} +- {window:.3g} {CHANNELS[x]}: steer further")
            powers = np.stack([near, near * part, near * part**2])  # the normal equations; all within one
            moments = np.einsum("ibt,jbt->bij", powers, powers)
            slopes.append(np.linalg.solve(moments, np.einsum("ibt,bt->bi", powers, u)[..., None])[:, 1, 0] / window)
        return np.mean(np.reshape(slopes, (2, -1, 2)), axis=(0, 2))

    def _peak(self, name: str) -> np.ndarray:
        """Half the difference (n,) of samples half a cycle apart, where it is largest in the mean of the cycles.

        Two extremes looked for apart would read more of the noise for signal.
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


def _interpolated(smooth: Reading, time: np.ndarray, name: str) -> np.ndarray:
    thin = slice(None, None, max(int(smooth.recording.rate / (SAMPLES_PER_CUTOFF * CUTOFF)), 1))
    return CubicSpline(smooth.time[thin], smooth[name][thin])(time)


def _cycle_starts(time: np.ndarray, angle: np.ndarray, frequency: float) -> np.ndarray:
    """Rising crossings [s] that bound the cycles of full amplitude and, as margins, one more at each end."""
    s = angle - (angle.max() + angle.min()) / 2
    far = np.flatnonzero(np.abs(s) > s.max() / 4)  # a crossing counts once it has left the noise
    up = np.flatnonzero((s[far[:-1]] < 0) & (s[far[1:]] > 0))
    i, j = far[up], far[up + 1]
    starts = time[i] - s[i] * (time[j] - time[i]) / (s[j] - s[i])
    if starts.size < 2:
        raise RefusedError(f"no whole cycle of {ANGLE} found: cut off what is not the weave with between(t0, t1)")
    period = np.median(np.diff(starts))
    if not abs(period * frequency - 1) <= FREQUENCY_SPREAD:
        found = 1 / period
        raise RefusedError(f"{ANGLE} is at {found:.4g} Hz, not {frequency:g} Hz: say frequency_hz={found:.4g} if right")
    ends = np.array([starts[0] - period, starts[-1] + period])  # of cycles that begin or end the recording
    inside = np.clip(ends, time[0], time[-1])
    starts = np.sort(np.append(starts, inside[np.abs(ends - inside) < END_SLACK * period]))
    span = np.array([np.ptp(angle[(time >= a) & (time <= b)]) for a, b in pairwise(starts)])
    steered, full = (np.flatnonzero(span > part * np.median(span)) for part in (SPREAD, 1 - SPREAD))
    first, last = max(steered[0] + 1, full[0]), min(steered[-1] - 1, full[-1])
    return starts[first - 1 : last + 3]


LOOPS = ((ANGLE, TORQUE), (AY, TORQUE), (ANGLE, AY))
procedure("weave", partial(Loops, fewest=3), plots=LOOPS, speed_m_s=100 / 3.6, frequency_hz=0.2)
# Two cycles do, with a wide interval. The vehicle's lag is next to nothing: the loops widen with friction; at 0.2 Hz
# they need not.
procedure("slow-ramp", partial(Loops, fewest=2), plots=LOOPS, speed_m_s=50 / 3.6, frequency_hz=0.02)
# The car stands on a rig: what is read over its motion has no meaning.
procedure("rig", partial(Loops, fewest=3), plots=LOOPS[:1], constant_speed=False, frequency_hz=0.2)


def _loop_metric(
    unit: str,
    usual: tuple[float, float] | None = None,
    validity: tuple[float, float] | None = (0.0, LINEAR),
    tests: tuple[str, ...] = ("weave", "slow-ramp"),
    source: str = "after ISO 13674-1",
) -> Callable[[Callable[["Loops"], np.ndarray]], Callable[["Loops"], np.ndarray]]:
    return metric(unit, *tests, usual=usual, validity=validity, source=source)


@_loop_metric("N m", usual=(0.6, 2.0))
def torque_at_0g(loops: Loops) -> np.ndarray:
    """Half the height of the loop torque over lateral acceleration at 0 g; positive where the torque leads."""
    return loops.width(TORQUE, AY) / 2


@_loop_metric("N m", usual=(1.5, 3.5), validity=(0.1, LINEAR))
def torque_at_0p1g(loops: Loops) -> np.ndarray:
    """Torque at 0.1 g on the mean branch of torque over lateral acceleration."""
    return loops.mean_branch(TORQUE, AY, 0.1 * G)


@_loop_metric("N m/g", usual=(12.0, 30.0), validity=(0.05, LINEAR))
def torque_gradient_at_0g(loops: Loops) -> np.ndarray:
    """Slope of torque over lateral acceleration at 0 g, within +-0.05 g, mean of both branches."""
    return loops.slope(TORQUE, AY)


@_loop_metric("N m/g", usual=(5.0, 16.0), validity=(0.15, LINEAR))
def torque_gradient_at_0p1g(loops: Loops) -> np.ndarray:
    """Slope of torque over lateral acceleration at 0.1 g, within +-0.05 g, mean of both branches."""
    return loops.slope(TORQUE, AY, 0.1 * G)


@_loop_metric("1", usual=(0.3, 0.8), validity=(0.15, LINEAR))
def torque_gradient_ratio(loops: Loops) -> np.ndarray:
    """Torque gradient at 0.1 g over that at 0 g."""
    return torque_gradient_at_0p1g(loops) / torque_gradient_at_0g(loops)


@_loop_metric("g", usual=(0.02, 0.09))
def lateral_acceleration_at_0nm(loops: Loops) -> np.ndarray:
    """Returnability: half the width of the loop torque over lateral acceleration at 0 N m."""
    return -loops.width(AY, TORQUE) / 2


@_loop_metric("deg", usual=(2.0, 10.0))
def angle_hysteresis(loops: Loops) -> np.ndarray:
    """Width in handwheel angle of the loop handwheel angle over lateral acceleration at 0 g."""
    return loops.width(ANGLE, AY)


@_loop_metric("deg", usual=(3.0, 12.0))
def angle_deadband(loops: Loops) -> np.ndarray:
    """Width in handwheel angle of the loop torque over handwheel angle at 0 N m."""
    return -loops.width(ANGLE, TORQUE)


@_loop_metric("N m", usual=(1.0, 3.5))
def torque_deadband(loops: Loops) -> np.ndarray:
    """Height in torque of the loop torque over handwheel angle at 0 deg."""
    return loops.width(TORQUE, ANGLE)


@_loop_metric("N m/deg", usual=(0.10, 0.40))
def steering_stiffness(loops: Loops) -> np.ndarray:
    """Slope of torque over handwheel angle at 0 deg, within +-4 deg, mean of both branches."""
    return loops.slope(TORQUE, ANGLE)


@_loop_metric("g/100 deg", usual=(0.8, 1.6), validity=(0.15, LINEAR))
def steering_sensitivity_at_0p1g(loops: Loops) -> np.ndarray:
    """Lateral acceleration by handwheel angle at 0.1 g: inverse slope of the mean branch of angle over acceleration."""
    return 1 / loops.slope(ANGLE, AY, 0.1 * G)


@_loop_metric("g/100 deg", usual=(0.6, 1.3), validity=(0.15, LINEAR))
def minimum_steering_sensitivity(loops: Loops) -> np.ndarray:
    """Lowest steering sensitivity at 0, 0.05 and 0.1 g; at 0 g unless another level is two standard errors lower."""
    sensitivity = np.array([1 / loops.slope(ANGLE, AY, level * G) for level in (0.0, 0.05, 0.1)])
    # Where the levels are alike the lowest would be the noisiest, and biased.
    lower = sensitivity - sensitivity[0]
    clearly = lower.mean(axis=1) < -2 * stats.sem(lower, axis=1)
    return sensitivity[np.where(clearly, sensitivity.mean(axis=1), np.inf).argmin()]


@_loop_metric("1/s", usual=(0.20, 0.40))
def yaw_rate_gain(loops: Loops) -> np.ndarray:
    """Slope of yaw rate over handwheel angle at 0 deg, within +-4 deg, mean of both branches."""
    return loops.slope(YAW, ANGLE)


@_loop_metric("ms", usual=(50.0, 120.0), tests=("weave",))
def yaw_lag(loops: Loops) -> np.ndarray:
    """Delay of the yaw rate behind the handwheel angle, from their first harmonics."""
    return loops.lag(YAW)


@_loop_metric("ms", usual=(80.0, 200.0), tests=("weave",))
def lateral_acceleration_lag(loops: Loops) -> np.ndarray:
    """Delay of the lateral acceleration behind the handwheel angle, from their first harmonics."""
    return loops.lag(AY)


@_loop_metric("g/(100 N m deg)", validity=(0.15, LINEAR))
def work_sensitivity(loops: Loops) -> np.ndarray:
    """Inverse of dW/day at 0.1 g with dW the torque times the change of handwheel angle, both on the mean branch."""
    return steering_sensitivity_at_0p1g(loops) / torque_at_0p1g(loops)


@_loop_metric("N m", validity=None, tests=("weave", "rig"), source="common use")
def peak_handwheel_torque(loops: Loops) -> np.ndarray:
    """Half the difference of the torques half a cycle apart, where it is largest in the mean of the cycles."""
    return loops.peak(TORQUE)


@_loop_metric("deg", validity=None, tests=("weave", "rig"), source="common use")
def peak_handwheel_angle(loops: Loops) -> np.ndarray:
    """Half the difference of the handwheel angles half a cycle apart, where it is largest in the mean of the cycles."""
    return loops.peak(ANGLE)


@_loop_metric("J", validity=None, tests=("weave", "slow-ramp", "rig"), source="energy balance")
def loop_area(loops: Loops) -> np.ndarray:
    """Area of the loop torque over handwheel angle: work of the hands that a cycle does not give back."""
    loops.fundamental(TORQUE)
    torque, angle = loops.cycles(TORQUE), loops.cycles(ANGLE)
    return np.sum(torque * (np.roll(angle, -1, axis=1) - np.roll(angle, 1, axis=1)), axis=1) / 2
