"""The suite for assists: stable in every drive, or not; averages come after that.

An assist fails where the motion of the handwheel does not die out with free hands or with a driver's arms, where its
torque ripples in the hands, where a driver works far harder than without it, or where the car leaves its lane, spins or
rolls over. Where the car with its boost alone misses a limit, which a slow return does without any oscillation, the
assist may have ``WORSE`` times its measure; such rows are counted. A row in which the car fails with its boost alone is
excused.

    free swing, held swing  half the range of the handwheel angle over the last 2 s of the drive
    ripple                  rms hand torque above 10 Hz
    steering                rms handwheel speed over that with the boost alone

In the arms of a driver model, delay and friction leave a slow hunting, of some 2 deg with Coulomb's law and the boost
alone; unstable assists reach 4 to 20 deg at 1 Hz. The limits of the held swing and of the steering are assumed.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from scipy import signal

from steer_env import assists, tasks
from steer_env.engine.state import State
from steer_env.experiments.learning.assist_drives import DRIVE_KINDS, Drive, suite, task_of
from steer_env.experiments.learning.controllers import Maker
from steer_env.experiments.pages import provenance
from steer_env.experiments.sweep import Runner, run
from steer_env.tasks import Task
from steer_env.tasks.assist_release import RETURN_ERRORS, wanted_return
from steer_env.tasks.common.definition import Quantity
from steer_env.vector import SteerVectorEnv
from steer_env.vehicle.cars import Car
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST

Array = NDArray[np.float64]

WORSE = 1.25  # factor on the boost's own measure that an assist may have where that misses a limit, assumed [1]
SEED = 4_000_000  # first of the rows' episodes; apart from those of training, search and evaluations
WINDOW = 2.0  # over which the handwheel's swing is read [s]
RIPPLE_FREQUENCY = 10.0  # above which the hands feel a torque as ripple [Hz]


class Record(NamedTuple):
    """What a drive gives."""

    angle: Array  # (T, n) of the handwheel at every control step, NaN after an episode's end [rad]
    torque: Array  # (T, n) of the hands [N m]
    speed: Array  # (T, n) of the handwheel [rad/s]
    failed: NDArray[np.bool_]  # (n,) whether the car left its lane, spun and so on
    dt: float  # control step [s]


class Result(NamedTuple):
    """A line of the table: one condition of one drive."""

    drive: str
    condition: str
    # Where the boost alone misses the limit, ``worst`` is the limit times the ratio to what is allowed there.
    worst: float  # infinite after a failure, NaN if every row is excused [unit]
    at: str  # where the worst is, in words
    limit: float  # [unit]
    unit: str
    holds: bool
    beyond: int  # rows in which the car with its boost alone misses the limit, and the assist is held against that
    excused: int  # rows in which the car fails with its boost alone
    rows: int


def _swing(found: Record) -> Array:
    return 0.5 * np.degrees(np.ptp(found.angle[-round(WINDOW / found.dt) :], axis=0))


def _ripple(found: Record) -> Array:
    high = signal.butter(4, RIPPLE_FREQUENCY, "high", fs=1.0 / found.dt, output="sos")
    return np.std(signal.sosfiltfilt(high, found.torque, axis=0), axis=0)


def _steering(found: Record) -> Array:
    return np.sqrt(np.nanmean(found.speed**2, axis=0))


class Judge(NamedTuple):
    """How a drive is judged."""

    measure: Callable[[Record], Array]  # (n,) from a record
    limit: float  # [unit]
    unit: str
    relative: bool = False  # to the boost alone


JUDGES = {
    "free swing": Judge(_swing, 0.5, "deg"),
    "held swing": Judge(_swing, 4.0, "deg"),
    "ripple": Judge(_ripple, 0.05, "N m"),
    "steering": Judge(_steering, 1.5, "1", relative=True),
}


class ObservedEnv(NamedTuple):
    """The environment of a drive as a controller of an id sees it: with the observations of that id."""

    spec: Any
    task: Task
    n: int
    observed: tuple[Quantity, ...]
    observation_scale: Array  # (O,) SI value of an observation of 1: ones
    control_dt: float  # [s]
    car: Car

    @property
    def unwrapped(self) -> "ObservedEnv":
        """Itself: there is no wrapper."""
        return self

    @property
    def batch(self) -> "ObservedEnv":
        """Itself: controllers look here for what the rows share."""
        return self


_environments: dict[tuple[str, str, str], tuple[SteerVectorEnv, State]] = {}


def _environment(drive: Drive, home: Task) -> tuple[SteerVectorEnv, State]:
    """The environment of a drive with the action of a task, and its state at the start; made once."""
    key = drive.kind, repr((drive.arguments, drive.rows)), repr(home.action)
    if key not in _environments:
        task, n = task_of(drive.kind, home), len(drive.rows)
        env: Any = type(task.name, (SteerVectorEnv,), {"task": task})(n, normalise=False, **drive.arguments)
        for i, row in enumerate(drive.rows):
            env.reset(seed=SEED, options={"speed": row.speed / 3.6, **row.options, "reset_mask": np.arange(n) == i})
        _environments[key] = env, env.get_state()
    return _environments[key]


def task_named(env_id: str) -> Task:
    """The assist task of an id; ValueError for another id."""
    name = env_id.removeprefix("steer_env/").rpartition("-")[0]
    if name not in tasks.available() or tasks.task(name).action.input != ASSIST_REQUEST:
        known = [each for each in tasks.available() if tasks.task(each).action.input == ASSIST_REQUEST]
        raise ValueError(f"the suite judges assists, for the tasks {', '.join(known)}; got {env_id!r}")
    return tasks.task(name)


def _returns(held: Array, since: Array) -> Array:
    """Wanted angles [rad] and speeds [rad/s] (2, n) of releases."""
    return np.array([wanted_return(angle, max(time, 0.0)) for angle, time in zip(held, since)]).T


def _tell_release(observation: Array, names: list[str], held: Array, since: Array) -> None:
    """Write what an id observes of a release, ``since`` (n,) seconds ago at handwheel angles ``held`` (n,) [rad]."""
    released = since >= 0.0
    if "released" in names:
        observation[:, names.index("released")] = released
    for name, of, wanted in zip(RETURN_ERRORS, ("handwheel_angle", "handwheel_speed"), _returns(held, since)):
        if name in names:
            error = wanted - observation[:, names.index(of)]
            observation[:, names.index(name)] = np.where(released, error, 0.0)


def drive_rows(drive: Drive, make: Maker, env_id: str) -> Record:
    """Drive a controller of an id through all rows of a drive."""
    home = task_named(env_id)
    env, start = _environment(drive, home)
    env.set_state(start)
    n, names, wanted = env.num_envs, *([q.name for q in of] for of in (env.batch.observed, home.observed))
    # What the drive does not observe is zero: a straight path, and hands that hold the handwheel until they let go.
    places = np.array([names.index(name) if name in names else len(names) for name in wanted])
    controller = make(
        ObservedEnv(gym.spec(env_id), home, n, home.observed, np.ones(len(wanted)), env.control_dt, env.batch.car)
    )
    controller.reset()
    seen, free = np.zeros((n, len(names) + 1)), round(DRIVE_KINDS[drive.kind].released / env.control_dt, 6)
    late = np.array([round(row.options.get("delay", 0.0) / env.control_dt) for row in drive.rows])
    held = np.zeros(n)  # handwheel angle at the release
    rows: list[list[Array]] = []
    failed, going = np.zeros(n, bool), np.ones(n, bool)
    seen[:, :-1] = start.observations
    while going.any():
        observation = seen[:, places]
        _tell_release(observation, wanted, held, (len(rows) - late - free) * env.control_dt)
        action = controller.act(observation.astype(np.float32))
        seen[:, :-1], _, terminated, truncated, info = env.step(action)
        if len(rows) < free:
            held = info["handwheel_angle"].copy()
        rows.append([np.where(going, info[f"handwheel_{name}"], np.nan) for name in ("angle", "torque", "speed")])
        failed |= going & (info["failure"] > 0)
        going &= ~(terminated | truncated)
    angle, torque, speed = np.moveaxis(np.array(rows), 1, 0)
    return Record(angle, torque, speed, failed, env.control_dt)


def measure_rows(drive: Drive, make: Maker, env_id: str) -> Array:
    """The measure (n,) of every row of a drive, infinite after a failure."""
    found = drive_rows(drive, make, env_id)
    values = np.full(len(drive.rows), np.inf)
    whole = ~found.failed
    kept = found._replace(**{name: getattr(found, name)[:, whole] for name in ("angle", "torque", "speed")})
    values[whole] = JUDGES[DRIVE_KINDS[drive.kind].judge].measure(kept)
    return values


_boost_measures: dict[tuple[str, str, str], Array] = {}


def _boost_alone(drive: Drive, env_id: str) -> Array:
    """The measure of every row with the boost alone; driven once."""
    key = env_id, drive.kind, repr((drive.arguments, drive.rows))
    if key not in _boost_measures:
        _boost_measures[key] = measure_rows(drive, partial(assists.make, "boost"), env_id)
    return _boost_measures[key]


def judge(drive: Drive, make: Maker, env_id: str) -> list[Result]:
    """A result for every condition of a drive."""
    by = JUDGES[DRIVE_KINDS[drive.kind].judge]
    values, alone = measure_rows(drive, make, env_id), _boost_alone(drive, env_id)
    excused = ~np.isfinite(alone)
    beyond = np.zeros(alone.size, bool) if by.relative else ~excused & (alone > by.limit)
    if by.relative:
        values = values / np.where(excused, np.nan, alone)
    values = np.where(beyond, values / np.where(beyond, WORSE * alone, 1.0) * by.limit, values)
    results = []
    for variant in dict.fromkeys(row.variant for row in drive.rows):
        of = np.array([row.variant == variant for row in drive.rows])
        judged = np.flatnonzero(of & ~excused)
        place = max(judged.tolist(), key=lambda i: values[i], default=None)
        worst, at = (np.nan, "") if place is None else (float(values[place]), drive.rows[place].place)
        holds, condition = not worst > by.limit, f"{drive.condition}, {variant}"
        counts = int((of & beyond).sum()), int((of & excused).sum()), int(of.sum())
        results.append(Result(drive.kind, condition, worst, at, by.limit, by.unit, holds, *counts))
    return results


def examine(
    make: Maker,
    env_id: str,
    to_first_failure: bool = False,
    notify: Callable[[float, str], None] = lambda *_: None,
    car: Car | None = None,
) -> list[Result]:
    """Drive a controller of an id through the suite.

    Parameters
    ----------
    make : env -> controller
        As in :mod:`steer_env.experiments.learning.held_out`. What it is given is not a whole environment: it has what
        baselines and policies read of one.
    env_id : str
        An assist task's, whose observations and action the controller has.
    to_first_failure : bool
        Stop after the first drive in which a condition fails.
    notify : (share, text) -> None
        Is told how far the suite is.
    car : Car, optional
        In place of the default car and the others of the suite.
    """
    drives, results = suite(task_named(env_id), car), []
    for k, drive in enumerate(drives):
        notify(k / len(drives), f"{drive.kind}, {drive.condition}")
        results += judge(drive, make, env_id)
        if to_first_failure and not all(result.holds for result in results):
            break
    return results


class Part(NamedTuple):
    """A drive of the suite that a worker drives controllers through."""

    env_id: str
    number: int  # of the drive
    makers: Mapping[str, Maker]
    car: Car | None  # of all drives, or None for those of the suite


def part(of: Part) -> dict[str, list[Result]]:
    """Results of a drive for every controller."""
    drive = suite(task_named(of.env_id), of.car)[of.number]
    return {name: judge(drive, make, of.env_id) for name, make in of.makers.items()}


def examine_all(
    makers: Mapping[str, Maker],
    env_id: str,
    notify: Callable[[float, str], None] = lambda *_: None,
    sweep: Runner = run,
    car: Car | None = None,
) -> dict[str, list[Result]]:
    """Drive several controllers of an id through the suite: their results by name, as of :func:`examine`."""
    drives = suite(task_named(env_id), car)
    parts = [Part(env_id, number, makers, car) for number in range(len(drives))]

    def words(of: Part) -> str:
        return f"{drives[of.number].kind}, {drives[of.number].condition}"

    found = sweep(part, parts, notify=notify, words=words)
    return {name: [result for each in found for result in each[name]] for name in makers}


def as_json(env_id: str, found: dict[str, list[Result]]) -> dict[str, Any]:
    """The results of controllers by name, as JSON; a failure's infinite value is null."""

    def line(result: Result) -> dict[str, Any]:
        return {**result._asdict(), "worst": result.worst if np.isfinite(result.worst) else None}

    return {
        "env": env_id,
        "first_seed": SEED,
        "controllers": {
            name: {"holds": all(r.holds for r in results), "results": [line(r) for r in results]}
            for name, results in found.items()
        },
        "provenance": provenance.versions(),
    }
