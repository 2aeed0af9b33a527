"""Cost of a friction law in real time: error, boundedness, mean and worst step for every scheme and step length.

All are of one case: the default car's column under a sine of 2.5 N m of hand torque at 0.5 Hz for 4 s. Errors are
against :func:`steer_env.experiments.studies.integrators.reference`. Times are wall-clock times on this machine. The
mean step is the median over repeats of a whole compiled run. The worst step excludes what the operating system adds:
the same deterministic run is repeated, and each step counts with its shortest time, less that of an empty call.
"""

import argparse
import gc
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from time import perf_counter_ns
from typing import Any, NamedTuple

import numpy as np

from steer_env import friction, manoeuvres
from steer_env.experiments.studies.integrators import SCHEMES, Case, arguments, integrate, reference
from steer_env.friction.numerics.kernel import bind, kernel
from steer_env.vehicle import cars, plant
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering import column

STEPS = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2)  # [s], whole multiples of the first
BLOWN_UP = 3.0  # torque and speed of a bounded run stay below this many times their true peaks
USABLE = 0.01  # RMS error relative to the peak of the friction torque up to which a scheme counts as usable; assumed
REPEATS = 7
RUN_IN = 200  # calls before the timed ones
TIMED = 2.0  # the first cycle of the case, which passes through every regime [s]


class Row(NamedTuple):
    """One scheme at one step; times are None where the run does not stay bounded."""

    scheme: str
    step: float  # [s]
    error: float | None  # RMS, relative to the peak of the friction torque [1]; None where not finite
    bounded: bool
    ns_per_step: float | None  # [ns]
    worst_step_ns: float | None  # [ns]


def default_case(p: Any) -> Case:
    """The case of the table with the parameters of a law; the column is that of the default car."""
    return Case(column.make(), p, amplitude=2.5, frequency=0.5, duration=4.0)


def accuracy(p: Any, steps: tuple[float, ...] = STEPS) -> list[Row]:
    """Error and boundedness of every scheme at every step length, without times."""
    case = default_case(p)
    finest = steps[0]
    exact = reference(case, finest)
    peaks = BLOWN_UP * np.abs(exact).max(), BLOWN_UP * np.abs(integrate(case, "midpoint", finest)[1]).max()
    rows = []
    for scheme in SCHEMES:
        for h in steps:
            T_F, w = integrate(case, scheme, h)
            bounded = bool(np.abs(T_F).max() <= peaks[0] and np.abs(w).max() <= peaks[1])  # false for NaN
            with np.errstate(over="ignore", invalid="ignore"):
                residual = T_F - exact.reshape(T_F.size, -1).mean(axis=1)
                error = float(np.sqrt(np.mean(residual**2)) / np.abs(exact).max())
            rows.append(Row(scheme, h, error if np.isfinite(error) else None, bounded, None, None))
    return rows


class Clock:
    """Times of one row, collected over repeats."""

    def __init__(self, p: Any, row: Row) -> None:
        self.case = default_case(p)._replace(duration=TIMED)
        self.row = row
        self.torques = self._fresh()[5].tolist()
        self.results = np.empty(len(self.torques)), np.empty(len(self.torques))
        self.loop = bind(SCHEMES[row.scheme].loop, *self._fresh(), *self.results)
        *state, _, K_road, h = self._fresh()
        self.calls = [bind(function, *state, 0.0, K_road, h) for function in (SCHEMES[row.scheme].step, _nothing)]
        self.shortest = [[math.inf] * len(self.torques) for _ in self.calls]
        self.runs: list[int] = []

    def _fresh(self) -> tuple[Any, ...]:
        return arguments(self.case, self.row.scheme, self.row.step)

    def repeat(self) -> None:
        """Time one more run as a whole, and one step by step."""
        start = self._fresh()
        none = [result[:0] for result in self.results]
        self.runs.append(_time(self.loop, *start, *self.results) - _time(self.loop, *start, *none))
        for call, shortest in zip(self.calls, self.shortest):
            # the calls before the timed ones fill the processor's caches
            rounds = [(self._fresh(), self.torques[:RUN_IN], shortest.copy()), (self._fresh(), self.torques, shortest)]
            for (*state, _, K_road, h), torques, kept in rounds:
                for i, torque in enumerate(torques):
                    elapsed = _time(call, *state, torque, K_road, h)
                    if elapsed < kept[i]:
                        kept[i] = elapsed

    def timed(self) -> Row:
        """The row with its times, without the time of the call itself."""
        steps, calls = np.array(self.shortest)
        return self.row._replace(
            ns_per_step=max(float(np.median(self.runs)), 0.0) / len(self.torques),
            worst_step_ns=max(float(np.max(steps - calls)), 0.0),
        )


def timed(tables: dict[str, tuple[Any, list[Row]]], notify: Callable[[float], None]) -> dict[str, list[Row]]:
    """Add the times to the bounded rows of every law's table; ``notify`` gets the part that is done.

    Each repeat goes through all tables, so that a slow moment of the machine affects all laws alike.
    """
    clocks = {(law, row): Clock(p, row) for law, (p, rows) in tables.items() for row in rows if row.bounded}
    with _no_garbage_collection():
        for i in range(REPEATS):
            for clock in clocks.values():
                clock.repeat()
            notify((i + 1) / REPEATS)
    return {
        law: [clocks[law, row].timed() if row.bounded else row for row in rows] for law, (_, rows) in tables.items()
    }


@kernel
def _nothing(c, p, q, memory, work, T1, K_road, h):
    """A step that does nothing, to measure the cost of a call."""
    return 0.0, 0.0


def _time(function: Callable, *arguments: Any) -> int:
    start = perf_counter_ns()
    function(*arguments)
    return perf_counter_ns() - start


@contextmanager
def _no_garbage_collection() -> Iterator[None]:
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def plant_samples(car: Car, laws: dict[str, Any]) -> dict[str, float]:
    """Computing time of the whole car for one sample of 1 ms in a weave, by law [ns]."""
    weave = manoeuvres.make("weave")
    inputs = manoeuvres.inputs(weave, 0.25, 2.0)
    record = np.zeros((len(inputs), len(plant.CHANNELS)))
    plants = {law: manoeuvres.build_plant(car, weave, p) for law, p in laws.items()}
    rest = {law: plant.initial_state(p) for law, p in plants.items()}
    runs: dict[str, list[int]] = {law: [] for law in laws}
    with _no_garbage_collection():
        for _ in range(3 * REPEATS):
            for law, p in plants.items():
                runs[law].append(_time(plant.run, p, rest[law].copy(), inputs, record, 1))
    return {law: float(np.median(times)) / len(inputs) for law, times in runs.items()}


def usable_step(rows: list[Row], scheme: str) -> float | None:
    """Longest step up to which a scheme is bounded and within ``USABLE`` [s]; None if no step is."""
    longest = None
    for row in sorted((row for row in rows if row.scheme == scheme), key=lambda row: row.step):
        if not row.bounded or row.error is None or row.error > USABLE:
            break
        longest = row.step
    return longest


def main(argv: Sequence[str] | None = None) -> None:
    """Print error, mean step and worst step of every law, scheme and step length."""
    parser = argparse.ArgumentParser(prog="steer-env study real-time", description=main.__doc__)
    laws = friction.available()
    text = f"default: {' '.join(laws)}"
    parser.add_argument("--friction", metavar="LAW", nargs="+", choices=laws, default=list(laws), help=text)
    chosen = {law: friction.make(law) for law in parser.parse_args(argv).friction}
    tables = timed({law: (p, accuracy(p)) for law, p in chosen.items()}, lambda _: None)
    width = 2 + max(map(len, chosen))
    print(f"{'law':{width}s}scheme          step [ms]  RMS error [%]  mean [ns]  worst [ns]")
    for law, rows in tables.items():
        for row in rows:
            found = f"{100.0 * row.error:13.4f}" if row.error is not None else f"{'not finite':>13s}"
            times = f"{row.ns_per_step:9.0f}  {row.worst_step_ns:10.0f}" if row.bounded else "  not bounded"
            print(f"{law:{width}s}{row.scheme:16s}{1e3 * row.step:9.1f}  {found}  {times}")
    print("\n1 ms of the whole car [ns]")
    for law, time in plant_samples(cars.load(), chosen).items():
        print(f"{law:{width}s}{time:6.0f}")
