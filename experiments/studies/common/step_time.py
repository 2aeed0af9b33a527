"""Time and memory of steps: environments of this project beside others, and the plant beside its friction law.

Every run is of about a millisecond and returns the time of a step by the clock on the wall, without that of resets.
Runs take turns in rounds, every second one in the reverse order; a ratio is that of two runs of one round, so that what
slows the machine for longer than a round slows both, and what is told is the median over the rounds.

``steer-env bench`` prints them.
"""

import gc
import math
import os
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import gymnasium as gym
import numpy as np

from steer_env import manoeuvres
from steer_env.experiments.studies.common.computing_time import BLOCK_NS, Estimate, estimate, no_garbage_collection
from steer_env.friction import law, make
from steer_env.friction.numerics.kernel import kernel
from steer_env.registration import id_of
from steer_env.vehicle import cars, plant
from steer_env.vehicle.chassis.common.interface import HAND, HAND_SPEED, derivative
from steer_env.vehicle.layout import layout_in_kernels
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Key = TypeVar("Key")
Run = Callable[[], float]  # the time of a step [s]

CART = "CartPole-v1"  # of Gymnasium, over whose step ratios are
TASK = "AssistWeave"
CONTROL = 0.01  # control step of the environments, ten steps of the plant [s]
ROW_COUNTS, THREAD_COUNTS = (1, 16, 256, 4096), (1, 2)
OWN_FRICTION, TIMED_LAWS = "own friction", ("lugre", "masing", "coulomb")
SHARED_ROWS = (1, 8, 32, 256)  # of which the share of the compiled call in a step is told
ROUNDS, LEAST_ROUNDS = 200, 10
FRICTION = "friction"  # the law alone, among the plants
ONE_TRACK = "single_track"  # over whose plant others are
AROUND_PLANT = "driver, observation, reward and infos"  # what a step has around the plant
# Beginning of an id -> the module that registers it.
PROVIDERS = {"steer_env/": "steer_env", "parking": "highway_env", "racetrack": "highway_env"}
SINGLE = 32  # environments that are made to tell the memory of one
FIRST_STEP = (
    "import time, gymnasium{imports}; "
    "e = gymnasium.make({name!r}{arguments}); e.reset(seed=0); e.step(e.action_space.sample()); "
    "print(time.process_time())"
)


class Case(NamedTuple):
    """What is timed: an environment, single or vector, and how it is stepped."""

    program: str
    what: str
    rows: int
    threads: int
    make: Callable[[int], Any]  # of a number of rows
    action: Callable[[int], Any]

    @property
    def label(self) -> str:
        """The case in words, without rows and threads."""
        return f"{self.program}, {self.what}"


class Time(NamedTuple):
    """Time of a step of one row."""

    case: Case
    seconds: Estimate  # [s]
    ratio: Estimate  # over a step of ``CART`` [1]
    bytes_a_row: float  # memory of a row; NaN where it is not told


class PlantTime(NamedTuple):
    """Time of 1 ms of a plant, or of an evaluation of a right-hand side."""

    name: str
    seconds: Estimate  # [s]
    ratio: Estimate  # over 1 ms of the car on one track [1]


class Share(NamedTuple):
    """What a part takes of a step of this project's environment on a chassis."""

    chassis: str
    name: str
    share: Estimate  # [1]


class Compiled(NamedTuple):
    """What the compiled call takes of a step of a vector environment in one thread."""

    rows: int
    share: Estimate  # [1]


class Start(NamedTuple):
    """Time of a new process until the end of its first step [s]."""

    name: str
    cold: float  # with an empty cache of compiled code; NaN where nothing is compiled [s]
    warm: float  # [s]


class Results(NamedTuple):
    """All that the page shows."""

    times: list[Time]
    plants: list[PlantTime]
    shares: list[Share]
    compiled: list[Compiled]
    starts: list[Start]
    notes: list[str]  # what is not installed


def in_turns(
    runs: Mapping[Key, Run],
    rounds: int = ROUNDS,
    most: float = math.inf,
    notify: Callable[[float], None] = lambda part: None,
) -> dict[Key, list[float]]:
    """Times of runs in alternating rounds [s], until ``rounds`` or, after a few of them, ``most`` seconds are over."""
    times: dict[Key, list[float]] = {key: [] for key in runs}
    start = time.perf_counter()
    with no_garbage_collection():
        for i in range(rounds):
            for key in list(runs)[:: -1 if i % 2 else 1]:
                times[key].append(runs[key]())
            spent = (time.perf_counter() - start) / most
            notify(min(max((i + 1) / rounds, spent), 1.0))
            if i + 1 >= LEAST_ROUNDS and spent > 1.0:
                break
    return times


def ratios_to_base(times: Mapping[Key, list[float]], base: Key) -> dict[Key, Estimate]:
    """Ratios of the times to those of the base in the same round [1]."""
    return {key: estimate([x / y for x, y in zip(of, times[base])]) for key, of in times.items()}


def _steps(env: Any, action: Any, rows: int, steps: int) -> float:
    """Time of a step of one row [s]; a single environment is reset where its episode ends, which does not count."""
    spent, start = 0.0, time.perf_counter()
    for _ in range(steps):
        _, _, terminated, truncated, _ = env.step(action)
        if rows == 1 and not hasattr(env, "num_envs") and (terminated or truncated):
            spent += time.perf_counter() - start
            env.reset()
            start = time.perf_counter()
    return (spent + time.perf_counter() - start) / (steps * rows)


def make_run(env: Any, action: Any, rows: int) -> Run:
    """A run of as many steps of an environment as take about a millisecond."""
    env.reset(seed=0) if not _is_pool(env) else env.reset()
    first = min(_steps(env, action, rows, 5) for _ in range(3))
    return partial(_steps, env, action, rows, max(round(1e-9 * BLOCK_NS / (first * rows)), 1))


def _is_pool(env: Any) -> bool:
    return type(env).__module__.startswith("envpool")


def _zeros(n: int) -> Any:
    return np.zeros((n, 1), np.float32) if n > 1 else np.array([0.02], np.float32)


def cases(quick: bool = False) -> tuple[list[Case], list[str]]:
    """All environments, or a few of them, and a note for each package that is not installed."""
    rows, laws = (ROW_COUNTS[::3], ()) if quick else (ROW_COUNTS, TIMED_LAWS)
    others, notes = other_cases(rows)
    return [*others, *own_cases(rows, laws)], notes


def own_cases(rows: Sequence[int], laws: Iterable[str], threads: Iterable[int] = THREAD_COUNTS) -> list[Case]:
    """This project's environment: single by chassis and friction, and vector with rows and threads.

    ``OWN_FRICTION`` is the friction of the car, which has three sites; each of ``TIMED_LAWS`` is at one.
    """
    name, found = id_of(TASK), list[Case]()

    def single(what: str, **arguments: Any) -> Case:
        return Case("steer-env", what, 1, 1, lambda n: gym.make(name, control_dt=CONTROL, **arguments), _zeros)

    def vector(what: str, n: int, count: int, **arguments: Any) -> Case:
        made = partial(gym.make_vec, name, vectorization_mode="vector_entry_point", control_dt=CONTROL, threads=count)
        return Case("steer-env", what, n, count, lambda rows: made(rows, **arguments), lambda n: np.zeros((n, 1), "f4"))

    for chassis in cars.SPEEDS:
        found += [single(f"{OWN_FRICTION}, {chassis}", chassis=chassis)]
        found += [single(f"{friction}, {chassis}", chassis=chassis, friction=friction) for friction in laws]
        found.append(single(f"{OWN_FRICTION}, {chassis}, no infos", chassis=chassis, info_level="none"))
    for chassis in cars.SPEEDS:
        for count in threads:
            found += [
                vector(f"{OWN_FRICTION}, {chassis}, vector", n, count, chassis=chassis)
                for n in rows
                if n > 1 or count == 1
            ]
            found += [
                vector(f"{friction}, {chassis}, vector", rows[-1], count, chassis=chassis, friction=friction)
                for friction in laws
                if friction == TIMED_LAWS[0]
            ]
    return found


def other_cases(rows: Iterable[int], threads: Iterable[int] = THREAD_COUNTS) -> tuple[list[Case], list[str]]:
    """Environments of others, and a note for each package that is not installed."""
    found = [
        Case("Gymnasium", CART, 1, 1, lambda n: gym.make(CART), lambda n: 1),
        Case("Gymnasium", "Pendulum-v1", 1, 1, lambda n: gym.make("Pendulum-v1"), _zeros),
    ]
    notes = []
    if find_spec("envpool"):
        import envpool

        for count in threads:
            made = partial(_pool, envpool, count)
            found += [
                Case("EnvPool", "Pendulum-v1, vector", n, count, made, _pool_zeros) for n in rows if n > 1 or count == 1
            ]
    else:
        notes.append("EnvPool is not installed")
    if find_spec("highway_env"):
        import highway_env

        gym.register_envs(highway_env)
        for scene in ("parking", "racetrack"):
            found.append(_highway(_newest(scene)))
    else:
        notes.append("highway-env is not installed")
    if not find_spec("vehiclemodels"):
        notes.append("commonroad-vehicle-models is not installed")
    return found, notes


def _highway(name: str) -> Case:
    """An environment of highway-env without an action."""
    with gym.make(name) as env:
        action = np.zeros(env.action_space.shape or (), np.float32)
    return Case("highway-env", name, 1, 1, lambda n: gym.make(name), lambda n: action)


def _pool(envpool: Any, threads: int, n: int) -> Any:
    return envpool.make("Pendulum-v1", env_type="gymnasium", num_threads=threads, num_envs=n)


def _pool_zeros(n: int) -> Any:
    return np.zeros((n, 1), np.float32)


def _newest(name: str) -> str:
    """The registered id of the newest version."""
    version = max(spec.version or 0 for spec in gym.registry.values() if spec.name == name)
    return f"{name}-v{version}"


def measure(
    given: Iterable[Case], most: float, notify: Callable[[float], None] = lambda part: None
) -> tuple[list[Time], list[PlantTime], list[Share], list[Compiled]]:
    """Time cases, plants, their parts and right-hand sides in turns for some seconds; with the memory of a row.

    One of the cases is that of ``CART``.
    """
    memory, runs, envs = dict[Case, float](), dict[Case | str, Run](), []
    for case in given:
        memory[case] = _memory(case)
        envs.append(env := case.make(case.rows))
        runs[case] = make_run(env, case.action(case.rows), case.rows)
    whole, alone, foreign = plants(), parts(), right_hand_sides()
    times = in_turns({**runs, **whole, **alone, **foreign}, most=most, notify=notify)
    for env in envs:
        env.close()
    (base,) = (case for case in memory if case.what == CART)
    of_base, of_plant = ratios_to_base(times, base), ratios_to_base(times, ONE_TRACK)
    return (
        [Time(case, estimate(times[case]), of_base[case], memory[case]) for case in memory],
        [PlantTime(name, estimate(times[name]), of_plant[name]) for name in (*whole, *foreign)],
        _shares(times),
        [Compiled(rows, estimate(compiled_shares(rows))) for rows in SHARED_ROWS],
    )


def _shares(times: Mapping[Case | str, list[float]]) -> list[Share]:
    """What the parts of the plant, the rest of it and what is around it take of a step, by chassis."""
    found = []
    for chassis in cars.SPEEDS:
        step = next(
            (of for case, of in times.items() if getattr(case, "what", "") == f"{OWN_FRICTION}, {chassis}"), None
        )
        if step is None:
            continue
        plants = CONTROL / SAMPLE_TIME * np.array(times[chassis])
        each = {name: CONTROL / SAMPLE_TIME * np.array(times[f"{chassis}, {name}"]) for name in PLANT_PARTS}
        each["rest of the plant"] = plants - sum(each.values())
        each[AROUND_PLANT] = np.array(step) - plants
        found += [Share(chassis, name, estimate(list(of / step))) for name, of in each.items()]
    return found


def compiled_shares(rows: int, rounds: int = ROUNDS) -> list[float]:
    """Shares of the compiled call in the steps of a vector environment, one for each run, with resets [1]."""
    env = gym.make_vec(id_of(TASK), rows, vectorization_mode="vector_entry_point", control_dt=CONTROL, threads=1)
    batch: Any = env.unwrapped.batch  # type: ignore[attr-defined]
    step, within = batch.step, [0.0]

    def timed(*arguments: Any) -> Any:
        start = time.perf_counter()
        found = step(*arguments)
        within[0] += time.perf_counter() - start
        return found

    batch.step = timed
    env.reset(seed=0)
    action, steps, found = np.zeros((rows, 1), np.float32), max(64 // rows, 1), list[float]()
    with no_garbage_collection():
        for _ in range(rounds):
            within[0] = 0.0
            whole = rows * steps * _steps(env, action, rows, steps)
            found.append(within[0] / whole)
    env.close()
    return found


def _resident() -> int:
    """Memory of this process that is in use, on Linux [bytes]."""
    return int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1]) * os.sysconf("SC_PAGE_SIZE")


def _memory(case: Case) -> float:
    """What a row takes that has made a step, beyond the first [bytes]; NaN for few rows, and without Linux for many."""
    if 1 < case.rows < ROW_COUNTS[-1] or (case.rows == 1 and case.what.endswith("vector")):
        return math.nan
    if case.rows > 1 and sys.platform != "linux":
        return math.nan
    count, single = (SINGLE, True) if case.rows == 1 else (1, False)

    def made(rows: int) -> Any:
        env = case.make(rows)
        env.reset()
        env.step(case.action(rows))
        return env

    kept = [made(1)]  # with what all of them share
    gc.collect()
    # Small pieces take memory that was freed before, so that the process does not grow by them.
    with _allocated_bytes() if single else nullcontext(_resident) as used:
        before = used()
        kept += [made(case.rows) for _ in range(count)]
        grown = (used() - before) / (count * case.rows)
    for env in kept:
        env.close()
    return max(grown, 0.0)


@contextmanager
def _allocated_bytes() -> Iterator[Callable[[], int]]:
    """What Python and numpy have allocated since, and hold [bytes]."""
    tracemalloc.start()
    try:
        yield lambda: tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()


def ratios(cases: Iterable[tuple[str, str]], rounds: int = ROUNDS) -> dict[tuple[str, str], float]:
    """Time of 10 ms in driving environments over that of a step of CartPole-v1, medians over rounds.

    A case is an id and an ``info_level``. All environments are those of ``gymnasium.make``, with its wrappers.
    """
    runs: dict[tuple[str, str], Run] = {(CART, ""): make_run(gym.make(CART), 1, 1)}
    for name, level in cases:
        runs[name, level] = make_run(gym.make(name, control_dt=CONTROL, info_level=level), _zeros(1), 1)
    return {case: found.median for case, found in ratios_to_base(in_turns(runs, rounds), (CART, "")).items() if case[1]}


def starts(given: Iterable[Case], cache: str) -> list[Start]:
    """The first step of this project's environment, cold and warm, and of single environments of others.

    ``cache`` is an empty folder.
    """
    names = [case.what for case in given if case.program in ("Gymnasium", "highway-env")]
    own = id_of(TASK)
    found = []
    for chassis in cars.SPEEDS:
        cold, warm = (first_step(own, cache, chassis=chassis) for _ in range(2))
        found.append(Start(f"{own}, {chassis}", cold, warm))
    return [*found, *(Start(name, math.nan, first_step(name, cache)) for name in names)]


def as_json(found: Results) -> dict[str, Any]:
    """The numbers."""
    return {
        "control_step_s": CONTROL,
        "base": CART,
        "environments": [
            {
                "program": case.program,
                "what": case.what,
                "rows": case.rows,
                "threads": case.threads,
                "over_base": ratio._asdict(),
                "seconds_a_row": seconds._asdict(),
                "bytes_a_row": None if math.isnan(size) else size,
            }
            for case, seconds, ratio, size in found.times
        ],
        "plants": [
            {"name": name, "seconds": seconds._asdict(), "over_one_track": ratio._asdict()}
            for name, seconds, ratio in found.plants
        ],
        "shares_of_a_step": [
            {"chassis": chassis, "part": name, "share": share._asdict()} for chassis, name, share in found.shares
        ],
        "compiled_share_of_a_vector_step": {str(rows): share._asdict() for rows, share in found.compiled},
        "first_step_s": {
            name: {"cold": None if math.isnan(cold) else cold, "warm": warm} for name, cold, warm in found.starts
        },
        "notes": found.notes,
    }


def first_step(name: str, cache: str, **arguments: Any) -> float:
    """Processor time of a new process with this cache folder until the end of its first step, with all imports [s].

    On an idle machine it equals the wall time, as a single thread does all of the work.
    """
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    given = "".join(f", {key}={value!r}" for key, value in arguments.items())
    imports = "".join(f", {module}" for prefix, module in PROVIDERS.items() if name.startswith(prefix))
    code = FIRST_STEP.format(name=name, arguments=given, imports=imports)
    command = [sys.executable, "-W", "ignore", "-c", code]
    return float(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


@kernel
def _friction_alone(p, memory, w, steps):
    """LuGre's step equation in a loop, with the torques of the column in a weave."""
    for i in range(steps):
        w, _ = law.step(p, 1.0, memory, 100.0, 20.0 * math.sin(1e-3 * i), 1e-3, w)
    return w


@kernel
def _steering(p, state, inputs):
    """Assist and column with friction in a loop, under the rack force of a weave."""
    at = layout_in_kernels(p)
    for i in range(inputs.shape[0]):
        u = inputs[i]
        before, after = plant.sample(p, at, state, 27.8, 0.0)
        force = 500.0 * math.sin(1e-3 * i)
        plant.steer(p, at, state, u[HAND], u[HAND_SPEED], before, after, 0.0, force, SAMPLE_TIME)


@kernel
def _evaluation(p, state, inputs):
    """Evaluations of the chassis in a loop, where it is."""
    at = layout_in_kernels(p)
    for i in range(inputs.shape[0]):
        plant.evaluate(p, at, state, inputs[i], derivative)


@kernel
def _integration(p, state, inputs):
    """Steps of the chassis in a loop, so short that it stays where it is."""
    at = layout_in_kernels(p)
    for i in range(inputs.shape[0]):
        plant.roll(p, at, state, 0.5, inputs[i], 1e-12)


# Part of 1 ms of the plant -> its loop, and how often it is evaluated in it.
PLANT_PARTS: dict[str, tuple[Callable[[Any, Any, Any], None], float]] = {
    "assist, motor and column with friction": (_steering, 1.0),
    "tyres, suspension and body": (_evaluation, 1.0 / plant.STEPS_PER_CHASSIS_STEP),
    "integration of the chassis": (_integration, 1.0),
}


def plants(n: int = 2000) -> dict[str, Run]:
    """Runs of 1 ms of LuGre alone, of the plant with it at one site, and of that with the friction of the car.

    The plant does a weave at 100 km/h on one core.
    """
    p = make(TIMED_LAWS[0])
    memory = np.zeros(law.law_of(p).memory_size(p))
    loops: dict[str, Callable[[], Any]] = {FRICTION: lambda: _friction_alone(p, memory, 0.0, n)}
    for chassis in cars.SPEEDS:
        for name, given in ((chassis, None), (f"{chassis}, {TIMED_LAWS[0]}", p)):
            whole, state, u = _weave(chassis, given, n)
            row = np.zeros((1, len(plant.channels(whole))))
            loops[name] = partial(plant.run, whole, state, u, row, 1)
    return {name: partial(_time, loop, n) for name, loop in loops.items()}


def parts(n: int = 2000) -> dict[str, Run]:
    """Runs of the parts of 1 ms of the plant, each alone, by chassis."""
    found: dict[str, Run] = {}
    for chassis in cars.SPEEDS:
        for name, (loop, often) in PLANT_PARTS.items():
            whole, state, u = _weave(chassis, None, n)
            found[f"{chassis}, {name}"] = partial(_time, partial(loop, whole, state, u), n / often)
    return found


def _weave(chassis: str, friction: Any, n: int) -> tuple[plant.Plant, Any, Any]:
    """A plant of the default car in a weave, its state and the inputs of ``n`` samples."""
    weave = manoeuvres.make("weave")
    whole = manoeuvres.build_plant(cars.load(), replace(weave, chassis=chassis), friction)
    return plant.bound(whole), plant.initial_state(whole), manoeuvres.inputs(weave, 0.26, n * SAMPLE_TIME)


def right_hand_sides() -> dict[str, Run]:
    """Runs of one evaluation of CommonRoad's right-hand sides; none without its package."""
    if not find_spec("vehiclemodels"):
        return {}
    from vehiclemodels.init_mb import init_mb
    from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
    from vehiclemodels.vehicle_dynamics_st import vehicle_dynamics_st
    from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

    p, straight, u = setup_vehicle_parameters(vehicle_id=2), [0.0, 0.0, 0.01, 25.0, 0.0, 0.0, 0.0], [0.01, 0.0]
    found: dict[str, Run] = {}
    for name, f, x in (
        ("single track", vehicle_dynamics_st, straight),
        ("multi-body", vehicle_dynamics_mb, init_mb(straight, p)),
    ):
        n = 10

        def loop(f: Any = f, x: Any = x, n: int = n) -> None:
            for _ in range(n):
                f(x, u, p)

        found[f"CommonRoad, {name}"] = partial(_time, loop, n)
    return found


def _time(loop: Callable[[], Any], n: float) -> float:
    start = time.perf_counter()
    loop()
    return (time.perf_counter() - start) / n


def substeps(rounds: int = 100) -> dict[str, float]:
    """Time of a 1 ms step of the friction law alone and of the whole plant on each chassis, medians over rounds [s]."""
    return {name: estimate(of).median for name, of in in_turns(plants(), rounds).items()}
