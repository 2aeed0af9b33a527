"""Everything that the report rests on, computed side by side in a few processes: nothing is worded or drawn here."""

import math
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from itertools import pairwise
from typing import Any, NamedTuple

from steer_env import manoeuvres
from steer_env.experiments.studies import (
    battery,
    commonroad_cross_validation,
    friction_laws,
    full_vehicle,
    loop_width,
    real_time,
)
from steer_env.friction.law import law_of
from steer_env.manoeuvres import Manoeuvre
from steer_env.vehicle import cars
from steer_env.vehicle.steering import margins

Notify = Callable[[float, str], None]  # gets the part that is done and what comes next


# Every manoeuvre, those that feel is judged by first.
_FIRST = ("weave", "slow-ramp")
EVERY_TEST: dict[str, dict[str, Any]] = {name: {} for name in (*_FIRST, *manoeuvres.available())}


class Scope(NamedTuple):
    """How much of everything; the defaults are the report's, less is for tests."""

    car: str = "compact"
    tests: Mapping[str, Mapping[str, Any]] = EVERY_TEST  # with the manoeuvres' options
    steps: tuple[float, ...] = real_time.STEPS  # of the real-time table [s]
    speeds_kph: tuple[float, ...] = (0.0, 50.0, 100.0)  # of the assist loop's margins; 0 is parking
    vehicle: bool = True  # whether to study the full vehicle
    widths: tuple[float, ...] = loop_width.LEVELS  # of friction, for the loop widths; none: not studied
    workers: int | None = None  # processes; None: as many as there are processors, up to four


class Cell(NamedTuple):
    """Margins of the assist loop in one cell of the boost table."""

    torque: float  # middle of the cell [N m]
    gain: float  # [1]
    phase_deg: float  # [deg]
    gain_db: float  # [dB]
    crossover_hz: float  # [Hz]
    stable: bool


class LawResult(NamedTuple):
    """Everything that one law contributes, but for times."""

    drives: dict[str, battery.Drive]
    torques: dict[str, Any]  # of friction_study.characteristics
    rows: list[real_time.Row]
    held: list[friction_laws.Held]


class Results(NamedTuple):
    """What the report says, before it is said."""

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
    vehicle: full_vehicle.Study | None  # with the base law
    cross_validation: (
        dict[str, dict[str, commonroad_cross_validation.Comparison]] | None
    )  # manoeuvre -> case; with the vehicle
    loop_width: loop_width.Curves | None


def _of_law(scope: Scope, p: Any, held: bool) -> LawResult:
    car, name = cars.load(scope.car), law_of(p).name
    return LawResult(
        {test: battery.drive(car, p, test, options) for test, options in scope.tests.items()},
        friction_laws.characteristics(p),
        real_time.accuracy(p, scope.steps),
        friction_laws.held_torque(car, name) if held and name in friction_laws.HELD_LAWS else [],
    )


def assist_cells(car: str, speed_kph: float) -> list[Cell]:
    """Margins of a packaged car's assist loop in every cell of its boost table that assists, at a speed."""
    loaded = cars.load(car)
    cells = []
    for low, high in pairwise(loaded.assist.torques):
        torque = 0.5 * float(low + high)
        gain = margins.boost_gain(loaded.assist, torque, speed_kph / 3.6)
        if gain > 1e-6:  # the table is flat at its end
            m = margins.margins(loaded.column, loaded.assist, gain, speed_kph / 3.6)
            decibel = 20.0 * math.log10(m.gain)
            cells.append(Cell(torque, gain, math.degrees(m.phase), decibel, float(m.phase_crossover), m.stable))
    return cells


def _of_vehicle(car: str, p: Any) -> full_vehicle.Study:
    return full_vehicle.collect(cars.load(car), p)


@contextmanager
def pool_of(workers: int | None = None) -> Iterator[ProcessPoolExecutor]:
    """Processes, by default one a processor and up to four, as compiling holds the interpreter's lock.

    An error or Ctrl-C ends them at once.
    """
    others = set(multiprocessing.active_children())
    workers = workers or min(_processors(), 4)
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, context, signal.signal, (signal.SIGINT, signal.SIG_IGN))
    try:
        yield pool
        pool.shutdown()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()
        raise


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold Ctrl-C and SIGTERM back to the end of the block: a worker half started would stay behind."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    signals = signal.SIGINT, signal.SIGTERM
    handlers = [signal.signal(number, lambda number, frame: held.append(number)) for number in signals]
    try:
        yield
    finally:
        for number, handler in zip(signals, handlers):
            signal.signal(number, handler)
        if held:
            signal.raise_signal(held[0])


def collect(laws: dict[str, Any], scope: Scope, notify: Notify) -> Results:
    """Run everything for the given laws (label -> parameters).

    The laws run side by side; times are taken afterwards, with the machine to themselves.

    Raises
    ------
    ValueError
        Unknown car, or a manoeuvre that cannot be driven.
    """
    car = cars.load(scope.car)
    base = "lugre" if "lugre" in laws else next(iter(laws))
    first = {law_of(p).name: law for law, p in reversed(laws.items())}
    found: dict[Any, Any] = {}
    with pool_of(scope.workers) as pool:
        jobs: dict[Any, Any] = {}
        with uninterrupted():
            if scope.vehicle:  # first, as it compiles longest
                jobs[pool.submit(_of_vehicle, scope.car, laws[base])] = full_vehicle
                jobs[pool.submit(commonroad_cross_validation.collect)] = commonroad_cross_validation
            if scope.widths:
                jobs[pool.submit(loop_width.collect, [scope.car], ["lugre"], levels=scope.widths)] = loop_width
            jobs |= {pool.submit(_of_law, scope, p, held=first[law_of(p).name] == law): law for law, p in laws.items()}
            jobs |= {pool.submit(assist_cells, scope.car, kph): kph for kph in scope.speeds_kph}
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
        vehicle=found.get(full_vehicle),
        cross_validation=found.get(commonroad_cross_validation),
        loop_width=found.get(loop_width),
        margins={"parking" if kph == 0 else f"{kph:g} km/h": found[kph] for kph in scope.speeds_kph},
    )


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
