"""What a friction law costs in real time: error, bounds, mean and worst step for every scheme and step length.

One case stands for all: the default car's column under a sine of 2.5 N m of hand torque at 0.5 Hz for 4 s. Errors are
against :func:`experiments.integrators.reference`. Times are wall clock on the machine at hand: the mean step is the
median over repeats of a whole compiled run; the worst step is freed of what the operating system adds by repeating the
same deterministic run and keeping, for each step, the shortest time seen.
"""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter_ns
from typing import Any, NamedTuple

import numpy as np

from experiments.integrators import SCHEMES, Case, arguments, integrate, reference
from friction.kernel import bind, kernel
from steer_env import manoeuvres
from vehicle import column, plant
from vehicle.assist import SAMPLE_TIME
from vehicle.cars import Car

STEPS = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2)  # [s], whole multiples of the first
BLOWN_UP = 3.0  # a run counts as bounded while torque and speed stay below this many times their true peaks
USABLE = 0.01  # RMS error up to which a scheme counts as usable, of the friction torque's peak; assumed
REPEATS = 7
WORST_OVER = 2.0  # the worst step is sought in the first cycle [s]


class Row(NamedTuple):
    """One scheme at one step; times are None where the run does not stay bounded."""

    scheme: str
    step: float  # [s]
    error: float | None  # RMS, of the friction torque's peak [1]; None where not finite
    bounded: bool
    ns_per_step: float | None  # [ns]
    worst_step_ns: float | None  # [ns]


def default_case(p: Any) -> Case:
    """The case of the table for the parameters of a law; the column is the default car's."""
    return Case(column.make(), p, amplitude=2.5, frequency=0.5, duration=4.0)


def accuracy(p: Any, steps: tuple[float, ...] = STEPS) -> list[Row]:
    """Error and bounds of every scheme at every step, without times."""
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


def timed(p: Any, row: Row) -> Row:
    """The row with its times, if it is bounded."""
    if not row.bounded:
        return row
    case = default_case(p)
    return row._replace(
        ns_per_step=mean_step(case, row.scheme, row.step), worst_step_ns=worst_step(case, row.scheme, row.step)
    )


def mean_step(case: Case, scheme: str, h: float, repeats: int = REPEATS) -> float:
    """Time of a step within a compiled run [ns]; the call itself, timed with no steps to do, is taken off."""
    start = arguments(case, scheme, h)
    T_F, w = np.empty_like(start[5]), np.empty_like(start[5])
    loop = bind(SCHEMES[scheme].loop, *start, T_F, w)
    runs = []
    with _undisturbed():
        for _ in range(repeats):
            fresh = arguments(case, scheme, h)
            runs.append(_time(loop, *fresh, T_F, w) - _time(loop, *fresh, T_F[:0], w[:0]))
    return max(float(np.median(runs)), 0.0) / T_F.size


def worst_step(case: Case, scheme: str, h: float, repeats: int = REPEATS) -> float:
    """Time of the slowest step [ns]: the highest over the steps of the shortest over the repeats."""
    c, p, *_, T1, K_road, _ = arguments(case._replace(duration=WORST_OVER), scheme, h)
    torques = T1.tolist()
    shortest = np.full((2, T1.size), np.iinfo(np.int64).max)
    with _undisturbed():
        for kept, function in zip(shortest, (SCHEMES[scheme].step, _nothing)):
            for _ in range(repeats):
                _, _, q, memory, work, _, _, _ = arguments(case._replace(duration=h), scheme, h)
                step = bind(function, c, p, q, memory, work, torques[0], K_road, h)
                for i, torque in enumerate(torques):
                    kept[i] = min(kept[i], _time(step, c, p, q, memory, work, torque, K_road, h))
    return max(float(shortest[0].max() - np.median(shortest[1])), 0.0)


@kernel
def _nothing(c, p, q, memory, work, T1, K_road, h):
    """A step that does nothing: what calling one costs."""
    return 0.0, 0.0


def _time(function: Callable, *arguments: Any) -> int:
    start = perf_counter_ns()
    function(*arguments)
    return perf_counter_ns() - start


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Without the garbage collector."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def plant_sample(car: Car, p: Any, repeats: int = REPEATS) -> float:
    """Time that the whole car takes for one sample of 1 ms in a weave, driver to tyre [ns]."""
    weave = manoeuvres.weave()
    whole = manoeuvres.build_plant(car, weave, p)
    inputs = manoeuvres.inputs(weave, 0.25, 5.0)
    record = np.zeros((len(inputs), len(plant.CHANNELS)))
    rest = plant.initial_state(whole)
    with _undisturbed():
        runs = [_time(plant.run, whole, rest.copy(), inputs, record, 1) for _ in range(repeats)]
    return float(np.median(runs)) / len(inputs)


def usable_step(rows: list[Row], scheme: str) -> float | None:
    """Longest step up to which a scheme stays bounded and within ``USABLE`` [s]; None if it never is."""
    longest = None
    for row in sorted((row for row in rows if row.scheme == scheme), key=lambda row: row.step):
        if not row.bounded or row.error is None or row.error > USABLE:
            break
        longest = row.step
    return longest


def at(rows: list[Row], scheme: str = "midpoint", step: float = SAMPLE_TIME) -> Row:
    """The row of a scheme and step; ValueError if the table has none."""
    for row in rows:
        if row.scheme == scheme and row.step == step:
            return row
    raise ValueError(f"no row for {scheme} at {step:g} s")
