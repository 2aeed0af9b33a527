"""A car with other values of its parameters, driven through tests: what sensitivity and populations share.

Parameters are named as in :func:`quantity`. All functions and their arguments can be pickled, so that any worker drives
any car.
"""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

from steer_env import friction, manoeuvres, metrics
from steer_env.episode.randomise import LIMITS, Conditions, undrawn
from steer_env.experiments.calibration import problem
from steer_env.experiments.calibration.problem import Range
from steer_env.friction import gear
from steer_env.friction.law import LAWS
from steer_env.friction.sites import Sites, with_defaults
from steer_env.manoeuvres.common.driving import BESIDE, FAR_START_AMPLITUDE, FoundAmplitude, search
from steer_env.metrics import definition
from steer_env.tuning import driving, parameters, reward
from steer_env.tuning.env import SPEED
from steer_env.tuning.parameters import KNOWN
from steer_env.tuning.scenarios.common.definition import SPEEDS, Drive, drive
from steer_env.tuning.scenarios.tune_all_round import SCENARIO
from steer_env.vehicle import cars
from steer_env.vehicle.cars import Car, UnusualCar
from steer_env.vehicle.keys import declared_keys
from steer_env.vehicle.steering.eps import Assist
from steer_env.vehicle.steering.margins import TARGETS as MARGINS

FRICTION = "friction."  # begins the name of a parameter of the law
# Conditions with their usual value, limits and unit.
CONDITIONS = {
    "load": (0.0, LIMITS["load"], "kg"),
    "road_friction": (1.0, LIMITS["road_friction"], "1"),
    "friction_level": (1.0, LIMITS["friction_level"], "1"),
    "speed": (SPEED, SPEEDS, "m/s"),
}
ENOUGH = 100.0  # in place of an infinite gain margin [dB]
# Margins of the assist loop, hands fixed, as outputs beside the metrics: unit and least value.
OF_LOOP = {"phase_margin": ("deg", MARGINS[0]), "gain_margin": ("dB", MARGINS[1])}
Output = tuple[str, str]  # test and metric; "" and the name of a margin of the loop


class Quantity(NamedTuple):
    """A parameter of a car with its friction law, or a condition."""

    unit: str
    own: float  # of the car as it is [unit]
    limits: tuple[float, float]  # [unit]


class Study(NamedTuple):
    """All that the outputs depend on but the values of the parameters."""

    car: Car
    law: Any  # parameters; of sites as they were given, so that what was left out follows what is varied
    chassis: str  # of tests that do not need two tracks
    factors: tuple[Range, ...]
    tests: tuple[str, ...] = SCENARIO.tests
    options: Mapping[str, Mapping[str, Any]] = {}  # of tests that are not driven as usual
    own_hands: bool = False  # whether parameters of the assist, too, change the motion of the hands for a test
    near: Mapping[str, FoundAmplitude] = {}  # test -> amplitude of the nominal car, from which others are sought

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Every output, test by test."""
        of_tests = ((test, name) for test in self.tests for name in metrics.available(test))
        return (*of_tests, *(("", name) for name in OF_LOOP))


class Block(NamedTuple):
    """A case of the sweep: parameter sets that are driven one after another."""

    study: Study
    rows: tuple[tuple[float, ...], ...]  # values of the factors [their units]
    label: str


class Outputs(NamedTuple):
    """What a parameter set gives."""

    values: dict[Output, float]  # in the unit of the output; NaN where it is refused
    refused: dict[Output, str]  # reasons


def unit_of(output: Output) -> str:
    """The unit of a metric or a margin."""
    test, name = output
    return definition(name).unit if test else OF_LOOP[name][0]


def quantity(car: Car, law: Any, name: str, what: str = "--parameters") -> Quantity:
    """A parameter by name; ValueError, which begins with ``what``, for one that is not there.

    Names are those of the assist (``steer_env.tuning.parameters``), ``load``, ``friction_level``, ``road_friction`` and
    ``speed``, ``friction.KEY`` of the law or ``friction.SITE.KEY`` of sites, and ``SECTION.KEY`` of a car file with a
    number.
    """
    if name in KNOWN:
        p = KNOWN[name]
        return Quantity(p.unit, p.value(car.assist, 0.0), problem.tuning_ranges(car.assist, [name])[0].limits)
    if name in CONDITIONS:
        own, limits, unit = CONDITIONS[name]
        return Quantity(unit, own, limits)
    section, _, key = name.partition(".")
    found: Any = car.data().get(section)
    if section == "friction":
        found, key = _of_friction(law, name)
    value = found.get(key) if isinstance(found, dict) else None
    if section == "friction" and value is None:
        raise ValueError(f"{what} has no number {name!r}; this friction has {', '.join(_names(law))}")
    if isinstance(value, bool) or not isinstance(value, int | float):
        kinds = f"{', '.join(KNOWN)}, {', '.join(CONDITIONS)}, friction.KEY or friction.SITE.KEY, or SECTION.KEY "
        kinds += "of a car file with a number"
        raise ValueError(f"{what} has no number {name!r}; there are {kinds}")
    if section != "friction":
        about = declared_keys()[section][key]
        return Quantity(about.unit, float(value), (about.low, about.high))
    limits = (gear.LEAST_EFFICIENCY, 1.0) if key == "efficiency" else (-math.inf, math.inf)
    return Quantity(LAWS[found["law"]].units.get(key, "SI"), float(value), limits)


def _of_friction(law: Any, name: str) -> tuple[dict[str, Any], str]:
    """The law, of sites that of the site, of which a name that begins with ``FRICTION`` is a parameter, and its key."""
    p, key = friction.resolve(law), name.removeprefix(FRICTION)
    if not isinstance(p, Sites):
        return friction.as_mapping(p), key
    given = with_defaults(law)
    site, dot, key = key.rpartition(".")
    if not dot and len(given) == 1:  # one law for all sites
        (site,) = given
    return given.get(site, {}), key


def _names(law: Any) -> list[str]:
    """The numbers of a friction by name, of which one law at all sites has each once."""
    p = friction.resolve(law)
    if not isinstance(p, Sites):
        return [FRICTION + key for key, value in friction.as_mapping(p).items() if isinstance(value, float)]
    given = with_defaults(law)
    return [
        f"{FRICTION}{f'{site}.' if len(given) > 1 else ''}{key}"
        for site, own in given.items()
        for key, value in own.items()
        if isinstance(value, float)
    ]


def change_car(
    study: Study, values: Mapping[str, float], change: Callable[[Mapping[str, Any]], Car]
) -> tuple[Car, Conditions]:
    """The car and the conditions that values of parameters make, with the assist of the car as it is.

    ``change`` is the ``cars.changer`` of the study's car.

    Raises
    ------
    ValueError
        The car or the law does not allow them.
    """
    conditions: dict[str, Any] = {name: values.get(name, own) for name, (own, *_) in CONDITIONS.items()}
    law = {key.removeprefix(FRICTION): x for key, x in values.items() if key.startswith(FRICTION)}
    known = (*KNOWN, *CONDITIONS)
    changes = {key: x for key, x in values.items() if key not in known and not key.startswith(FRICTION)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnusualCar)  # told when the car was read; the others are meant to be so
        car = change(changes)
    resolved = friction.varied(study.law, law) if law else friction.resolve(study.law)
    return car, undrawn(car, resolved, conditions["speed"])._replace(**conditions)


def assist_of(car: Car, values: Mapping[str, float]) -> Assist:
    """The assist of a car with values of its parameters; the others stay its own."""
    return parameters.make_assist(car.assist, parameters.complete(car.assist, values))


def drives_of(study: Study) -> list[Drive]:
    """The tests as the tuning environments drive them; those that they do not drive, and with options, as the battery.

    Those with options, too, have the sampling of the tuning environments.
    """
    usual = {each.manoeuvre.name: each for each in SCENARIO.drives}
    drives = [usual.get(test) or drive(test) for test in study.tests]
    made = {test: manoeuvres.make(test, **options) for test, options in study.options.items()}
    return [each._replace(manoeuvre=made.get(each.manoeuvre.name, each.manoeuvre)) for each in drives]


class _Prepared(NamedTuple):
    """A plant in the tests, with the motion of the hands."""

    car: Car
    drives: dict[str, driving.PreparedDrive]  # by test
    undriven: dict[str, str]  # test -> why it cannot be driven


def evaluate(block: Block) -> list[Outputs]:
    """Metrics and margins of the parameter sets of a block; the hands' motion is found for each plant.

    A set that the car or the law does not allow has all its outputs refused; of a test that cannot be driven, those of
    the test.
    """
    study, found, change = block.study, list[Outputs](), cars.changer(block.study.car)
    names = [factor.name for factor in study.factors]
    of_plant = [i for i, name in enumerate(names) if study.own_hands or name not in KNOWN]
    plants: dict[Any, _Prepared | ValueError] = {}
    for k in range(0, len(block.rows), BESIDE):
        sets = [dict(zip(names, row)) for row in block.rows[k : k + BESIDE]]
        keys = [tuple(row[i] for i in of_plant) for row in block.rows[k : k + BESIDE]]
        plants = {key: plants[key] for key in keys if key in plants}  # several sets in a row may have one plant
        new = {key: values for key, values in zip(keys, sets) if key not in plants}
        plants |= dict(zip(new, _prepare(study, [*new.values()], change)))
        found += _outputs(study, [plants[key] for key in keys], sets)
    return found


def near_nominal(study: Study) -> Study:
    """The study with the amplitudes of its nominal car, which lie near those of the others.

    They are part of every case, so that no result depends on where and after what it is computed.
    """
    found = dict(study.near)
    with suppress(ValueError):  # of a car that cannot be driven, which each row tells of itself
        own = {factor.name: factor.own for factor in study.factors}
        car, drawn = _loaded(study, own, cars.changer(study.car))
        for each in driving.adapt_drives(drives_of(study), study.chassis, drawn):
            m = each.manoeuvre
            if m.name not in found and m.lateral_acceleration is not None and m.amplitude is None:
                with suppress(ValueError):
                    found[m.name] = search(driving.build_test(each, car, drawn), m, near=FAR_START_AMPLITUDE)
    return study._replace(near=found)


def _loaded(
    study: Study, values: Mapping[str, float], change: Callable[[Mapping[str, Any]], Car]
) -> tuple[Car, Conditions]:
    """The car with its load, and with its own assist where that moves the hands, and the conditions."""
    car, drawn = change_car(study, values, change)
    if study.own_hands:
        car = car._replace(assist=assist_of(car, values))
    return car.loaded(drawn.load), drawn


def _prepare(
    study: Study, sets: Sequence[Mapping[str, float]], change: Callable[[Mapping[str, Any]], Car]
) -> list[_Prepared | ValueError]:
    """The plants of up to ``BESIDE`` parameter sets, or why a set is not allowed."""
    found: list[_Prepared | ValueError] = []
    given: list[tuple[_Prepared, list[Drive], Conditions]] = []
    for values in sets:
        try:
            car, drawn = _loaded(study, values, change)
        except ValueError as error:
            found.append(error)
            continue
        plant = _Prepared(car, {}, {})
        found.append(plant)
        given.append((plant, driving.adapt_drives(drives_of(study), study.chassis, drawn), drawn))
    for k, test in enumerate(study.tests):
        of_test = [(drives[k], plant.car, drawn) for plant, drives, drawn in given]
        for (plant, *_), each in zip(given, driving.prepare_beside(of_test, study.near.get(test))):
            if isinstance(each, ValueError):
                plant.undriven[test] = str(each)
            else:
                plant.drives[test] = each
    return found


def _outputs(
    study: Study, plants: Sequence[_Prepared | ValueError], sets: Sequence[Mapping[str, float]]
) -> list[Outputs]:
    """The outputs of up to ``BESIDE`` parameter sets by their plants."""
    found: list[Outputs] = []
    assists: dict[int, Assist] = {}
    tests: dict[int, dict[str, driving.PreparedDrive]] = {}
    for i, (plant, values) in enumerate(zip(plants, sets)):
        try:
            if isinstance(plant, ValueError):
                raise plant
            assist = plant.car.assist if study.own_hands else assist_of(plant.car, values)
            found.append(_of_loop(plant, assist))
            assists[i], tests[i] = assist, plant.drives
        except ValueError as error:
            found.append(Outputs(dict.fromkeys(study.outputs, math.nan), dict.fromkeys(study.outputs, str(error))))
    for test in study.tests:
        drives = {i: tests[i][test] for i in assists if test in tests[i]}
        for i, each in zip(drives, driving.evaluate_beside([*drives.values()], [assists[i] for i in drives])):
            for name, metric in each.items():
                found[i].values[test, name] = metric.value
                if metric.reason:
                    found[i].refused[test, name] = metric.reason
    return found


def _of_loop(plant: _Prepared, assist: Assist) -> Outputs:
    """The margins with an assist, and what cannot be driven; ValueError where no test can be."""
    if not plant.drives:
        raise ValueError(next(iter(plant.undriven.values())))
    refused = {(test, name): why for test, why in plant.undriven.items() for name in metrics.available(test)}
    margins = driving.margins(tuple(plant.drives.values()), assist)
    phase, gain = reward.degrees_and_decibels(margins)
    of_loop = (min(phase, 180.0), min(gain, ENOUGH)) if margins.stable else (0.0, 0.0)
    return Outputs(dict.fromkeys(refused, math.nan) | dict(zip((("", name) for name in OF_LOOP), of_loop)), refused)
