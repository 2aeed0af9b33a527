"""The loop in real time on this machine: how it keeps its deadlines and what a sample costs, also under conditions."""

import gc
import os
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import reduce
from operator import add
from typing import Any, NamedTuple

from steer_env.experiments.studies.common import device_latency
from steer_env.experiments.studies.common.device_latency import Latency
from steer_env.live.real_time.measure import Durations, Measured, lock_memory, measure
from steer_env.vehicle import subsystems
from steer_env.vehicle.cars import Car
from steer_env.vehicle.subsystems import Subsystem

SPEED = 100.0 / 3.6  # held [m/s]
PRIORITY = 50  # of SCHED_FIFO among the conditions, where the run has none of its own
ROUNDS = 5  # that the conditions are measured one after another
# Shares of the run's time, for the laws, the conditions, and each way of the latency.
LAWS_SHARE, CONDITIONS_SHARE, WAY_SHARE = 0.6, 0.25, 0.05


class Row(NamedTuple):
    """One law on one chassis."""

    chassis: str
    law: str
    found: Measured


class Condition(NamedTuple):
    """How the process runs."""

    name: str
    priority: bool = False  # SCHED_FIFO
    locked: bool = False  # memory
    garbage: bool = False  # whether a thread of Python makes garbage and collects it meanwhile


class Results(NamedTuple):
    """What a run of the command found."""

    rows: list[Row]
    conditions: dict[str, Measured | str]  # by the name of the condition; the reason where it is not allowed
    latencies: dict[str, Latency | str]  # by the way of the angle and the torque; the reason where there is none
    priority: int  # of the loop meanwhile


# Locked memory stays locked, so that it comes last.
_CONDITIONS = (
    Condition("as every program"),
    Condition("as every program, beside garbage collection", garbage=True),
    Condition("SCHED_FIFO", priority=True),
    Condition("SCHED_FIFO, locked memory", priority=True, locked=True),
    Condition("SCHED_FIFO, locked memory, beside garbage collection", priority=True, locked=True, garbage=True),
)


def car_with_robot(car: Car, law: Any, chassis: str) -> Subsystem:
    """The car with a prescribed handwheel angle."""
    return subsystems.make("car", car.plant(law, SPEED, True, chassis=chassis), SPEED)


def collect(
    car: Car,
    laws: Mapping[str, Any],
    chassis: Sequence[str],
    seconds: float,
    priority: int = 0,
    notify: Callable[[float, str], None] = lambda part, text: None,
) -> Results:
    """Measure every law on every chassis, then the last of them under conditions and the latency through devices.

    It takes ``seconds`` in all, and the time to compile.
    """
    cases = [(kind, law) for kind in chassis for law in laws]
    rows = []
    for i, (kind, law) in enumerate(cases):
        notify(LAWS_SHARE * i / len(cases), f"{law}, {kind}")
        rows.append(
            Row(kind, law, measure(car_with_robot(car, laws[law], kind), LAWS_SHARE * seconds / len(cases), priority))
        )
    kind, law = cases[-1]
    part = car_with_robot(car, laws[law], kind)
    notify(LAWS_SHARE, "latency")
    wanted = priority or PRIORITY
    given = wanted if _may_have_priority(wanted) else 0
    latencies = device_latency.through_all(part, WAY_SHARE * seconds, given)
    notify(1.0 - CONDITIONS_SHARE, "under conditions")
    return Results(rows, under_conditions(part, CONDITIONS_SHARE * seconds, wanted), latencies, given)


def _may_have_priority(priority: int) -> bool:
    """Whether a thread of this process may have a priority of SCHED_FIFO."""

    def rise() -> None:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
            found.append(True)
        except PermissionError:
            found.append(False)

    found: list[bool] = []
    thread = threading.Thread(target=rise)
    thread.start()
    thread.join()
    return found[0]


def under_conditions(part: Subsystem, seconds: float, priority: int) -> dict[str, Measured | str]:
    """Run a car under each condition for an equal time, in rounds; those that are not allowed have the reason."""
    found: dict[str, Measured | str] = {}
    each = seconds / len(_CONDITIONS) / ROUNDS
    for locked in (False, True):
        for _ in range(ROUNDS):
            for condition in _CONDITIONS:
                if condition.locked != locked or isinstance(found.get(condition.name), str):
                    continue
                try:
                    if locked:
                        lock_memory()
                    with _collecting(condition.garbage):
                        run = measure(part, each, priority if condition.priority else 0)
                except PermissionError as error:
                    found[condition.name] = str(error)
                    continue
                before = found.get(condition.name)
                found[condition.name] = both(before, run) if isinstance(before, Measured) else run
    return found


@contextmanager
def _collecting(wanted: bool) -> Iterator[None]:
    """A thread that makes cycles of garbage and collects it, within the block."""
    stop = threading.Event()

    def work() -> None:
        while not stop.is_set():
            for _ in range(10_000):
                cycle: list[Any] = []
                cycle.append(cycle)
            gc.collect()

    thread = threading.Thread(target=work, daemon=True)
    if wanted:
        thread.start()
    try:
        yield
    finally:
        stop.set()
        if wanted:
            thread.join()


def both(one: Measured, other: Measured) -> Measured:
    """Two runs as one."""
    counts = {name: value + other.counts[name] for name, value in one.counts.items()}
    return Measured(one.lateness + other.lateness, one.bare + other.bare, one.work + other.work, counts)


def merge_durations(rows: Sequence[Row], part: Callable[[Measured], Durations]) -> Durations:
    """The durations of several rows as one."""
    return reduce(add, (part(row.found) for row in rows))
