"""The nearest explanation of a simulation that does not agree with a measurement.

Named parameters of the car, and the delay of the hand torque's channel, are fitted, fewest first, so that the
simulation, driven again with the handwheel angle and the speed of the measurement, leaves no more than the
measurement's noise. What is fitted are the curves of the cross plots: of a periodic test the harmonics of its cycle,
whose noise is the scatter of the cycles; of a test that begins straight ahead its values over time, whose noise is that
of its samples. Every step of the fits (Gauss-Newton, weighted by that noise) drives the simulation itself.
"""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, optimize, stats

from steer_env import manoeuvres, metrics
from steer_env.experiments.pages import provenance
from steer_env.experiments.pages.words import in_words, label, law_name, number, percent
from steer_env.experiments.studies.common import comparison_power, simulation_vs_measurement
from steer_env.experiments.studies.common.comparison_power import CHANGES, STEERED
from steer_env.experiments.studies.common.simulation_vs_measurement import RATE, Pair, Tolerance
from steer_env.friction.sites import friction_name
from steer_env.manoeuvres import Manoeuvre
from steer_env.metrics import ManoeuvreEvaluation, RefusedError
from steer_env.metrics.common import straight
from steer_env.metrics.common.confidence import CONFIDENCE_LEVEL, interval
from steer_env.metrics.common.filtered_channels import ANGLE, AY, SPEED, TORQUE, YAW
from steer_env.recording.recording import Recording
from steer_env.vehicle import cars
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]

WORKERS = 4  # threads; the kernels run without Python's lock
CYCLES = 5  # of a periodic test that is driven again, of which three are read
HIGHEST = 3.0  # harmonics of a cycle up to here are compared [Hz]
TIME_STEP = 0.1  # of values over time; the low-pass of the curves remembers less [s]
ALIKE = 0.01  # rest of the handwheel angle over its size, up to which both were steered alike; assumed [1]
FLOOR = 0.003  # share of a tolerance that counts as noise too: rates and filters of two files differ, assumed [1]
LEAST_P = 0.001  # probability of as large a chi-square by chance, from which on a fit explains the difference; assumed
EQUAL = 9.0  # chi-square above the best, up to which a fit explains equally well: three deviations; assumed [1]
ROUNDS = 10  # of Gauss-Newton steps, at most
SETTLED = 0.1  # change of chi-square with which they end
KEPT_SEARCHES = (16, 8)  # searches that go on after the first step, and after the second
FAR_CHI_SQUARE_RATIO = 30.0  # times the least chi-square, with which they do not; assumed [1]
LAWS = 3  # other laws, those that leave least, with which one parameter is fitted too
DIFFERENCE = 0.1  # step of the finite differences, in usual amounts [1]
PRIOR = 5.0  # deviation of a parameter before anything is measured, in usual amounts; assumed [1]
# Change of chi-square by a usual amount, below which a parameter cannot be seen: three deviations [1]
FELT_CHI_SQUARE = 9.0
INTERVAL_DEVIATIONS = float(stats.norm.ppf(0.5 + 0.5 * CONFIDENCE_LEVEL))  # half an interval, in deviations [1]
MEDIAN = float(stats.norm.ppf(0.75))  # of the sizes of normal numbers, in deviations [1]
SHORTER = (1.0, 0.5, 0.25, 0.1)  # parts of a step that are tried


class Setting(NamedTuple):
    """What a simulation is driven and recorded with."""

    car: Car
    law: Any  # parameters
    late: float = 0.0  # of the hand torque's channel [s]


class Parameter(NamedTuple):
    """A named parameter, in which simulation and measurement may differ."""

    name: str
    usual: float  # amount by which cars of a kind differ, or channels are late; assumed [of its coordinate]
    change: Callable[[Setting, float], Setting]  # of a setting, by a coordinate
    factor: bool = True  # its coordinate is the logarithm of a factor [1]; else that of a delay [s]

    def value(self, x: float) -> float:
        """The factor [1] or the delay [s] at a coordinate."""
        return math.exp(x) if self.factor else x


def _multiplied(change: comparison_power.Change, at: Setting, x: float) -> Setting:
    car, law = change(at.car, at.law, math.exp(x))
    return at._replace(car=car, law=law)


def _assist_late(at: Setting, x: float) -> Setting:
    return at._replace(car=cars.load(at.car, changes={"assist.delay": at.car.data()["assist"]["delay"] + x}))


def _late(at: Setting, x: float) -> Setting:
    return at._replace(late=at.late + x)


LATE = "delay of the hand torque"


def _ratio(car: Car, law: Any, factor: float) -> tuple[Car, Any]:
    return comparison_power.key_times("steering.pinion_radius", car, law, 1.0 / factor)


NAMED: Mapping[str, comparison_power.Change] = {
    **CHANGES,
    "steering ratio": _ratio,
    "inertia of the handwheel (I1)": partial(comparison_power.key_times, "column.I1"),
}
ASSIST_LATE = "delay of the assist"
USUAL = {"friction": 0.3, "boost": 0.2, "steering ratio": 0.05}  # of a logarithm, 0.15 of the others; assumed [1]
PARAMETERS = (
    *(
        Parameter(name, USUAL.get(name, 0.15), partial(_multiplied, change))
        for name, change in NAMED.items()
        if name != ASSIST_LATE
    ),
    Parameter(ASSIST_LATE, 0.5e-3, _assist_late, factor=False),  # which the car may have none of
    Parameter(LATE, 0.01, _late, factor=False),
)
FRICTION = PARAMETERS[0]
DELAYS = (ASSIST_LATE, LATE)


class Change(NamedTuple):
    """By how much a named parameter is changed, with its 95 % interval: a factor [1] or a delay [s]."""

    name: str
    value: float
    low: float
    high: float


class Offset(NamedTuple):
    """What a sensor reads at zero, with its 95 % interval [SI]."""

    value: float
    low: float
    high: float


class Fit(NamedTuple):
    """Parameters that are changed together, and what the simulation then leaves."""

    law: str  # another friction law, with its level fitted; empty for the own one
    changes: tuple[Change, ...]
    chi_square: float  # of what is left of the curves [1]
    probability: float  # of as large a chi-square by noise alone [1]
    size: float  # of the change, in usual amounts [1]

    @property
    def names(self) -> tuple[str, ...]:
        """What is changed."""
        own = tuple(change.name for change in self.changes)
        return (f"law {self.law}", *(name for name in own if name != "friction")) if self.law else own


class Explanation(NamedTuple):
    """The nearest explanation, and what explains as well."""

    best: Fit
    explained: bool  # whether the best leaves no more than noise
    equal: tuple[Fit, ...]  # of as many parameters, that explain the difference as well
    offsets: Mapping[str, Offset]  # channel -> what is subtracted before, of the sensors that are off
    hidden: tuple[str, ...]  # named parameters whose usual amounts this measurement cannot show
    pairs: tuple[Pair, ...]  # cross plots of the best, driven again
    setting: Setting  # of the best
    recording: Recording  # of the best, with the measured input

    @property
    def inside(self) -> bool:
        """Whether the best is within the tolerances."""
        return simulation_vs_measurement.passes(list(self.pairs))


class _Curves(NamedTuple):
    values: dict[str, Array]  # channel -> (n,) [SI]
    deviations: dict[str, Array]  # of their noise, (n,) [SI]


def _harmonics(recording: Recording, names: Sequence[str], test: str, given: Mapping[str, Any]) -> _Curves:
    """Harmonics of the mean cycle, real before imaginary, over the phase of the angle's fundamental."""
    loops = metrics.read(recording, test, **given)
    orders = np.arange(1, max(round(HIGHEST * loops.period.mean()), 2) + 1)
    turn = np.fft.rfft(loops.cycles(ANGLE))[:, 1]
    back = (turn.conj() / np.abs(turn))[:, None] ** orders
    values, deviations = {}, {}
    for name in names:
        cycles = loops.cycles(name)
        each = np.fft.rfft(cycles)[:, orders] * (2.0 / cycles.shape[1]) * back
        variance = (each.real.var(axis=0, ddof=1) + each.imag.var(axis=0, ddof=1)) / (2 * len(each))
        white = np.full(orders.size, variance[1:].mean())
        white[0] = max(white[0], variance[0])  # a driver's cycles differ in size
        values[name] = np.concatenate((each.mean(axis=0).real, each.mean(axis=0).imag))
        deviations[name] = np.sqrt(np.tile(white, 2))
    return _Curves(values, deviations)


def _white(recording: Recording, name: str) -> float:
    """Standard deviation of a channel's noise: its second differences are noise, but for a few of a smooth curve."""
    return float(np.median(np.abs(np.diff(recording[name], 2)))) / (MEDIAN * math.sqrt(6.0))


def _histories(recording: Recording, names: Sequence[str], evaluation: ManoeuvreEvaluation, times: Array) -> _Curves:
    """Means over steps of time, of values at times (n,) from the beginning."""
    found, count = simulation_vs_measurement.curves(recording, evaluation), round(TIME_STEP * RATE)
    values, deviations = {}, {}
    for name in names:
        at = interpolate.CubicSpline(found["time"], found[name])(np.clip(times, 0.0, found["time"][-1]))
        values[name] = at[: at.size // count * count].reshape(-1, count).mean(axis=1)
        white = _white(recording, name) / math.sqrt(max(TIME_STEP * recording.rate, 1.0))
        deviations[name] = np.full(values[name].size, white)
    return _Curves(values, deviations)


class _Input(NamedTuple):
    """The handwheel angle of a measurement by that of the simulation."""

    size: float  # over that of the simulation [1]
    late: float  # time from the beginning of the simulation to that of the measurement, negated [s]


def _input(measured: simulation_vs_measurement.Curves, simulated: simulation_vs_measurement.Curves) -> _Input:
    """ValueError where the angle has another shape."""
    curve, begin = interpolate.CubicSpline(simulated["time"], simulated[ANGLE]), simulation_vs_measurement.lag
    end = simulated["time"][-1]

    def left(x: Array) -> Array:
        return measured[ANGLE] - x[0] * curve(np.clip(measured["time"] - x[1], 0.0, end))

    found = optimize.least_squares(left, [1.0, begin(measured, simulated)], x_scale=[0.1, 0.01])
    size, rest = float(np.abs(measured[ANGLE]).max()), float(np.sqrt(np.mean(found.fun**2)))
    if rest > ALIKE * size:
        raise ValueError(
            f"the handwheel was steered otherwise than in the simulation, by {percent(rest / size)} of its size"
        )
    return _Input(*map(float, found.x))


class Measured:
    """A measurement, and the simulation that is driven again as it was.

    Raises :class:`RefusedError` or ValueError where it cannot be: in words.
    """

    def __init__(
        self, measured: Recording, simulated: Recording, test: str, allowed: Mapping[str, Tolerance], **given: Any
    ) -> None:
        self.measured = measured
        own = comparison_power.simulation_of(simulated)
        self.own = Setting(own.car, own.law)
        self._evaluation, self._given = metrics.evaluation_of(measured, test), given
        self._loops = all("time" not in pair for pair in self._evaluation.plots)
        of_plots = {name for pair in self._evaluation.plots for name in pair} | {YAW}
        shared = of_plots & measured.channels.keys() & simulated.channels.keys() - {ANGLE, "time"}
        self._names = sorted(shared)
        if not self._names:
            raise ValueError("no channel of its cross plots but the handwheel angle is in both recordings")
        self._late = 0.0  # of the measurement behind the simulation [s]
        self._manoeuvre = self._as_measured(own.manoeuvre, measured, simulated)
        self._read = self._curves(measured)
        floor = {name: FLOOR * allowed[name].absolute for name in self._names if name in allowed}
        self._deviations = {n: np.hypot(s, floor.get(n, 0.0)) for n, s in self._read.deviations.items()}
        # A sensor's zero is subtracted before, with an error; that leaves a constant in values over time.
        self._constants = np.zeros((sum(s.size for s in self._deviations.values()), 0))
        if not self._loops:
            parts = [
                np.concatenate([(1.0 if n == name else 0.0) / s for n, s in self._deviations.items()])
                for name in self._names
            ]
            self._constants = np.linalg.qr(np.column_stack(parts))[0]

    def _curves(self, recording: Recording, late: float = 0.0) -> _Curves:
        if self._loops:
            return _harmonics(recording, self._names, self._evaluation.name, self._given)
        return _histories(recording, self._names, self._evaluation, self._times - late)

    def _as_measured(self, own: Manoeuvre, measured: Recording, simulated: Recording) -> Manoeuvre:
        """The manoeuvre with the speed of the measurement, and with the size of its handwheel angle."""
        if self._evaluation.constant_speed and own.speed and measured.units.get(SPEED) == "m/s":
            own = replace(own, speed=float(np.nanmean(measured[SPEED])))
        if not own.robot or own.released or own.driver is not None:
            raise ValueError("its handwheel angle is a result of the test, not its input")
        if self._loops:
            loops = [metrics.read(each, self._evaluation.name, **self._given) for each in (measured, simulated)]
            sizes = [float(np.abs(each.fundamental(ANGLE)).mean()) for each in loops]
            size = sizes[0] / sizes[1]
            wanted = {"frequency": 1.0 / float(loops[0].period.mean()), "cycles": CYCLES}
            chosen = {key: value for key, value in wanted.items() if key in manoeuvres.options(own.name)}
            own = replace(manoeuvres.make(own.name, **chosen), speed=own.speed, chassis=own.chassis)
        else:
            both = [simulation_vs_measurement.curves(each, self._evaluation) for each in (measured, simulated)]
            (size, self._late), self._times = _input(*both), both[0]["time"]
        return replace(own, amplitude=size * simulated.meta["amplitude_rad"], lateral_acceleration=None)

    def drive(self, at: Setting) -> Recording:
        """The simulation with the measured input."""
        driven = manoeuvres.drive(at.car, self._manoeuvre, at.law)
        driven = driven.without(*(driven.channels.keys() - {ANGLE, SPEED, *self._names}))
        if not at.late or TORQUE not in driven.channels:
            return driven
        late = np.interp(driven.time - at.late, driven.time, driven[TORQUE])
        return replace(driven, channels={**driven.channels, TORQUE: late})

    def leaves(self, at: Setting) -> Array:
        """Measured less simulated curves in deviations of the noise (n,)."""
        found = self._curves(self.drive(at), self._late).values
        gaps = []
        for name in self._names:
            n = min(found[name].size, self._read.values[name].size)
            gap = np.zeros(self._read.values[name].size)
            gap[:n] = self._read.values[name][:n] - found[name][:n]
            gaps.append(gap / self._deviations[name])
        left = np.concatenate(gaps)
        return left - self._constants @ (self._constants.T @ left)

    def offsets(self, at: Setting) -> dict[str, Offset]:
        """What the sensors read at zero, of those that are off by more than noise and by what is worth telling."""
        found = self._zeros_of_loops() if self._loops else self._zeros_over_time(at)
        least = {name: size / metrics.UNITS[unit] for name, (size, unit) in straight.NOTED_ZEROS.items()}
        return {n: o for n, o in found.items() if abs(o.value) > least[n] and not o.low <= 0.0 <= o.high}

    def _zeros_of_loops(self) -> dict[str, Offset]:
        loops, found = metrics.read(self.measured, self._evaluation.name, **self._given), {}
        for name in {ANGLE, *self._names} & straight.NOTED_ZEROS.keys() if AY in self._names else ():
            turned = name in (AY, YAW)  # the others have their zero where the car does not turn
            each = loops.cycles(name) if turned else loops.at(name, AY, 0.0)
            found[name] = Offset(loops.zero(name), *interval(loops.zero(name) + each.mean(axis=1)))
        return found

    def _zeros_over_time(self, at: Setting) -> dict[str, Offset]:
        try:
            zeros = straight.zeros(self.measured)
        except RefusedError:  # then they are in what is left
            zeros = {}
        driven, found = self._curves(self.drive(at), self._late).values, {}
        for name in self._names:
            gap = self._read.values[name] - driven[name]
            half = INTERVAL_DEVIATIONS * float(gap.std(ddof=1)) / math.sqrt(gap.size)
            value = zeros.get(name, 0.0) + float(gap.mean())
            found[name] = Offset(value, value - half, value + half)
        if ANGLE in zeros:
            white = _white(self.measured, ANGLE) / math.sqrt(straight.SHORTEST * self.measured.rate)
            found[ANGLE] = Offset(
                zeros[ANGLE], zeros[ANGLE] - INTERVAL_DEVIATIONS * white, zeros[ANGLE] + INTERVAL_DEVIATIONS * white
            )
        return found

    @property
    def freedom(self) -> int:
        """Values that are compared, less the constants that are fitted."""
        return self._constants.shape[0] - self._constants.shape[1]


class Start:
    """A setting from which parameters are fitted: what it leaves, and how each parameter changes that."""

    def __init__(self, measured: Measured, setting: Setting, law: str = "") -> None:
        self.measured, self.setting, self.law = measured, setting, law
        self.left = measured.leaves(setting)
        self._slopes = dict[str, Array]()

    def at(self, chosen: Sequence[Parameter], x: Array) -> Setting:
        """The setting with coordinates x (k,) of parameters; ValueError where a car cannot have them."""
        found = self.setting
        for each, value in zip(chosen, x):
            found = each.change(found, float(value))
        return found

    def slope(self, chosen: Sequence[Parameter], k: int, x: Array, left: Array) -> Array:
        """Change (n,) of what is left at x by the usual amount of the k-th parameter; 0 where none can be driven."""
        each = chosen[k]
        if not x.any() and each.name in self._slopes:
            return self._slopes[each.name]
        found = np.zeros(left.size)
        for step in (DIFFERENCE, -DIFFERENCE):  # a limit of the car is on one side
            other = x.copy()
            other[k] += step * each.usual
            try:
                found = (self.measured.leaves(self.at(chosen, other)) - left) / step
            except (ValueError, RefusedError):
                continue
            break
        if not x.any():
            self._slopes[each.name] = found
        return found

    def felt(self, pool: ThreadPoolExecutor) -> list[Parameter]:
        """The parameters of which a usual amount can be seen."""
        slopes = pool.map(lambda each: self.slope((each,), 0, np.zeros(1), self.left), PARAMETERS)
        return [each for each, slope in zip(PARAMETERS, slopes) if slope @ slope > FELT_CHI_SQUARE]


class Search:
    """Gauss-Newton steps of some parameters from a start."""

    def __init__(self, start: Start, chosen: tuple[Parameter, ...]) -> None:
        self.start, self.chosen = start, chosen
        self.x = np.zeros(len(chosen))
        self._left, self._slopes = start.left, np.zeros((start.left.size, 0))
        self.settled = not chosen

    @property
    def chi_square(self) -> float:
        """Of what is left."""
        return float(self._left @ self._left)

    @property
    def explains(self) -> bool:
        """Whether no more than noise is left."""
        return self.fit().probability >= LEAST_P

    @property
    def setting(self) -> Setting:
        """With what has been found so far."""
        return self.start.at(self.chosen, self.x)

    def steps(self, count: int) -> None:
        """At most so many steps; each is shortened until it leaves less, and where none does the search has settled."""
        for _ in range(count):
            if self.settled:
                return
            self._step()

    def _step(self) -> None:
        columns = [self.start.slope(self.chosen, k, self.x, self._left) for k in range(len(self.chosen))]
        self._slopes = np.column_stack(columns)
        usual = np.array([each.usual for each in self.chosen])
        prior = np.eye(len(self.chosen)) / PRIOR  # keeps what can hardly be seen from running away
        left = np.concatenate((self._left, prior @ (self.x / usual)))
        way = np.linalg.lstsq(np.vstack((self._slopes, prior)), -left, rcond=None)[0]
        for part in SHORTER:
            x = self.x + part * way * usual
            try:
                found = self.start.measured.leaves(self.start.at(self.chosen, x))
            except (ValueError, RefusedError):
                continue
            gained = float(left @ left) - float(found @ found) - float(np.sum((prior @ (x / usual)) ** 2))
            if gained > 0.0:
                self.x, self._left, self.settled = x, found, gained < SETTLED
                return
        self.settled = True

    def fit(self) -> Fit:
        """What was found, with intervals that are wider where more than noise is left."""
        freedom = max(self.start.measured.freedom - len(self.chosen), 1)
        excess = max(self.chi_square / freedom, 1.0)
        known = self._slopes.T @ self._slopes / excess + np.eye(len(self.chosen)) / PRIOR**2
        deviations = np.sqrt(np.diag(np.linalg.inv(known))) if self.chosen else ()
        changes = []
        for each, x, deviation in zip(self.chosen, self.x, deviations):
            half = INTERVAL_DEVIATIONS * deviation * each.usual
            changes.append(Change(each.name, *(each.value(float(end)) for end in (x, x - half, x + half))))
        size = sum(abs(x) / each.usual for each, x in zip(self.chosen, self.x))
        chance = float(stats.chi2.sf(self.chi_square, freedom))
        return Fit(self.start.law, tuple(changes), self.chi_square, chance, float(size))


def explain(
    measured: Recording, simulated: Recording, test: str, allowed: Mapping[str, Tolerance], **given: Any
) -> Explanation:
    """The smallest change of named parameters with which a simulation leaves no more than a measurement's noise.

    Parameters
    ----------
    measured, simulated : Recording
        The simulation's trace names its car and law.
    test : str
    allowed : mapping
        Tolerances by channel.
    given
        Conditions as for :func:`simulation_vs_measurement.compare`.

    Raises
    ------
    ValueError
        In words, where the simulation cannot be driven again with the input of the measurement.
    """
    seen = Measured(measured, simulated, test, allowed, **given)
    own = Start(seen, seen.own)
    with warnings.catch_warnings(), ThreadPoolExecutor(WORKERS) as pool:
        warnings.simplefilter("ignore", cars.UnusualCar)  # cars that are tried are nobody's
        felt = own.felt(pool)
        good, tried = _search(own, felt, pool)
    least = min((each.chi_square for each in good), default=math.inf)
    equal = sorted((each for each in good if each.chi_square <= least + EQUAL), key=lambda each: each.fit().size)
    best = equal[0] if equal else min(tried, key=lambda each: each.chi_square)
    driven = seen.drive(best.setting)
    kept = measured.without(*(measured.channels.keys() - driven.channels.keys()))
    return Explanation(
        best=best.fit(),
        explained=bool(equal),
        equal=tuple(each.fit() for each in equal[1:]),
        offsets=seen.offsets(best.setting),
        hidden=tuple(each.name for each in PARAMETERS if each not in felt),
        pairs=tuple(simulation_vs_measurement.compare(kept, driven, test, allowed, **given)),
        setting=best.setting,
        recording=driven,
    )


def driven_as(measured: Recording, at: Setting, test: str, **given: Any) -> Recording:
    """A recording of a car and its friction, driven with the speed and the handwheel angle of a measurement.

    Where the handwheel angle of the test is no input of it, the test is driven as it is prescribed.
    """
    made = manoeuvres.make(test)
    driven = manoeuvres.drive(at.car, replace(made, speed=measured.meta.get("speed_m_s", made.speed)), at.law)
    trace = provenance.trace(car=at.car, friction={friction_name(at.law): at.law})
    driven = replace(driven, meta={**driven.meta, "trace": trace})
    try:
        again = Measured(measured, driven, test, {}, **given).drive(at)
    except (ValueError, RefusedError):
        return driven
    return replace(again, meta={**again.meta, "trace": trace, STEERED: True})


def _search(own: Start, felt: Sequence[Parameter], pool: ThreadPoolExecutor) -> tuple[list[Search], list[Search]]:
    """The searches that explain the difference, with as few parameters as do, and all of the last stage.

    Another law counts as one parameter, with its level fitted.
    """
    nothing = Search(own, ())
    if nothing.explains:
        return [nothing], [nothing]
    others = comparison_power.other_laws(own.setting.car, own.setting.law)
    laws = [start for start in pool.map(partial(_of_law, own), others.items()) if start]
    of_laws = [Search(start, (FRICTION,)) for start in laws]
    tried = _settled([Search(own, (each,)) for each in felt] + of_laws, pool)
    if good := [each for each in tried if each.explains]:
        return good, tried
    tried += _settled([Search(own, pair) for pair in combinations(felt, 2)], pool)
    if good := [each for each in tried if each.explains]:
        twins = [Search(start, each.chosen) for each in good if FRICTION in each.chosen for start in laws]
        return [*good, *(each for each in _settled(twins, pool) if each.explains)], tried
    near = [each.start for each in sorted(of_laws, key=lambda each: each.chi_square)[:LAWS]]
    rest = [each for each in felt if each is not FRICTION]
    tried += _settled([Search(start, (FRICTION, each)) for start in near for each in rest], pool)
    return [each for each in tried if each.explains], tried


def _settled(searches: list[Search], pool: ThreadPoolExecutor) -> list[Search]:
    """The searches that leave least, after their last step: after each of the first steps the others end."""
    for kept in KEPT_SEARCHES:
        list(pool.map(lambda each: each.steps(1), searches))
        searches = sorted(searches, key=lambda each: each.chi_square)[:kept]
        searches = [each for each in searches if each.chi_square <= FAR_CHI_SQUARE_RATIO * searches[0].chi_square]
    list(pool.map(lambda each: each.steps(ROUNDS), searches))
    return searches


def _of_law(own: Start, law: tuple[str, Any]) -> Start | None:
    """A start with another law; None where the car cannot be driven with it."""
    name, made = law
    try:
        return Start(own.measured, own.setting._replace(law=made), name)
    except (ValueError, RefusedError):
        return None


def amount(change: Change) -> str:
    """By how much a parameter is changed, in words."""
    if change.name in DELAYS:
        return f"{number(abs(1e3 * change.value), 2)}\u00a0ms {'longer' if change.value > 0.0 else 'shorter'}"
    more = "higher" if change.value > 1.0 else "lower"
    return f"{number(change.value)} times" if change.value >= 2.0 else f"{percent(abs(change.value - 1.0))} {more}"


def ends(change: Change) -> str:
    """The interval of a change, in words."""
    if change.name in DELAYS:
        return f"{number(1e3 * change.low)} to {number(1e3 * change.high)}\u00a0ms"
    return f"{number(100.0 * (change.low - 1.0))} to {number(100.0 * (change.high - 1.0))}\u00a0%"


def phrase(fit: Fit) -> str:
    """What a fit changes, in words."""
    told = [f"{change.name} {amount(change)}" for change in fit.changes]
    law = [f"the friction law {law_name(fit.law)}"] if fit.law else []
    return in_words([*law, *told]) if told else "the measured input alone"


def _offsets(found: Explanation) -> list[str]:
    """The offsets in words."""
    told = {name: straight.NOTED_ZEROS[name][1] for name in found.offsets}
    return [
        f"{label(n)} {number(found.offsets[n].value * metrics.UNITS[unit])}\u00a0{unit}" for n, unit in told.items()
    ]


def verdict(found: Explanation) -> str:
    """The answer in one sentence of at most 25 words."""
    said = "Simulation and measurement disagree"
    if not found.explained:
        return f"{said}; no change of one or two of the parameters that were tried explains it."
    if found.best.changes:
        return f"{said}; {phrase(found.best)} in the simulation would explain it."
    if found.offsets:
        return f"{said}; sensors that are off would explain it: {in_words(_offsets(found))}."
    return f"{said}, but not beyond noise once it is driven with the speed and handwheel angle of the measurement."


def sentences(found: Explanation) -> list[str]:
    """What explains as well, how far it gets, which sensors are off and what stays hidden."""
    told, worst = [], max(pair.worst for pair in found.pairs)
    if not found.explained:
        told.append(f"Nearest comes {phrase(found.best)}; it leaves more than noise, by which another cause shows.")
    elif found.equal:
        told.append(f"As well explains it: {'; or '.join(map(phrase, found.equal))}.")
    elif found.best.changes:
        told.append("No other change of as few named parameters explains it as well.")
    where = "inside" if found.inside else "not inside"
    told.append(
        f"Driven again with it, the simulation is {where} the tolerances, at most {number(worst, 2)} of them away."
    )
    if found.offsets:
        told.append(f"Sensors are off, which is subtracted: {in_words(_offsets(found))}.")
    if found.hidden:
        told.append(f"This measurement cannot show: {in_words(found.hidden)}.")
    return told


def as_json(found: Explanation) -> dict[str, Any]:
    """The explanation as JSON."""

    def of(fit: Fit) -> dict[str, Any]:
        changes = {name: {"value": value, "interval": [low, high]} for name, value, low, high in fit.changes}
        return {"law": fit.law or None, "changes": changes, "chi_square": fit.chi_square, "p": fit.probability}

    return {
        "explained": found.explained,
        "nearest": of(found.best),
        "equally_well": [of(fit) for fit in found.equal],
        "offsets": {name: {"value": x, "interval": [low, high]} for name, (x, low, high) in found.offsets.items()},
        "hidden": list(found.hidden),
        "inside": found.inside,
        "cross_plots": [{"x": p.x, "y": p.y, "inside": p.inside, "worst": p.worst} for p in found.pairs],
        "in_words": [verdict(found), *sentences(found)],
    }


def suggested(found: Explanation) -> tuple[Car, Any]:
    """The car of the best fit, with a name and a source that say so, and its friction."""
    car = found.setting.car
    source = f"{car.name} with {phrase(found.best)}, the nearest explanation of a measurement: {car.source}"
    return car._replace(name=f"{car.name}_suggested", source=source), found.setting.law
