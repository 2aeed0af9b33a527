"""Sensitivity of every metric and margin to parameters of the assist, the friction, the load and the car."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import friction
from steer_env.episode.randomise import LIMITS, undrawn
from steer_env.experiments.calibration import problem, screening
from steer_env.experiments.calibration.problem import Range
from steer_env.experiments.calibration.screening import Design, Effect
from steer_env.experiments.sweep import Runner, run
from steer_env.friction import gear
from steer_env.friction.law import LAWS
from steer_env.friction.numerics.check import number
from steer_env.friction.sites import Sites, with_defaults
from steer_env.metrics import available, definition
from steer_env.targets import Targets
from steer_env.tuning import driving, parameters, reward
from steer_env.tuning.env import SPEED
from steer_env.tuning.parameters import KNOWN
from steer_env.tuning.scenarios.common.definition import SPEEDS
from steer_env.tuning.scenarios.tune_all_round import SCENARIO
from steer_env.vehicle import cars
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.margins import TARGETS as MARGINS

SPAN = 0.5  # part of the tuning range to either side of the car's own value that a parameter of the assist goes over
FACTOR = 1.25  # by which another quantity of the car is multiplied and divided by default, assumed
FRICTION = "friction."  # begins the name of a parameter of the law
FACTOR_OF_LAW = 2.0  # by which a parameter of the law is multiplied and divided by default, assumed
# Conditions with their usual value and range; assumed.
CONDITIONS = {
    "load": (0.0, 0.0, 300.0, "kg"),
    "road_friction": (1.0, 0.75, 1.0, "1"),
    "friction_level": (1.0, 0.5, 2.0, "1"),
    "speed": (SPEED, 22.0, 33.0, "m/s"),
}
UNITS = {"column.K_tb": "N m/rad", "column.C_tb": "N m s/rad", "column.I1": "kg m2", "column.I2": "kg m2"}
ENOUGH = 100.0  # in place of an infinite gain margin [dB]
OF_LOOP = ("phase_margin", "gain_margin")


class Study(NamedTuple):
    """All that the outputs depend on but the values of the parameters."""

    car: Car
    law: Any  # parameters; of sites as they were given, so that what was left out follows what is varied
    chassis: str
    factors: tuple[Range, ...]


class Block(NamedTuple):
    """A case of the sweep: parameter sets that are evaluated one after another."""

    study: Study
    rows: tuple[tuple[float, ...], ...]  # values of the factors [their units]
    label: str


class Outputs(NamedTuple):
    """What a parameter set gives."""

    values: dict[str, float]  # metric or margin -> value in its unit; NaN where it is refused
    refused: dict[str, str]  # metric -> reason


class Row(NamedTuple):
    """An output with what every parameter does to it."""

    name: str
    test: str  # "" for a margin of the loop
    unit: str
    own: float  # of the car as it is [unit]
    band: tuple[float, float] | None  # target [unit]
    effects: list[Effect] | None  # by factor; None where it is refused too often
    refused: int  # points of the design at which it is refused
    reason: str  # the most frequent one

    @property
    def scale(self) -> float:
        """What a change is told as a share of: width of the band, limit of a margin, else size of the own value."""
        if self.band is None:
            return abs(self.own) if self.own else math.nan
        low, high = self.band
        return low if math.isinf(high) else high - low


class Results(NamedTuple):
    """All that the page shows."""

    study: Study
    law: str
    targets: str
    design: Design
    rows: list[Row]

    @property
    def points(self) -> int:
        """Number of parameter sets in the design."""
        return int(np.prod(self.design.points.shape[:2]))


def factors_of(car: Car, law: Any, names: Sequence[str], span: float = SPAN) -> tuple[Range, ...]:
    """The parameters by name, each with the range that it is given as ``NAME=LOW:HIGH``, or the usual one.

    Names are those of the assist (``steer_env.tuning.parameters``), ``load``, ``friction_level``, ``road_friction`` and
    ``speed``, ``friction.KEY`` of the law or ``friction.SITE.KEY`` of sites, and ``SECTION.KEY`` of a car file with a
    number.

    Raises
    ------
    ValueError
        An unknown name, one that is given twice, or a range that is empty or not allowed.
    """
    number("--span", span, minimum=0.0, maximum=1.0, above=True)
    given = dict[str, tuple[float, float] | None]()
    for text in names:
        name, equals, ends = text.partition("=")
        if name in given:
            raise ValueError(f"--parameters gives {name} twice: give it once")
        given[name] = _ends(name, ends) if equals else None
    if len(given) < 2:
        raise ValueError(f"--parameters needs two or more of them, got {', '.join(given) or 'none'}")
    return tuple(_factor(car, law, name, ends, span) for name, ends in given.items())


def _ends(name: str, text: str) -> tuple[float, float]:
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        raise ValueError(f"--parameters {name} takes a range as {name}=LOW:HIGH, got {text!r}") from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ValueError(f"--parameters {name}={text}: the range must be finite, with LOW below HIGH")
    return low, high


def _factor(car: Car, law: Any, name: str, ends: tuple[float, float] | None, span: float) -> Range:
    if name in KNOWN:
        p, a = KNOWN[name], car.assist
        own, usual, unit = p.value(a, 0.0), (p.value(a, -span), p.value(a, span)), p.unit
        limits = problem.ranges_of(a, [name])[0].limits
    elif name in CONDITIONS:
        own, low, high, unit = CONDITIONS[name]
        usual, limits = (low, high), SPEEDS if name == "speed" else LIMITS[name]
        if name == "road_friction":
            limits = SCENARIO.least_road_friction, limits[1]
    else:
        own, unit = _number_of(car, law, name), UNITS.get(name, "SI")
        if name.startswith(FRICTION):
            given, key = _of_friction(law, name)
            unit = LAWS[given["law"]].units.get(key, "SI")
        by = FACTOR_OF_LAW if name.startswith(FRICTION) else FACTOR
        limits = (gear.LEAST_EFFICIENCY, 1.0) if name.endswith(".efficiency") else (-math.inf, math.inf)
        usual = max(own / by, limits[0]), min(own * by, limits[1])
        if ends is None and own <= 0.0:
            raise ValueError(f"{name} is {own:g}: give its range, --parameters {name}=LOW:HIGH")
    low, high = ends or usual
    if not limits[0] <= low < high <= limits[1]:
        raise ValueError(
            f"--parameters {name}={low:g}:{high:g}: it may go from {limits[0]:g} to {limits[1]:g} [{unit}]"
        )
    return Range(name, unit, low, high, own, low > 0.0, limits)


def _number_of(car: Car, law: Any, name: str) -> float:
    """The value of a parameter of the law or of a key of the car."""
    section, _, key = name.partition(".")
    found: Any = car.data().get(section)
    if section == "friction":
        found, key = _of_friction(law, name)
    value = found.get(key) if isinstance(found, dict) else None
    if isinstance(value, bool) or not isinstance(value, int | float):
        kinds = f"{', '.join(KNOWN)}, {', '.join(CONDITIONS)}, friction.KEY or friction.SITE.KEY, or SECTION.KEY "
        kinds += "of a car file with a number"
        raise ValueError(f"--parameters has no number {name!r}; there are {kinds}")
    return float(value)


def _of_friction(law: Any, name: str) -> tuple[dict[str, Any], str]:
    """The law, of sites that of the site, of which a name that begins with ``FRICTION`` is a parameter, and its key."""
    p, key = friction.resolve(law), name.removeprefix(FRICTION)
    if not isinstance(p, Sites):
        return friction.as_mapping(p), key
    site, _, key = key.partition(".")
    return with_defaults(law).get(site, {}), key


def value(factor: Range, x: float) -> float:
    """The value of a parameter at x in [0, 1] of its range, by its logarithm where the range is above 0."""
    if factor.logarithmic:
        return factor.low * (factor.high / factor.low) ** x
    return factor.low + x * (factor.high - factor.low)


def evaluate(block: Block) -> list[Outputs]:
    """Metrics and margins of the parameter sets of a block; the hands' motion is found for each plant.

    A set that the car or the law does not allow, or that cannot be driven, has all its metrics refused.
    """
    study, found = block.study, list[Outputs]()
    names = [factor.name for factor in study.factors]
    of_plant = [i for i, name in enumerate(names) if name not in KNOWN]
    last: tuple[list[float], tuple[driving.PreparedDrive, ...]] | None = None
    for row in block.rows:
        values, plant = dict(zip(names, row)), [row[i] for i in of_plant]
        try:
            if last is None or last[0] != plant:
                last = plant, _prepared(study, values)
            found.append(_outputs(last[1], values))
        except ValueError as error:
            names_of = (*SCENARIO.metrics, *OF_LOOP)
            found.append(Outputs(dict.fromkeys(names_of, math.nan), dict.fromkeys(names_of, str(error))))
    return found


def _prepared(study: Study, values: Mapping[str, float]) -> tuple[driving.PreparedDrive, ...]:
    """The tests in the plant that the values make, with the hands' motion for its own assist."""
    conditions: dict[str, Any] = {name: values.get(name, usual) for name, (usual, *_) in CONDITIONS.items()}
    law = {key.removeprefix(FRICTION): x for key, x in values.items() if key.startswith(FRICTION)}
    known = (*KNOWN, *CONDITIONS)
    changes = {key: x for key, x in values.items() if key not in known and not key.startswith(FRICTION)}
    car = cars.load(study.car.data(), changes=changes) if changes else study.car
    resolved = friction.varied(study.law, law) if law else friction.resolve(study.law)
    drawn = undrawn(car, resolved, conditions["speed"])._replace(**conditions)
    return driving.prepare(SCENARIO, car, study.chassis, drawn)


def _outputs(drives: tuple[driving.PreparedDrive, ...], values: Mapping[str, float]) -> Outputs:
    own = drives[0].car.assist
    named = parameters.reported(tuple(values))
    assist = parameters.tuned(own, {name: values.get(name, KNOWN[name].value(own, 0.0)) for name in named})
    metrics, margins = driving.tried(drives, assist)
    found = {name: math.nan if metric.reason else float(metric.value) for name, metric in metrics.items()}
    phase, gain = math.degrees(margins.phase), min(reward.decibels(margins.gain), ENOUGH)
    of_loop = dict(zip(OF_LOOP, (min(phase, 180.0), gain) if margins.stable else (0.0, 0.0)))
    return Outputs(found | of_loop, {name: metric.reason for name, metric in metrics.items() if metric.reason})


def collect(
    study: Study,
    targets: Targets,
    law: str,
    design: Design,
    sweep: Runner = run,
    notify: Callable[[float, str], None] = lambda *_: None,
) -> Results:
    """Evaluate the points of a design, and the effects of every parameter.

    Parameters
    ----------
    study : Study
    targets : Targets
        Whose bands changes are told as shares of.
    law : str
        The friction law in words.
    design : Design
        Of as many parameters as the study has.
    sweep : Runner
    notify : (share, text) -> None

    Raises
    ------
    ValueError
        The car as it is cannot be driven through the tests, or too few parameter sets can.
    """
    cases = [Block(study, (tuple(factor.own for factor in study.factors),), "the car as it is")]
    for k, points in enumerate(design.points.tolist(), 1):
        rows = tuple(tuple(map(value, study.factors, point)) for point in points)
        cases.append(Block(study, rows, f"parameter sets of block {k}"))
    results = sweep(evaluate, cases, notify=notify, words=lambda case: case.label)
    (first,), blocks = results[0], results[1:]
    if all(map(math.isnan, (first.values[name] for name in SCENARIO.metrics))):
        raise ValueError(f"the car {study.car.name!r} cannot be driven as it is: {next(iter(first.refused.values()))}")
    bands = {name: band.good for test in SCENARIO.tests for name, band in targets.bands.get(test, {}).items()}
    places = [(test, name) for test in SCENARIO.tests for name in available(test)]
    found = []
    for test, name in (*places, *(("", name) for name in OF_LOOP)):
        outputs: NDArray[np.float64] = np.array([[each.values[name] for each in block] for block in blocks])
        reasons = [each.refused[name] for block in blocks for each in block if name in each.refused]
        unit, band = (definition(name).unit, bands.get(name)) if test else _limit(name)
        reason = max(reasons, key=reasons.count) if reasons else ""
        effects = screening.effects(design, outputs)
        found.append(Row(name, test, unit, first.values[name], band, effects, len(reasons), reason))
    if all(row.effects is None for row in found):
        raise ValueError(
            f"every output is refused at most parameter sets: {found[0].reason}; narrow the ranges with --span or "
            "--parameters NAME=LOW:HIGH"
        )
    return Results(study, law, targets.name, design, found)


def _limit(name: str) -> tuple[str, tuple[float, float]]:
    """Unit and least value of a margin."""
    return {"phase_margin": ("deg", (MARGINS[0], math.inf)), "gain_margin": ("dB", (MARGINS[1], math.inf))}[name]
