"""What is tuned: parameters with ranges, conditions, and the evaluation of a parameter set to metrics and margins.

A set is driven through the tests of ``TuneAllRound`` in every condition, with the handwheel angles of the car's own
assist. All functions and their arguments can be pickled, so that any worker evaluates any set.
"""

import hashlib
import math
import pickle
import warnings
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from steer_env.episode.randomise import LIMITS, undrawn
from steer_env.experiments.calibration import constraints
from steer_env.friction import resolve
from steer_env.friction.numerics.check import number
from steer_env.targets import Band, Targets
from steer_env.tuning import driving, parameters
from steer_env.tuning.env import SPEED
from steer_env.tuning.parameters import FUNCTIONS, KNOWN, PARAMETERS
from steer_env.tuning.reward import MAX_DISTANCE
from steer_env.tuning.scenarios.tune_all_round import SCENARIO
from steer_env.vehicle.cars import Car, UnusualCar
from steer_env.vehicle.steering import eps, stability
from steer_env.vehicle.steering.assist import functions
from steer_env.vehicle.steering.by_wire import Wire
from steer_env.vehicle.steering.eps import SAMPLE_TIME, Assist

LEVELS = (0.5, 1.0, 2.0)  # of friction, factors on the law's torque [1]
LADEN = 300.0  # added mass of the laden car: four people and luggage, assumed [kg]
USED = (*PARAMETERS, "return_gain", "handwheel_damping", "friction_share")  # tuned by default
# Of functions of the assist, beside their strengths: unit, range, limits, and where a search begins if the car does not
# have the function; assumed. The active return costs phase by its saturation, however small its gain.
KEY_RANGES = {"return_saturation": ("N m", (0.2, 2.0), (0.05, 10.0), 0.5)}
TUNED = (*USED, *KEY_RANGES)  # by ``steer-env tune`` by default
GROUPS = {
    "weave": "on-centre",
    "release": "return",
    "returnability": "return",
    "parking": "effort",
    "step-steer": "effort",
}  # test -> objective
# Beyond what the check of the assist allows, or where the curve is no longer one of a boost; assumed.
LIMITS_OF = {
    "boost_level": (0.05, 10.0),
    "boost_progression": (0.3, 4.0),
    "boost_low_speed": (0.1, 10.0),
    "damping_level": (0.02, 50.0),
    "damping_low_speed": (0.05, 20.0),
    "lead_zero": (1.0, parameters.HIGHEST_CORNER),
    "lead_pole": (10.0, parameters.HIGHEST_CORNER),
}


class Range(NamedTuple):
    """A tuned parameter with its range."""

    name: str
    unit: str
    low: float  # [unit]
    high: float  # [unit]
    own: float  # the car's own value [unit]
    logarithmic: bool  # whether it is searched by its logarithm
    limits: tuple[float, float]  # to which the range may be widened [unit]


class Condition(NamedTuple):
    """Under which a set is driven."""

    friction_level: float  # [1]
    load: float  # added to the body [kg]

    @property
    def label(self) -> str:
        """The condition in words."""
        return f"friction x {self.friction_level:g}, {f'{self.load:g} kg' if self.load else 'unladen'}"


class Problem(NamedTuple):
    """All that the metrics and margins of a parameter set depend on."""

    car: Car
    law: Any  # parameters of the friction law
    bands: dict[str, Band]  # by metric
    groups: dict[str, str]  # metric -> objective
    chassis: str
    speed: float  # of the tests that have none of their own [m/s]
    ranges: tuple[Range, ...]
    conditions: tuple[Condition, ...]


class Evaluation(NamedTuple):
    """What a parameter set does; plain numbers, as JSON holds them."""

    metrics: dict[str, dict[str, float | None]]  # condition -> metric -> value [its unit]; None where it is refused
    margins: dict[str, float]  # as :func:`steer_env.experiments.calibration.constraints.margins`
    refused: dict[str, str]  # metric -> first reason


def tuning_ranges(assist: Assist, names: Sequence[str] = USED) -> tuple[Range, ...]:
    """The parameters with the ranges of the tuning environments.

    Raises
    ------
    ValueError
        An unknown parameter, or one that is named twice.
    """
    known = (*KNOWN, *KEY_RANGES)
    if not names or len(set(names)) != len(names) or not set(names) <= set(known):
        raise ValueError(f"parameters must be some of {', '.join(known)}, each once, got {', '.join(names) or 'none'}")
    found = []
    for name in names:
        if name in KEY_RANGES:
            unit, (low, high), limits, usual = KEY_RANGES[name]
            value = float(functions.keys(assist.functions, SAMPLE_TIME).get(name, usual))
            limits = min(limits[0], value), max(limits[1], value)
            found.append(Range(name, unit, min(low, value), max(high, value), value, True, limits))
            continue
        p = KNOWN[name]
        own, ends = p.value(assist, 0.0), (p.value(assist, -1.0), p.value(assist, 1.0))
        limits = LIMITS_OF[name] if name in LIMITS_OF else (0.0, FUNCTIONS[name].highest)
        low, high = (0.0, ends[1]) if name in FUNCTIONS else ends
        limits = min(limits[0], low), max(limits[1], high)
        found.append(Range(name, p.unit, low, high, own, name not in FUNCTIONS, limits))
    return tuple(found)


def drive_conditions(load: float = LADEN) -> tuple[Condition, ...]:
    """The nominal condition, and the corners of friction and load."""
    load = number("load [kg]", load, minimum=0.0, maximum=LIMITS["load"][1])
    corners = [Condition(level, mass) for mass in dict.fromkeys((0.0, load)) for level in (LEVELS[0], LEVELS[-1])]
    return (Condition(1.0, 0.0), *corners)


def make(
    car: Car,
    targets: Targets,
    law: Any = None,
    names: Sequence[str] = TUNED,
    load: float = LADEN,
    chassis: str = "single_track",
    speed: float = SPEED,
) -> Problem:
    """The problem of tuning a car's assist to target bands.

    Parameters
    ----------
    car : Car
        Whose assist is the starting point.
    targets : Targets
        Their bands for the tests of ``TuneAllRound`` count.
    law : str, mapping or parameters, optional
        Friction at level 1, as :func:`steer_env.friction.resolve` takes it; by default that of the car.
    names : sequence of str
        Of the tuned parameters.
    load : float
        Mass of the load in the laden conditions, 0 to 500 [kg].
    chassis : str
        Of the tests that do not need two tracks.
    speed : float
        Of the tests that have none of their own [m/s].

    Raises
    ------
    ValueError
        The car is steered by wire, its boost falls with the torque, the targets have no band for the tests or
        contradict themselves, or a value is out of its range.
    """
    if isinstance(car.assist.wire, Wire):
        raise ValueError(
            f"{car.name!r} is steered by wire and has no boost to tune: the environments Tune... tune its feel, or "
            "give a car with a torsion bar"
        )
    falls = np.argwhere(np.diff(car.assist.boost, axis=1) < 0.0)
    if falls.size:
        i, j = falls[0]
        a = car.assist
        raise ValueError(
            f"assist.boost of {car.name!r} falls at {3.6 * a.speeds[i]:.4g} km/h from {a.boost[i, j]:.4g} N m at "
            f"{a.torques[j]:g} N m to {a.boost[i, j + 1]:.4g} N m at {a.torques[j + 1]:g} N m: a boost must not fall "
            "with the torque; correct this row in the car file"
        )
    bands = targets.of_tests(SCENARIO.tests)
    groups = {name: GROUPS[test] for test in SCENARIO.tests for name in targets.bands.get(test, {})}
    _require_consistent(targets.name, bands)
    resolved = resolve(car.friction if law is None else law)
    return Problem(
        car, resolved, bands, groups, chassis, speed, tuning_ranges(car.assist, names), drive_conditions(load)
    )


def _require_consistent(name: str, bands: Mapping[str, Band]) -> None:
    """Refuse bands that no metrics can be in together, as one metric is the ratio of two others."""
    ratio, over, under = "torque_gradient_ratio", "torque_gradient_at_0p1g", "torque_gradient_at_0g"
    if not {ratio, over, under} <= bands.keys() or bands[over].good[0] <= 0.0 or bands[under].good[0] <= 0.0:
        return
    low, high = bands[over].good[0] / bands[under].good[1], bands[over].good[1] / bands[under].good[0]
    wanted = bands[ratio].good
    if wanted[0] > high or wanted[1] < low:
        raise ValueError(
            f"targets {name!r} contradict each other: the good bands of {over} and {under} leave a {ratio} of "
            f"{low:.3g} to {high:.3g}, but its own is {wanted[0]:g} to {wanted[1]:g}; change one of the three"
        )


class Prepared(NamedTuple):
    """What is the same for every set of a problem."""

    drives: tuple[tuple[driving.PreparedDrive, ...], ...]  # of each condition
    reached: tuple[float, ...]  # :func:`constraints.reaches` of the laden car [N m]


_PREPARED: dict[str, Prepared] = {}  # of the problem evaluated last, in this process


def digest(problem: Problem) -> str:
    """A text that tells problems apart, ranges aside."""
    return hashlib.sha256(pickle.dumps(tuple(problem._replace(ranges=())), 5)).hexdigest()[:32]


def prepare_problem(problem: Problem) -> Prepared:
    """The drives of a problem in every condition, kept in this process.

    Raises
    ------
    ValueError
        The car with its own assist does not reach the lateral acceleration of a test, or its loop is unstable.
    """
    key = digest(problem)
    if key not in _PREPARED:
        require_stable(problem)
        drives = []
        for condition in problem.conditions:
            load, level = condition.load, condition.friction_level
            drawn = undrawn(problem.car, problem.law, problem.speed)._replace(load=load, friction_level=level)
            try:
                drives.append(driving.prepare_drives(SCENARIO, problem.car, problem.chassis, drawn))
            except ValueError as error:
                remedy = "begin with a car or tyre that reaches it, or with a smaller --load"
                raise ValueError(_cannot_drive(problem, f" with {condition.label}", error, remedy)) from None
        laden = problem.car.loaded(problem.conditions[-1].load)
        _PREPARED[key] = Prepared(tuple(drives), constraints.reaches(laden, problem.chassis))
    return _PREPARED[key]


def require_stable(problem: Problem) -> None:
    """Refuse a starting point whose assist loop is unstable at a speed of its table, hands fixed or free."""
    c, a = problem.car.column, problem.car.assist
    for v, free in product(a.speeds.tolist(), (False, True)):
        if found := stability.reason(c, a, v, free=free):
            raise ValueError(_cannot_drive(problem, "", found, _remedy(problem.car)))


def _remedy(car: Car) -> str:
    """What makes an unstable loop stable at all speeds, as a factor on what the car has now."""
    c, a = car.column, car.assist
    if 0.0 < (factor := stability.functions_to_the_limit(c, a)) < 1.0:
        own = functions.keys(a.functions, SAMPLE_TIME)
        on = [key for key in stability.STRENGTHS.split(", ") if np.any(own.get(key, 0.0))]
        return f"begin with at most {stability.three_digits(factor)} times its {', '.join(on)}"
    if 0.0 < (factor := stability.boost_to_the_limit(c, a)) < 1.0:
        return (
            f"begin with at most {stability.three_digits(factor)} times its boost: multiply assist.boost_scale, which "
            "is 1 where the car file has none, by that"
        )
    return f"begin with less assist.boost and less of {stability.STRENGTHS} together"


def _cannot_drive(problem: Problem, condition: str, why: object, remedy: str) -> str:
    return f"the starting point, {problem.car.name!r}{condition}, cannot be driven: {why}; {remedy}"


def own_values(problem: Problem) -> dict[str, float]:
    """The car's own parameter set."""
    return {r.name: r.own for r in problem.ranges}


def assist(problem: Problem, values: Mapping[str, float]) -> Assist:
    """The assist that a parameter set makes."""
    return eps.make(**keys(problem, values))


def keys(problem: Problem, values: Mapping[str, float]) -> dict[str, Any]:
    """The keys of a car file's section ``assist`` of a parameter set."""
    others = {name: values[name] for name in KEY_RANGES if name in values}
    own = problem.car.assist
    return {**parameters.keys(own, parameters.complete(own, values)), **others}


def without_effect(assist: Assist) -> set[str]:
    """Parameters of functions that an assist does not have, whose values are where a search begins."""
    return set(KEY_RANGES) - functions.keys(assist.functions, SAMPLE_TIME).keys()


def tuned_car(problem: Problem, values: Mapping[str, float]) -> Car:
    """The car with a parameter set, whose assist is to the bit the one that was evaluated."""
    return parameters.car_with(problem.car, keys(problem, values), f"{problem.car.name}_best")


def tuned_car_quietly(problem: Problem, values: Mapping[str, float]) -> Car:
    """:func:`tuned_car` without its warnings, which are told where its file is written."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnusualCar)
        return tuned_car(problem, values)


def evaluate(problem: Problem, values: Mapping[str, float], every_metric: bool = True) -> Evaluation:
    """Metrics in every condition and margins of a parameter set.

    Parameters
    ----------
    problem : Problem
    values : mapping of str to float
        Parameters by name, in the units of their ranges; those left out are the car's own.
    every_metric : bool
        Otherwise a set whose loop is unstable is not driven, and all its metrics are None.
    """
    tuned = assist(problem, values)
    load, (drives, reached) = problem.conditions[-1].load, prepare_problem(problem)
    margins = constraints.margins(problem.car, tuned, problem.law, load, reached, problem.chassis)
    metrics: dict[str, dict[str, float | None]] = {}
    refused: dict[str, str] = {}
    if not every_metric and not margins["stable"]:
        nothing = dict[str, float | None].fromkeys(problem.bands)
        reason = "the assist loop is unstable"
        return Evaluation({c.label: nothing for c in problem.conditions}, margins, dict.fromkeys(nothing, reason))
    for condition, each in zip(problem.conditions, drives):
        found = driving.evaluate(each, tuned)
        refused = {name: found[name].reason for name in problem.bands if found[name].reason} | refused
        metrics[condition.label] = {
            name: None if found[name].reason else float(found[name].value) for name in problem.bands
        }
    return Evaluation(metrics, margins, refused)


def distance(value: float | None, band: Band) -> float:
    """Distance of a value from the good band over its width, at most ``MAX_DISTANCE``, also for a refused one [1]."""
    if value is None or not math.isfinite(value):
        return MAX_DISTANCE
    return min(band.distance(value), MAX_DISTANCE)


def places(problem: Problem, found: Evaluation, counted: Sequence[str]) -> list[list[float | None]]:
    """Where each counted metric lies in its band, in each condition: 0 at the lower end, 1 at the upper one [1]."""
    rows = []
    for name in counted:
        low, high = problem.bands[name].good
        values = (each[name] for each in found.metrics.values())
        rows.append([None if x is None or not math.isfinite(x) else (x - low) / (high - low) for x in values])
    return rows


def worst(problem: Problem, found: Evaluation) -> dict[str, tuple[float, str]]:
    """Of each metric, the largest distance from its band [1] and the condition that has it."""
    return {
        name: max((distance(values[name], band), label) for label, values in found.metrics.items())
        for name, band in problem.bands.items()
    }


def objectives(problem: Problem, found: Evaluation, counted: Sequence[str]) -> dict[str, float]:
    """Of each group, the sum of the largest distances of its metrics that are counted [1]."""
    each = worst(problem, found)
    wanted = dict.fromkeys(problem.groups[name] for name in counted)
    return {group: sum(each[n][0] for n in counted if problem.groups[n] == group) for group in wanted}
