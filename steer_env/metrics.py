"""Steering-feel metrics of a weave and of a slow ramp, each with its 95 % interval over the cycles.

The definitions are after ISO 13674-1. A recording is low-passed with zero phase on every channel alike,
cut into cycles at the handwheel angle's own crossings, and each cycle is read at 1000 instants. The first
and the last cycle are left out, and so is at either end whatever is short of full amplitude.

The loop y(x) of a cycle has a rising and a falling branch, split at the turning points of x.
* A value at a level of x is interpolated where each branch crosses that level.
* A slope is that of a parabola through the samples of a branch within a fixed window around the level,
  +-0.05 g or +-4 deg whatever the amplitude of the weave, and the mean of both branches.
* Away from zero, both +level and -level count, the latter mirrored: an offset of a sensor drops out.

A metric is a function from :class:`Loops` to one value a cycle, in SI; its docstring is its definition.
The usual ranges are for passenger cars at 100 km/h, 0.2 Hz and 2 m/s2: assumed, engineering judgement.
"""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy import stats
from scipy.interpolate import CubicSpline

from steer_env.recording import DEGREE, Recording
from vehicle.single_track import GRAVITY as G

ANGLE, TORQUE, AY = "handwheel_angle", "handwheel_torque", "lateral_acceleration"
YAW, SPEED = "yaw_rate", "vehicle_speed"
CHANNELS = {ANGLE: "rad", TORQUE: "N m", AY: "m/s2", YAW: "rad/s", SPEED: "m/s"}

# Reporting unit -> its number for one SI unit.
UNITS = {"N m": 1.0, "J": 1.0, "1": 1.0, "1/s": 1.0, "ms": 1e3, "g": 1 / G, "N m/g": G, "deg": 1 / DEGREE}
UNITS |= {"N m/deg": DEGREE, "g/100 deg": 100 * DEGREE / G, "g/(100 N m deg)": 100 * DEGREE / G}

CUTOFF = 5.0  # low-pass [Hz]
SAMPLES = 1000  # a cycle
WINDOW = {AY: 0.05 * G, ANGLE: 4 * DEGREE}  # half width of a slope's window; assumed
FEWEST_IN_WINDOW = 8  # samples for a parabola; assumed
LINEAR = 0.35  # peak lateral acceleration up to which on-centre metrics mean anything [g]
SPREAD = 0.2  # of the amplitudes of settled cycles around their median; assumed
SPEED_SPREAD = 0.03  # of the mean speeds of the cycles around their mean
END_SLACK = 0.02  # of a period that the first and the last cycle may lack; assumed
FREQUENCY_SPREAD = 0.1  # of the frequency found around the one expected; assumed
TESTS = ("weave", "slow_ramp")


PerCycle = Callable[["Loops"], np.ndarray]  # a metric's values (n,), one a cycle, in SI


class RefusedError(ValueError):
    """A metric has no meaning for this recording; the text says why and how to get it."""


class Value(NamedTuple):
    """A metric of a recording: mean and 95 % interval over the cycles [unit]; NaN with a reason if refused."""

    value: float  # mean over the cycles [unit]
    low: float  # lower end of the interval [unit]
    high: float  # upper end [unit]
    unit: str
    reason: str = ""


@dataclass(frozen=True)
class Metric:
    """What a metric is; declared by :func:`metric` above the function that reads it."""

    name: str
    unit: str  # of the reported value, a key of UNITS
    definition: str
    source: str
    usual: tuple[float, float] | None  # range of passenger cars in a weave [unit]
    validity: tuple[float, float] | None  # peak lateral acceleration from and up to which it may be read [g]; None: any
    tests: tuple[str, ...]  # that report it
    of_cycles: PerCycle


_metrics: dict[str, Metric] = {}


def metric(
    unit: str,
    *,
    usual: tuple[float, float] | None = None,
    validity: tuple[float, float] | None = (0.0, LINEAR),
    tests: tuple[str, ...] = TESTS,
    source: str = "after ISO 13674-1",
) -> Callable[[PerCycle], PerCycle]:
    """Register a function under its name, with its docstring as definition; the rest as in :class:`Metric`."""

    def register(function: PerCycle) -> PerCycle:
        name, text = function.__name__, " ".join((inspect.getdoc(function) or "").split())
        _metrics[name] = Metric(name, unit, text, source, usual, validity, tests, function)
        return function

    return register


def available(test: str | None = None) -> tuple[str, ...]:
    """Names of the metrics of "weave" or "slow_ramp", or of all; ValueError for another test."""
    if test not in (None, *TESTS):
        raise ValueError(f"no test {test!r}; there are {', '.join(TESTS)}")
    return tuple(name for name, entry in _metrics.items() if test in (None, *entry.tests))


def definition(name: str) -> Metric:
    """Unit, definition, source, usual range and validity of a metric; ValueError if there is none of that name."""
    if name not in _metrics:
        raise ValueError(f"no metric {name!r}; there are {', '.join(_metrics)}")
    return _metrics[name]


def weave(recording: Recording, frequency: float = 0.2) -> dict[str, Value]:
    """Metrics of a weave: a sine of the handwheel at constant speed and amplitude, at least three whole cycles kept.

    Parameters
    ----------
    recording : Recording
        Channels as in ``CHANNELS``, in SI, left positive; a missing one costs the metrics that need it.
    frequency : float
        Frequency of the handwheel angle [Hz]; the one found may be 10 % off.

    Returns
    -------
    dict of str to Value
        One entry for every name of ``available("weave")``; what is refused says so in its reason.

    Source: after ISO 13674-1. Deviations: slopes by parabolas in fixed windows, intervals over cycles.
    """
    return _evaluate("weave", recording, frequency, fewest=3)


def slow_ramp(recording: Recording, frequency: float = 0.02) -> dict[str, Value]:
    """As :func:`weave` for a slow sine or triangle; two whole cycles do, with a wide interval.

    The vehicle's lag is next to nothing here, so the loops widen with friction; at 0.2 Hz they need not.
    """
    return _evaluate("slow_ramp", recording, frequency, fewest=2)


def _evaluate(test: str, recording: Recording, frequency: float, fewest: int) -> dict[str, Value]:
    """Every metric of the test; what keeps the loops from being read is the reason given for all."""
    try:
        loops = Loops(recording, frequency, fewest)
    except ValueError as error:
        return {name: Value(np.nan, np.nan, np.nan, _metrics[name].unit, str(error)) for name in available(test)}
    return {name: _value(_metrics[name], loops) for name in available(test)}


def _value(entry: Metric, loops: "Loops") -> Value:
    """Mean over the cycles and its 95 % Student interval, or the reason for none."""
    try:
        low, high = entry.validity or (0.0, np.inf)
        peak = float(loops.peak(AY).mean()) / G if entry.validity else 0.0
        if not low <= peak <= high:
            advice = f"below {low:g} g: steer further" if peak < low else f"above {high:g} g: steer less far"
            raise RefusedError(f"{AY} peaks at {peak:.3f} g, {advice}")
        values = entry.of_cycles(loops) * UNITS[entry.unit]
    except RefusedError as refused:
        return Value(np.nan, np.nan, np.nan, entry.unit, str(refused))
    mean = float(values.mean())
    half = float(stats.t.ppf(0.975, values.size - 1) * stats.sem(values))
    return Value(mean, mean - half, mean + half, entry.unit)


class Loops:
    """The settled cycles of a weave, with the readings that the metrics are made of.

    Raises ValueError if the recording cannot be filtered, or if fewer than ``fewest`` alike cycles of about
    ``frequency`` [Hz] remain after the first and the last are dropped; the text says what to do.
    """

    def __init__(self, recording: Recording, frequency: float, fewest: int) -> None:
        units = {name: unit for name, unit in recording.units.items() if name in CHANNELS}
        for name, unit in units.items():
            if unit != CHANNELS[name]:
                raise RefusedError(f"{name} is in {unit!r}: give it in {CHANNELS[name]!r}")
        smooth = Recording(recording.time, {name: recording[name] for name in units}, units).filtered(CUTOFF)
        starts = _cycle_starts(smooth.time, smooth[ANGLE], frequency)
        self.count = max(len(starts) - 3, 0)
        if self.count < fewest:
            raise RefusedError(f"{self.count} settled cycles between first and last: steer {fewest + 2} or more")
        self.period = np.diff(starts)[1:-1]  # [s]
        # The dropped cycles stay as margins: a branch may begin up to half a cycle before its cycle.
        time = np.interp(np.arange((self.count + 2) * SAMPLES) / SAMPLES, np.arange(self.count + 3), starts)
        self._samples = {name: CubicSpline(smooth.time, smooth[name])(time) for name in units}
        self._harmonics = {name: np.fft.rfft(self.cycles(name))[:, 1] * (2 / SAMPLES) for name in units}
        span = np.ptp(self.cycles(AY if AY in units else ANGLE), axis=1)
        if np.any(np.abs(span - np.median(span)) > SPREAD * np.median(span)):
            raise RefusedError(f"the cycles' amplitudes are over {SPREAD:.0%} apart: hold angle and speed")
        if SPEED in units:
            speed = self.cycles(SPEED).mean(axis=1)
            if np.any(np.abs(speed - speed.mean()) > SPEED_SPREAD * np.abs(speed.mean())):
                raise RefusedError(f"{SPEED} differs between cycles by over {SPEED_SPREAD:.0%}: hold it constant")

    def cycles(self, name: str, shift: int = 0) -> np.ndarray:
        """Samples (n, SAMPLES) of a channel, from ``shift`` samples after the handwheel angle's rising crossing."""
        start = SAMPLES + shift
        return self._samples[name][start : start + self.count * SAMPLES].reshape(self.count, SAMPLES)

    def fundamental(self, name: str) -> np.ndarray:
        """Complex amplitude (n,) of the first harmonic; refused if it runs against that of the handwheel angle."""
        if name not in self._harmonics:
            raise RefusedError(f"the recording has no channel {name!r}: record it")
        if np.mean(self._harmonics[name] * self._harmonics[ANGLE].conj()).real <= 0:
            raise RefusedError(f"{name} does not follow {ANGLE}: check the signs, a left turn is positive in both")
        return self._harmonics[name]

    def _of_branches(self, y: str, x: str, read: Callable[[np.ndarray, np.ndarray], float]) -> np.ndarray:
        """read(y, x) of the samples on the falling and on the rising branch of x in each cycle, (n, 2)."""
        self.fundamental(y)
        peak = round(-np.angle(self.fundamental(x).mean()) / (2 * np.pi) * SAMPLES)
        branches = (self.cycles(name, peak).reshape(-1, SAMPLES // 2) for name in (y, x))
        return np.array([read(u, v) for u, v in zip(*branches)]).reshape(-1, 2)

    def at(self, y: str, x: str, level: float) -> np.ndarray:
        """y, (n, 2), where the falling and the rising branch of x cross ``level``; the mean of crossings in noise."""

        def read(u: np.ndarray, v: np.ndarray) -> float:
            k = np.flatnonzero((v[1:] >= level) != (v[:-1] >= level))
            if k.size % 2 == 0:
                raise RefusedError(f"{x} does not cross {level:.3g} {CHANNELS[x]} on each branch: centre the weave")
            return np.mean(u[k] + (level - v[k]) / (v[k + 1] - v[k]) * (u[k + 1] - u[k]))

        return self._of_branches(y, x, read)

    def width(self, y: str, x: str) -> np.ndarray:
        """Width (n,) of the loop y(x) at x = 0: y on the rising minus y on the falling branch."""
        return np.diff(self.at(y, x, 0.0))[:, 0]

    def mean_branch(self, y: str, x: str, level: float) -> np.ndarray:
        """y (n,) on the mean of the branches at x = level."""
        return (self.at(y, x, level) - self.at(y, x, -level)).mean(axis=1) / 2

    def slope(self, y: str, x: str, level: float = 0.0) -> np.ndarray:
        """dy/dx (n,) on the mean of the branches at x = level, in the window of x."""
        window = WINDOW[x]

        def read(u: np.ndarray, v: np.ndarray, centre: float) -> float:
            part = (v - centre) / window
            near = np.abs(part) <= 1
            if part.max() < 1 or part.min() > -1 or near.sum() < FEWEST_IN_WINDOW:
                raise RefusedError(f"{x} does not span {centre:.3g} +- {window:.3g} {CHANNELS[x]}: steer further")
            return np.polynomial.polynomial.polyfit(part[near], u[near], 2)[1] / window

        return np.mean([self._of_branches(y, x, partial(read, centre=c)) for c in (level, -level)], axis=(0, 2))

    def peak(self, name: str) -> np.ndarray:
        """Half of highest minus lowest (n,), read at the extremes of the mean cycle, where noise has averaged out."""
        self.fundamental(name)
        cycles = self.cycles(name)
        mean = cycles.mean(axis=0)
        return (cycles[:, mean.argmax()] - cycles[:, mean.argmin()]) / 2

    def lag(self, name: str) -> np.ndarray:
        """Delay (n,) of a channel's first harmonic behind that of the handwheel angle [s]."""
        return np.angle(self.fundamental(ANGLE) * self.fundamental(name).conj()) / (2 * np.pi) * self.period


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
        raise RefusedError(f"{ANGLE} is at {1 / period:.4g} Hz, not {frequency:g} Hz: pass frequency={1 / period:.4g}")
    ends = np.array([starts[0] - period, starts[-1] + period])  # of cycles that begin or end the recording
    inside = np.clip(ends, time[0], time[-1])
    starts = np.sort(np.append(starts, inside[np.abs(ends - inside) < END_SLACK * period]))
    span = np.array([np.ptp(angle[(time >= a) & (time <= b)]) for a, b in pairwise(starts)])
    steered, full = (np.flatnonzero(span > part * np.median(span)) for part in (SPREAD, 1 - SPREAD))
    first, last = max(steered[0] + 1, full[0]), min(steered[-1] - 1, full[-1])
    return starts[first - 1 : last + 3]


@metric("N m", usual=(0.6, 2.0))
def torque_at_0g(loops: Loops) -> np.ndarray:
    """Half the height of the loop torque over lateral acceleration at 0 g; positive where the torque leads."""
    return loops.width(TORQUE, AY) / 2


@metric("N m", usual=(1.5, 3.5), validity=(0.1, LINEAR))
def torque_at_0p1g(loops: Loops) -> np.ndarray:
    """Torque at 0.1 g on the mean branch of torque over lateral acceleration."""
    return loops.mean_branch(TORQUE, AY, 0.1 * G)


@metric("N m/g", usual=(12.0, 30.0), validity=(0.05, LINEAR))
def torque_gradient_at_0g(loops: Loops) -> np.ndarray:
    """Slope of torque over lateral acceleration at 0 g, within +-0.05 g, mean of both branches."""
    return loops.slope(TORQUE, AY)


@metric("N m/g", usual=(5.0, 16.0), validity=(0.15, LINEAR))
def torque_gradient_at_0p1g(loops: Loops) -> np.ndarray:
    """Slope of torque over lateral acceleration at 0.1 g, within +-0.05 g, mean of both branches."""
    return loops.slope(TORQUE, AY, 0.1 * G)


@metric("1", usual=(0.3, 0.8), validity=(0.15, LINEAR))
def torque_gradient_ratio(loops: Loops) -> np.ndarray:
    """Torque gradient at 0.1 g over that at 0 g."""
    return torque_gradient_at_0p1g(loops) / torque_gradient_at_0g(loops)


@metric("g", usual=(0.02, 0.09))
def lateral_acceleration_at_0nm(loops: Loops) -> np.ndarray:
    """Returnability: half the width of the loop torque over lateral acceleration at 0 N m."""
    return -loops.width(AY, TORQUE) / 2


@metric("deg", usual=(2.0, 10.0))
def angle_hysteresis(loops: Loops) -> np.ndarray:
    """Width in handwheel angle of the loop handwheel angle over lateral acceleration at 0 g."""
    return loops.width(ANGLE, AY)


@metric("deg", usual=(3.0, 12.0))
def angle_deadband(loops: Loops) -> np.ndarray:
    """Width in handwheel angle of the loop torque over handwheel angle at 0 N m."""
    return -loops.width(ANGLE, TORQUE)


@metric("N m", usual=(1.0, 3.5))
def torque_deadband(loops: Loops) -> np.ndarray:
    """Height in torque of the loop torque over handwheel angle at 0 deg."""
    return loops.width(TORQUE, ANGLE)


@metric("N m/deg", usual=(0.10, 0.40))
def steering_stiffness(loops: Loops) -> np.ndarray:
    """Slope of torque over handwheel angle at 0 deg, within +-4 deg, mean of both branches."""
    return loops.slope(TORQUE, ANGLE)


@metric("g/100 deg", usual=(0.8, 1.6), validity=(0.15, LINEAR))
def steering_sensitivity_at_0p1g(loops: Loops) -> np.ndarray:
    """Lateral acceleration by handwheel angle at 0.1 g: inverse slope of the mean branch of angle over acceleration."""
    return 1 / loops.slope(ANGLE, AY, 0.1 * G)


@metric("g/100 deg", usual=(0.6, 1.3), validity=(0.15, LINEAR))
def minimum_steering_sensitivity(loops: Loops) -> np.ndarray:
    """Steering sensitivity at whichever of 0, 0.05 and 0.1 g it is lowest in the mean of the cycles."""
    sensitivity = np.array([1 / loops.slope(ANGLE, AY, level * G) for level in (0.0, 0.05, 0.1)])
    return sensitivity[sensitivity.mean(axis=1).argmin()]


@metric("1/s", usual=(0.20, 0.40))
def yaw_rate_gain(loops: Loops) -> np.ndarray:
    """Slope of yaw rate over handwheel angle at 0 deg, within +-4 deg, mean of both branches."""
    return loops.slope(YAW, ANGLE)


@metric("ms", usual=(50.0, 120.0), tests=("weave",))
def yaw_lag(loops: Loops) -> np.ndarray:
    """Delay of the yaw rate behind the handwheel angle, from their first harmonics."""
    return loops.lag(YAW)


@metric("ms", usual=(80.0, 200.0), tests=("weave",))
def lateral_acceleration_lag(loops: Loops) -> np.ndarray:
    """Delay of the lateral acceleration behind the handwheel angle, from their first harmonics."""
    return loops.lag(AY)


@metric("g/(100 N m deg)", validity=(0.15, LINEAR))
def work_sensitivity(loops: Loops) -> np.ndarray:
    """Inverse of dW/day at 0.1 g with dW the torque times the change of handwheel angle, both on the mean branch."""
    return steering_sensitivity_at_0p1g(loops) / torque_at_0p1g(loops)


@metric("N m", validity=None, tests=("weave",), source="common use")
def peak_handwheel_torque(loops: Loops) -> np.ndarray:
    """Half the difference of the torques where the mean of the cycles is highest and lowest."""
    return loops.peak(TORQUE)


@metric("deg", validity=None, tests=("weave",), source="common use")
def peak_handwheel_angle(loops: Loops) -> np.ndarray:
    """Half the difference of the handwheel angles where the mean of the cycles is highest and lowest."""
    return loops.peak(ANGLE)


@metric("J", validity=None, source="energy balance")
def loop_area(loops: Loops) -> np.ndarray:
    """Area of the loop torque over handwheel angle: work of the hands that a cycle does not give back."""
    loops.fundamental(TORQUE)
    torque, angle = loops.cycles(TORQUE), loops.cycles(ANGLE)
    return np.sum(torque * (np.roll(angle, -1, axis=1) - np.roll(angle, 1, axis=1)), axis=1) / 2
