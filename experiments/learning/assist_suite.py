"""The suite for assists: stable in every drive, or not; averages come after that.

An assist fails where the motion of the handwheel does not die out with free hands or with a driver's arms, where its
torque ripples in the hands, where a driver works far harder than without it, or where the car departs, spins or rolls
over. A row in which the car with its boost alone misses the same limit is excused, and counted.

    swing     half the range of the handwheel angle over the last 2 s of the drive
    ripple    rms hand torque above 10 Hz
    effort    rms handwheel speed over that with the boost alone
"""

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from scipy import signal

from steer_env import assists, tasks
from steer_env.experiments.learning.assist_drives import KINDS, SEED, Drive, suite, task_of
from steer_env.experiments.learning.held_out import Controller
from steer_env.experiments.output import provenance
from steer_env.state import State
from steer_env.tasks import Task
from steer_env.tasks.common.definition import ASSIST_CHANNELS, Quantity
from steer_env.vector import SteerVectorEnv
from steer_env.vehicle import plant
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]
Maker = Callable[[Any], Controller]

WINDOW = 2.0  # over which the handwheel's swing is read [s]
RIPPLE_FREQUENCY = 10.0  # above which the hands feel a torque as ripple [Hz]
_RECORDED = ("handwheel_angle", "handwheel_torque", "handwheel_speed")


class Record(NamedTuple):
    """What a drive gives: (T, n) at every control step, and (n,) whether the car departed, spun and so on."""

    angle: Array  # handwheel [rad]
    torque: Array  # hands [N m]
    speed: Array  # handwheel [rad/s]
    failed: NDArray[np.bool_]
    dt: float  # [s]


class Result(NamedTuple):
    """A line of the table: one condition of one drive."""

    name: str  # of the drive
    condition: str
    worst: float  # infinite after a failure [unit]
    at: str  # where, in words
    limit: float  # [unit]
    unit: str
    holds: bool
    excused: int  # rows in which the boost alone misses the limit
    rows: int


def _swing(found: Record) -> Array:
    last = found.angle[-round(WINDOW / found.dt) :]
    return 0.5 * np.degrees(np.ptp(last, axis=0))


def _ripple(found: Record) -> Array:
    high = signal.butter(4, RIPPLE_FREQUENCY, "high", fs=1.0 / found.dt, output="sos")
    ripple: Array = np.std(signal.sosfiltfilt(high, np.nan_to_num(found.torque), axis=0), axis=0)
    return ripple


def _effort(found: Record) -> Array:
    rms: Array = np.sqrt(np.nanmean(found.speed**2, axis=0))
    return rms


class Judge(NamedTuple):
    """How a drive is judged."""

    measure: Callable[[Record], Array]  # (n,) from a record
    limit: float
    unit: str
    relative: bool = False  # to the boost alone


JUDGES = {
    "swing": Judge(_swing, 0.5, "deg"),
    "held swing": Judge(_swing, 2.0, "deg"),
    "ripple": Judge(_ripple, 0.05, "N m"),
    "effort": Judge(_effort, 1.5, "1", relative=True),
}


class Seen(NamedTuple):
    """A drive's environment as a controller of an id sees it: with the observations of that id."""

    spec: Any
    task: Task
    n: int
    observed: tuple[Quantity, ...]
    control_dt: float
    car: Car
    observation_scale: Array

    @property
    def unwrapped(self) -> "Seen":
        """Itself, as an environment without wrappers."""
        return self

    @property
    def batch(self) -> "Seen":
        """Itself, in which controllers find what the rows share."""
        return self


@cache
def _environment(drive: Drive, home: str) -> tuple[SteerVectorEnv, State]:
    """The environment of a drive for an id's action, and its state at the start."""
    task = task_of(drive.kind, tasks.task(home))
    kind = type(task.name, (SteerVectorEnv,), {"task": task})
    env = kind(len(drive.rows), **dict(drive.arguments))
    for i, row in enumerate(drive.rows):
        chosen = {"speed": row.speed / 3.6, **dict(row.options), "reset_mask": np.arange(len(drive.rows)) == i}
        env.reset(seed=SEED, options=chosen)
    return env, env.get_state()


def run(drive: Drive, make: Maker, env_id: str) -> Record:
    """Drive a controller of an id through all rows of a drive."""
    home = tasks.task(env_id.removeprefix("steer_env/").rpartition("-")[0])
    env, start = _environment(drive, home.name)
    env.set_state(start)
    n, names = env.num_envs, [quantity.name for quantity in env.batch.observed]
    wanted = [quantity.name for quantity in home.observed]
    # What the drive does not observe is zero: a straight path, and hands that hold on until they let go.
    places = np.array([names.index(name) if name in names else len(names) for name in wanted])
    controller = make(
        Seen(gym.spec(env_id), home, n, home.observed, env.control_dt, env.batch.car, np.ones(len(wanted)))
    )
    controller.reset()
    gains = np.array([[row.gain] for row in drive.rows])
    seen, rows = np.zeros((n, len(names) + 1), np.float32), []
    failed, going = np.zeros(n, bool), np.ones(n, bool)
    seen[:, :-1] = start.observations
    while going.any():
        observation = seen[:, places]
        if "released" in wanted:
            observation[:, wanted.index("released")] = len(rows) * env.control_dt >= KINDS[drive.kind].released
        action = np.clip(gains * controller.act(observation), -1.0, 1.0).astype(np.float32)
        seen[:, :-1], _, terminated, truncated, info = env.step(action)
        rows.append([np.where(going, info[name], np.nan) for name in _RECORDED])
        failed |= going & _failed(env, terminated)
        going &= ~(terminated | truncated)
    angle, torque, speed = np.moveaxis(np.array(rows), 1, 0)
    return Record(angle, torque, speed, failed, env.control_dt)


def _failed(env: SteerVectorEnv, terminated: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which rows have ended by a failure of the car or a departure."""
    task, observed = env.task, env.batch.arrays.task_observations
    failed = env.batch.episodes["failed"].copy()
    if task.driver_in_loop:
        failed |= terminated & (np.abs(observed[:, 0]) > task.parameters.half_width)
    return failed


@cache
def _unassisted(drive: Drive, env_id: str) -> tuple[float, ...]:
    """The measure of every row with the boost alone, infinite after a failure."""
    return tuple(measured(drive, partial(assists.make, "boost"), env_id))


def measured(drive: Drive, make: Maker, env_id: str) -> Array:
    """The measure (n,) of every row, infinite after a failure."""
    found = run(drive, make, env_id)
    return np.where(found.failed, np.inf, JUDGES[KINDS[drive.kind].judge].measure(found))


def judge(drive: Drive, make: Maker, env_id: str) -> list[Result]:
    """A result for every condition of a drive."""
    by = JUDGES[KINDS[drive.kind].judge]
    values, alone = measured(drive, make, env_id), np.array(_unassisted(drive, env_id))
    excused = ~np.isfinite(alone) if by.relative else ~(alone <= by.limit)
    if by.relative:
        values = values / alone
    results = []
    for variant in dict.fromkeys(row.variant for row in drive.rows):
        of = np.array([row.variant == variant for row in drive.rows])
        judged = np.flatnonzero(of & ~excused)
        worst = judged[np.argmax(values[judged])] if judged.size else -1
        value = float(values[worst]) if judged.size else np.nan
        results.append(
            Result(
                drive.kind,
                f"{drive.condition}, {variant}",
                value,
                drive.rows[worst].place if judged.size else "",
                by.limit,
                by.unit,
                not judged.size or value <= by.limit,
                int((of & excused).sum()),
                int(of.sum()),
            )
        )
    return results


def examine(
    make: Maker, env_id: str, drives: Sequence[Drive] | None = None, notify: Callable[[float, str], None] = lambda *_: None
) -> list[Result]:
    """Drive a controller of an id through the suite, or through some drives of it."""
    chosen = suite() if drives is None else drives
    results = []
    for k, drive in enumerate(chosen):
        notify(k / len(chosen), f"{drive.kind}, {drive.condition}")
        results += judge(drive, make, env_id)
    return results
