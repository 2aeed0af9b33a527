"""Everything that the report rests on, computed as one sweep; no text or picture is made here."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

from steer_env import manoeuvres
from steer_env.connect import external
from steer_env.experiments.studies import friction_laws, loop_width, real_time, vehicle
from steer_env.experiments.studies.common import battery, computing_time, friction_records
from steer_env.experiments.studies.common.assist_margins import Cell, assist_cells
from steer_env.experiments.studies.common.computing_time import Times
from steer_env.experiments.studies.common.friction_records import Judged
from steer_env.experiments.studies.loop_width import Curves
from steer_env.experiments.studies.vehicle import Study
from steer_env.experiments.sweep import Runner, run
from steer_env.friction.law import law_of
from steer_env.friction.sites import Sites
from steer_env.manoeuvres import Manoeuvre
from steer_env.recording.recording import Recording
from steer_env.vehicle import cars

Notify = Callable[[float, str], None]  # gets the part that is done and what comes next

# Parts of the time after which all is driven and timed; what comes then is drawn [1].
SWEPT, TIMED = 0.85, 0.9

# Every scripted manoeuvre, those for on-centre feel first.
_FIRST = ("weave", "slow-ramp")
EVERY_TEST: dict[str, dict[str, Any]] = {name: {} for name in (*_FIRST, *battery.SCRIPTED)}


class Scope(NamedTuple):
    """Extent of the report; the defaults are those of the command, and tests use less."""

    car: str | cars.Car = "compact"  # a car, or the name of a packaged one
    tests: Mapping[str, Mapping[str, Any]] = EVERY_TEST  # name of the manoeuvre -> its options
    steps: tuple[float, ...] = real_time.STEP_LENGTHS  # of the real-time table [s]
    speeds_kph: tuple[float, ...] = (0.0, 50.0, 100.0)  # speeds for the margins of the assist loop; 0 is parking
    vehicle: bool = True  # whether to study the full vehicle
    widths: tuple[float, ...] = loop_width.LEVELS  # levels of friction for the loop widths; empty: not studied
    chassis: str | None = None  # file of an external vehicle that drives the tests; None: the chassis of this project

    def loaded(self) -> cars.Car:
        """The car."""
        return cars.load(self.car) if isinstance(self.car, str) else self.car


Drives = dict[str, dict[str, battery.Drive]]  # test -> law


class FittedLaws(NamedTuple):
    """Laws that are each fitted to the same measured friction, and the tests with them."""

    laws: dict[str, Any]  # label -> parameters
    drives: Drives
    undetermined: dict[str, tuple[str, ...]]  # law -> parameters that the measurement leaves open


class LawResult(NamedTuple):
    """Results of one law, except tests and times."""

    torques: dict[str, Any]  # of friction_laws.characteristics
    rows: list[real_time.SchemeRow]
    held: list[friction_laws.HeldTest]


class Results(NamedTuple):
    """All numbers of the report."""

    laws: dict[str, Any]  # label -> parameters
    base: str
    car: cars.Car
    manoeuvres: dict[str, Manoeuvre]  # by test
    drives: Drives
    small_turns: dict[str, battery.Drive]  # law -> the weave with turns as small as on a straight road
    fitted: FittedLaws  # each law fitted to the measured friction, by its name; those that can be
    torques: dict[str, dict[str, Any]]
    held: list[friction_laws.HeldTest]
    tables: dict[str, list[real_time.SchemeRow]]
    times: Times
    margins: dict[str, list[Cell]]  # by speed
    vehicle: Study | None  # studied with the base law
    loop_width: Curves | None
    chassis: str | None = None  # file of the external vehicle that drove the tests


def _drive(car: cars.Car, manoeuvre: Manoeuvre, p: Any, chassis: str | None) -> Recording:
    """Drive a manoeuvre, with an external vehicle where one is given."""
    if chassis is None:
        return battery.recording(car, manoeuvre, p)
    with external.opened(chassis, manoeuvre.speed) as simulator:
        return manoeuvres.drive(car, manoeuvre, p, simulator)


def _of_test(scope: Scope, test: str, options: Mapping[str, Any], laws: Mapping[str, Any]) -> dict[str, battery.Drive]:
    car, run = scope.loaded(), partial(_drive, chassis=scope.chassis)
    return {law: battery.drive(car, p, test, options, run) for law, p in laws.items()}


def _fitted(scope: Scope, law: str) -> tuple[Judged, dict[str, battery.Drive]]:
    """A law that is fitted to the packaged measurement, and the tests with it; no tests where it cannot be fitted."""
    (found,) = friction_records.judge((friction_records.rig(), [law]))
    if found.parameters is None:
        return found, {}
    return found, {test: _of_test(scope, test, of, {law: found.parameters})[law] for test, of in scope.tests.items()}


def _of_law(scope: Scope, p: Any, held: bool) -> LawResult:
    car, name = scope.loaded(), law_of(p).name
    return LawResult(
        friction_laws.characteristics(p),
        [] if isinstance(p, Sites) else real_time.accuracy(p, scope.steps),  # the other schemes know one contact
        friction_laws.held_torque(car, name) if held and not scope.chassis and name in friction_laws.HELD_LAWS else [],
    )


class Part(NamedTuple):
    """A part of the results that a worker computes."""

    name: str  # of ``_PART_FUNCTIONS``
    of: Any  # the test, the law, or the speed [km/h]; None where there is one only
    arguments: tuple[Any, ...] = ()


_PART_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "full vehicle": vehicle.collect,
    "loop widths": loop_width.collect,
    "test": _of_test,
    "small turns": _of_test,
    "law": _of_law,
    "fitted": _fitted,
    "margins": assist_cells,
}


# Times that they take with eleven laws, by which the time that is left is told [s]; the fit of Bouc-Wen has an exponent
# that is no whole number.
_COST = {
    "full vehicle": 0.7,
    "loop widths": 3.5,
    "test": 1.1,
    "small turns": 1.1,
    "law": 0.6,
    "fitted": 2.4,
    "margins": 0.05,
}
_DEAR = {("fitted", "bouc_wen"): 9.0}


def _cost(part: Part) -> float:
    return _DEAR.get((part.name, part.of), _COST[part.name])


def _computed(part: Part) -> Any:
    return _PART_FUNCTIONS[part.name](*part.arguments)


def _in_words(part: Part) -> str:
    if part.of is None:
        return part.name
    return f"{part.name} {part.of}" if isinstance(part.of, str) else f"{part.name} at {part.of:g} km/h"


def base_law(laws: Mapping[str, Any]) -> str:
    """The law that others are compared with."""
    return "lugre" if "lugre" in laws else next(iter(laws))


def _parts(laws: dict[str, Any], base: str, car: cars.Car, scope: Scope) -> list[Part]:
    """The parts of a report, those that take long first."""
    first = {law_of(p).name: law for law, p in reversed(laws.items())}
    parts = [Part("fitted", law, (scope, law)) for law in friction_records.fittable(list(first))]
    if scope.widths:
        parts.append(Part("loop widths", None, ([car], ["lugre"], tuple(loop_width.TESTS), scope.widths)))
    parts += [Part("test", test, (scope, test, options, laws)) for test, options in scope.tests.items()]
    parts.append(Part("small turns", None, (scope, "weave", friction_laws.SMALL_TURNS, laws)))
    parts += [Part("full vehicle", None, (car, laws[base]))] if scope.vehicle else []
    parts += [Part("law", law, (scope, p, first[law_of(p).name] == law)) for law, p in laws.items()]
    return parts + [Part("margins", kph, (car, kph, list(laws.values()))) for kph in scope.speeds_kph]


def collect(
    laws: dict[str, Any],
    scope: Scope,
    notify: Notify,
    sweep: Runner = run,
    finished: Callable[[Part, Any], None] = lambda *_: None,
) -> Results:
    """Run everything for the given laws (label -> parameters), as cases of a sweep.

    ``finished`` gets parts and what they hold as they come, but not those that the sweep has kept. Times are taken
    afterwards, in this process, when no worker of the sweep runs.

    Raises
    ------
    ValueError
        For an unknown car, or a manoeuvre that cannot be driven.
    """
    car = scope.loaded()
    base = base_law(laws)
    parts = _parts(laws, base, car, scope)
    results = sweep(
        _computed,
        parts,
        notify=lambda part, text: notify(SWEPT * part, text),
        words=_in_words,
        cost=_cost,
        finished=finished,
    )
    found = {(part.name, part.of): result for part, result in zip(parts, results)}
    of_law: dict[str, LawResult] = {law: found["law", law] for law in laws}
    fits = {law: fit for (name, law), fit in found.items() if name == "fitted" and fit[1]}
    return Results(
        laws=laws,
        base=base,
        car=car,
        manoeuvres={test: manoeuvres.make(test, **options) for test, options in scope.tests.items()},
        drives={test: found["test", test] for test in scope.tests},
        small_turns=found["small turns", None],
        fitted=FittedLaws(
            {law: fit.parameters for law, (fit, _) in fits.items()},
            {test: {law: drives[test] for law, (_, drives) in fits.items()} for test in scope.tests},
            {law: fit.undetermined for law, (fit, _) in fits.items()},
        ),
        torques={law: of_law[law].torques for law in laws},
        held=[test for law in laws for test in of_law[law].held],
        tables={law: of_law[law].rows for law in laws if of_law[law].rows},
        times=computing_time.of_laws(laws, car, lambda part: notify(SWEPT + (TIMED - SWEPT) * part, "timing")),
        vehicle=found.get(("full vehicle", None)),
        loop_width=found.get(("loop widths", None)),
        chassis=scope.chassis,
        margins={"parking" if kph == 0 else f"{kph:g} km/h": found["margins", kph] for kph in scope.speeds_kph},
    )
