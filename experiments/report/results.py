"""Everything that the report rests on, computed in a few processes side by side; no text or picture is made here."""

from collections.abc import Callable, Mapping
from concurrent.futures import as_completed
from typing import Any, NamedTuple

from steer_env import manoeuvres
from steer_env.experiments.studies import cross_validation, friction_laws, loop_width, real_time, vehicle
from steer_env.experiments.studies.common import battery
from steer_env.experiments.studies.common.assist_margins import Cell, assist_cells
from steer_env.experiments.studies.common.processes import pool_of, uninterrupted
from steer_env.experiments.studies.loop_width import Curves
from steer_env.experiments.studies.vehicle import Study
from steer_env.friction.law import law_of
from steer_env.manoeuvres import Manoeuvre
from steer_env.vehicle import cars

Notify = Callable[[float, str], None]  # gets the part that is done and what comes next
Compared = dict[str, dict[str, cross_validation.Comparison]]  # manoeuvre -> case

# Every manoeuvre, those for on-centre feel first.
_FIRST = ("weave", "slow-ramp")
EVERY_TEST: dict[str, dict[str, Any]] = {name: {} for name in (*_FIRST, *manoeuvres.available())}


class Scope(NamedTuple):
    """Extent of the report; the defaults are those of the command, and tests use less."""

    car: str | cars.Car = "compact"  # a car, or the name of a packaged one
    tests: Mapping[str, Mapping[str, Any]] = EVERY_TEST  # name of the manoeuvre -> its options
    steps: tuple[float, ...] = real_time.STEPS  # of the real-time table [s]
    speeds_kph: tuple[float, ...] = (0.0, 50.0, 100.0)  # speeds for the margins of the assist loop; 0 is parking
    vehicle: bool = True  # whether to study the full vehicle
    widths: tuple[float, ...] = loop_width.LEVELS  # levels of friction for the loop widths; empty: not studied
    workers: int | None = None  # processes; None: one for each processor, up to four

    def loaded(self) -> cars.Car:
        """The car."""
        return cars.load(self.car) if isinstance(self.car, str) else self.car


class LawResult(NamedTuple):
    """Results of one law, except times."""

    drives: dict[str, battery.Drive]
    torques: dict[str, Any]  # of friction_laws.characteristics
    rows: list[real_time.Row]
    held: list[friction_laws.Held]


class Results(NamedTuple):
    """All numbers of the report."""

    laws: dict[str, Any]  # label -> parameters
    base: str
    car: cars.Car
    manoeuvres: dict[str, Manoeuvre]  # by test
    drives: dict[str, dict[str, battery.Drive]]  # test -> law
    torques: dict[str, dict[str, Any]]
    held: list[friction_laws.Held]
    tables: dict[str, list[real_time.Row]]
    sample_ns: dict[str, float]  # whole car [ns]
    margins: dict[str, list[Cell]]  # by speed
    vehicle: Study | None  # studied with the base law
    cross_validation: Compared | None  # manoeuvre -> case; computed if the full vehicle is studied
    loop_width: Curves | None


def _of_law(scope: Scope, p: Any, held: bool) -> LawResult:
    car, name = scope.loaded(), law_of(p).name
    return LawResult(
        {test: battery.drive(car, p, test, options) for test, options in scope.tests.items()},
        friction_laws.characteristics(p),
        real_time.accuracy(p, scope.steps),
        friction_laws.held_torque(car, name) if held and name in friction_laws.HELD_LAWS else [],
    )


def collect(laws: dict[str, Any], scope: Scope, notify: Notify) -> Results:
    """Run everything for the given laws (label -> parameters).

    The laws run in parallel; times are taken afterwards, when no other process of the report runs.

    Raises
    ------
    ValueError
        For an unknown car, or a manoeuvre that cannot be driven.
    """
    car = scope.loaded()
    base = "lugre" if "lugre" in laws else next(iter(laws))
    first = {law_of(p).name: law for law, p in reversed(laws.items())}
    found: dict[Any, Any] = {}
    with pool_of(scope.workers) as pool:
        jobs: dict[Any, Any] = {}
        with uninterrupted():
            if scope.vehicle:  # first, as it compiles for the longest time
                jobs[pool.submit(vehicle.collect, car, laws[base])] = vehicle
                jobs[pool.submit(cross_validation.collect)] = cross_validation
            if scope.widths:
                jobs[pool.submit(loop_width.collect, [car], ["lugre"], levels=scope.widths)] = loop_width
            jobs |= {pool.submit(_of_law, scope, p, held=first[law_of(p).name] == law): law for law, p in laws.items()}
            jobs |= {pool.submit(assist_cells, car, kph): kph for kph in scope.speeds_kph}
        for i, job in enumerate(as_completed(jobs), start=1):
            found[jobs[job]] = job.result()
            notify(0.75 * i / len(jobs), "driving" if i < len(jobs) else "timing")
    of_law: dict[str, LawResult] = {law: found[law] for law in laws}
    tables = real_time.timed(
        {law: (p, of_law[law].rows) for law, p in laws.items()}, lambda part: notify(0.75 + 0.2 * part, "timing")
    )
    return Results(
        laws=laws,
        base=base,
        car=car,
        manoeuvres={test: manoeuvres.make(test, **options) for test, options in scope.tests.items()},
        drives={test: {law: of_law[law].drives[test] for law in laws} for test in scope.tests},
        torques={law: of_law[law].torques for law in laws},
        held=[test for law in laws for test in of_law[law].held],
        tables=tables,
        sample_ns=real_time.plant_samples(car, laws),
        vehicle=found.get(vehicle),
        cross_validation=found.get(cross_validation),
        loop_width=found.get(loop_width),
        margins={"parking" if kph == 0 else f"{kph:g} km/h": found[kph] for kph in scope.speeds_kph},
    )
