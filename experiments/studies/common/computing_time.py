"""Computing times, measured in turns beside a bare loop that tells the load of the machine.

Every round runs each block once, of about a millisecond, every second round in the reverse order; a block whose ratio
is known closely drops out. A ratio is that of two blocks of one round, so that what slows the machine for longer than a
round slows both. Times are those of the processor in this thread, without the time in which other programs have it.
Before each block a bare loop of fixed arithmetic is timed too: where it waits for the processor for long, or its time
varies, times are not measurable.
"""

import gc
import math
import time
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from steer_env import friction, manoeuvres
from steer_env.experiments.studies.common.column_schemes import SCHEMES, arguments, default_case
from steer_env.friction import ode
from steer_env.friction.numerics.kernel import bind, kernel
from steer_env.vehicle import plant
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.eps import SAMPLE_TIME

K = TypeVar("K", bound=Hashable)

BASE = "lugre"  # the law over whose cost that of others is given
COLUMN, CAR = "column", "car"  # a step of the column alone, and a sample of the whole car, both of 1 ms
SCHEME = "midpoint"  # of the project
ROUNDS, LEAST_ROUNDS = 200, 30
NARROW = 0.03  # interval of a ratio over the ratio, with which there are rounds enough, assumed [1]
MOST_SECONDS = 20.0  # after which no round begins, unless there are too few [s]
BLOCK_NS = 1e6  # length of a block [ns]
BARE_STEPS = 50_000  # of the bare loop, some tenths of a millisecond
LATE = 90.0  # percentile beside the median [%]
CHEAP = 0.01  # a step that takes a smaller part of real time counts as cheap; assumed [1]
# What still counts as measurable. A program that takes turns with the blocks on their processor leaves ratios as they
# are. One that shares its core, on a virtual machine not even seen, does not: Masing's over LuGre's was 0.31 or 0.37
# for the column and 0.73 or 0.84 for the car, for seconds at a time, with intervals of 1 to 2 % and a quiet bare loop.
MOST_WAITING = 0.5  # share of the time that the bare loop waits for the processor [1]
MOST_SPREAD = 0.3  # of the bare loop between its percentiles of 10 and 90, over the lower one, assumed [1]
WIDEST = 0.1  # interval of a ratio over the ratio, assumed [1]


class Estimate(NamedTuple):
    """A time of a step [ns], or a ratio of two [1], over the blocks."""

    median: float  # [ns] or [1]
    low: float  # of the 95 % interval of the median
    high: float  # of the same interval
    late: float  # nine blocks of ten are at most this


class Load(NamedTuple):
    """What disturbs the measurement, most of it told by the bare loop."""

    waiting: float  # share of its time in which the processor did something else [1]
    spread: float  # of its time between the percentiles of 10 and 90, over the lower one [1]
    width: float  # the widest interval of a ratio of the blocks, over the ratio [1]

    @property
    def small(self) -> bool:
        """Whether times mean something beside this load."""
        return self.waiting <= MOST_WAITING and self.spread <= MOST_SPREAD and self.width <= WIDEST


class Block(NamedTuple):
    """What is timed as a whole."""

    run: Callable[[], Any]
    steps: int


class Cost(NamedTuple):
    """Time of a step [ns], and its ratio to that of the base [1]."""

    ns: Estimate
    ratio: Estimate


@dataclass(frozen=True)  # a named tuple of a generic type needs Python 3.11
class Measured(Generic[K]):
    """Costs by block; none where they are not measurable now."""

    load: Load
    costs: dict[K, Cost]

    @property
    def measurable(self) -> bool:
        """Whether there are costs."""
        return bool(self.costs)


# Time of the processor in this thread, where the system tells it finely enough.
THREAD_CLOCK = time.thread_time_ns if time.get_clock_info("thread_time").resolution < 1e-6 else time.perf_counter_ns


class Clocks(NamedTuple):
    """The clocks, which a test replaces [ns]."""

    wall: Callable[[], int] = time.perf_counter_ns
    own: Callable[[], int] = THREAD_CLOCK


def estimate(values: Sequence[float]) -> Estimate:
    """Median with its 95 % interval, by the order of the values and no other assumption."""
    ordered = np.sort(values)
    n = ordered.size
    outer = max(math.floor(0.5 * (n - 1.96 * math.sqrt(n))) - 1, 0)
    late = float(np.percentile(ordered, LATE))
    return Estimate(float(np.median(ordered)), float(ordered[outer]), float(ordered[n - 1 - outer]), late)


def in_turns(
    blocks: Mapping[K, Block],
    base: Callable[[K], K],
    notify: Callable[[float], None] = lambda part: None,
    clocks: Clocks = Clocks(),  # noqa: B008
    bare: Callable[[], Any] | None = None,
) -> Measured[K]:
    """Time blocks in turns.

    Parameters
    ----------
    blocks : mapping
        Name -> block, which does the same in every run.
    base : callable
        Name -> name of the block over whose time the ratio is.
    notify : callable
        Gets the part that is done.
    clocks : Clocks
    bare : callable, optional
        The bare loop.
    """
    bare = bare or _bare_loop()
    times: dict[K, list[float]] = {name: [] for name in blocks}
    beside, waited = [], 0
    for block in blocks.values():
        block.run()
    start, left = clocks.wall(), list(blocks)
    with no_garbage_collection():
        for i in range(ROUNDS):
            for name in left[:: -1 if i % 2 else 1]:
                before = clocks.wall()
                beside.append(_time(bare, clocks.own))
                waited += clocks.wall() - before
                times[name].append(_time(blocks[name].run, clocks.own) / blocks[name].steps)
            spent = 1e-9 * (clocks.wall() - start) / MOST_SECONDS
            notify(min(max((i + 1) / ROUNDS, spent), 1.0))
            if spent >= 1.0 and i + 1 >= LEAST_ROUNDS:
                break
            if (i + 1) % LEAST_ROUNDS == 0:  # what is known closely needs no more rounds, nor what nothing needs
                wide = [name for name, cost in _costs(times, base).items() if _width(cost) > NARROW]
                left = [name for name in left if name in wide or name in map(base, wide)]
    quick, slow = np.percentile(beside, (100.0 - LATE, LATE))
    costs = _costs(times, base)
    width = max(map(_width, costs.values()))
    load = Load(max(1.0 - sum(beside) / waited, 0.0), float(slow / quick - 1.0), width)
    return Measured(load, costs if load.small else {})


def _costs(times: Mapping[K, Sequence[float]], base: Callable[[K], K]) -> dict[K, Cost]:
    return {
        name: Cost(estimate(of), estimate([x / y for x, y in zip(of, times[base(name)])])) for name, of in times.items()
    }


def _width(cost: Cost) -> float:
    """The interval of a ratio, over the ratio [1]."""
    return (cost.ratio.high - cost.ratio.low) / cost.ratio.median


class Times(NamedTuple):
    """Cost of laws, of a step of the column by the project's scheme and of a sample of the car."""

    measured: Measured[tuple[str, str]]  # law, COLUMN or CAR
    integrated: frozenset[str]  # laws that give their equation alone, which are integrated numerically

    @property
    def measurable(self) -> bool:
        """Whether there are costs."""
        return self.measured.measurable

    @property
    def load(self) -> Load:
        """What disturbed the measurement."""
        return self.measured.load

    def of(self, law: str, what: str = COLUMN) -> Cost:
        """Cost of a law; KeyError where nothing was measurable."""
        return self.measured.costs[law, what]

    def ordered(self, laws: Iterable[str]) -> list[str]:
        """Laws by what a step of the column costs, the cheapest first; none where that is not measurable."""
        return sorted(laws, key=lambda law: self.of(law).ns.median) if self.measurable else []

    def share(self, law: str) -> float:
        """Part of real time that a step of the column takes, in nine blocks of ten [1]."""
        return 1e-9 * self.of(law).ns.late / SAMPLE_TIME

    def cheap(self, law: str) -> bool:
        """Whether a step of the column takes a small part of real time."""
        return self.share(law) < CHEAP

    def as_json(self) -> dict[str, Any]:
        """The numbers, without times where they are not measurable."""
        found = {
            law: {what: {"ns": ns._asdict(), "over_base": ratio._asdict()} for what, (ns, ratio) in of.items()}
            for law, of in self._by_law().items()
        }
        return {
            "case": "a step of 1 ms: column alone, hand torque 2.5 N m at 0.5 Hz; car in the weave",
            "measurable": self.measurable,
            "disturbance": self.load._asdict(),
            "base": BASE,
            "costs": found,
            "integrated": sorted(self.integrated),
        }

    def _by_law(self) -> dict[str, dict[str, Cost]]:
        laws: dict[str, dict[str, Cost]] = {}
        for (law, what), cost in self.measured.costs.items():
            laws.setdefault(law, {})[what] = cost
        return laws


def of_laws(laws: Mapping[str, Any], car: Car, notify: Callable[[float], None] = lambda part: None) -> Times:
    """Measure what laws cost, label -> parameters, beside LuGre with its defaults where no law has that label."""
    every = {BASE: friction.make(BASE), **laws}
    blocks = {(law, COLUMN): _column(p) for law, p in every.items()}
    blocks |= _cars(car, every)
    integrated = frozenset(law for law, p in every.items() if type(p) in ode.EQUATIONS)
    return Times(in_turns(blocks, lambda name: (BASE, name[1]), notify), integrated)


def _column(p: Any) -> Block:
    """Cycles of the case, as many as fill a block."""
    case = default_case(p)
    *start, T1, K_road, h = arguments(case._replace(duration=1.0 / case.frequency), SCHEME, SAMPLE_TIME)
    states = [state for state in start if isinstance(state, np.ndarray)]

    def block(T1: Any) -> Block:
        every = (*start, T1, K_road, h, np.empty(T1.size), np.empty(T1.size))
        loop = bind(SCHEMES[SCHEME].loop, *every)

        def run() -> None:
            for state in states:
                state[:] = 0.0
            loop(*every)

        return Block(run, T1.size)

    once = block(T1)
    once.run()
    return block(np.tile(T1, max(round(BLOCK_NS / _time(once.run, THREAD_CLOCK)), 1)))


def _cars(car: Car, laws: Mapping[str, Any]) -> dict[tuple[str, str], Block]:
    """Two seconds of a weave; all plants read and write the same arrays."""
    weave = manoeuvres.make("weave")
    inputs = manoeuvres.inputs(weave, 0.25, 2.0)
    record = np.zeros((len(inputs), len(plant.CHANNELS)))

    def run(made: Any, rest: Any) -> None:
        plant.run(made, rest.copy(), inputs, record, 1)

    plants = {law: manoeuvres.build_plant(car, weave, p) for law, p in laws.items()}
    return {(law, CAR): Block(partial(run, p, plant.initial_state(p)), len(inputs)) for law, p in plants.items()}


@kernel
def _arithmetic(steps):
    x = 1.0
    for _ in range(steps):
        x = 0.5 * x + 1.0
    return x


def _bare_loop() -> Callable[[], Any]:
    loop = bind(_arithmetic, BARE_STEPS)
    loop(BARE_STEPS)
    return lambda: loop(BARE_STEPS)


def _time(run: Callable[[], Any], clock: Callable[[], int]) -> int:
    start = clock()
    run()
    return clock() - start


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """A context in which nothing is collected, as that would fall on whatever runs just then."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
