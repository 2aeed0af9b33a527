"""One factor of the friction at a time: the cases of the friction study, and what each changes in the test battery.

Every case is a change of one thing against the base of its factor: the law, its level, its pre-sliding distance, its
micro-damping, the step length, the site where friction acts, its level by load, direction or temperature, or the
assist. The base of most factors is LuGre with the default calibration.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from steer_env import drivers, friction, manoeuvres
from steer_env.experiments.studies.common import battery
from steer_env.experiments.studies.common.battery import MATTERS, Difference, Drive
from steer_env.experiments.studies.common.scaling import scale_record
from steer_env.friction import defaults
from steer_env.manoeuvres.common.driving import build_plant, drive_plant
from steer_env.metrics import Value
from steer_env.metrics.common import just_noticeable
from steer_env.metrics.common.filtered_channels import ANGLE, TORQUE
from steer_env.recording.recording import Recording
from steer_env.vehicle import step_limit
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.eps import SAMPLE_TIME, without_assist

Array = NDArray[np.float64]

BASE_LAW = "lugre"
LAW_FACTOR, MEASURED_LAW_FACTOR, UNASSISTED_LAW_FACTOR = "law", "law, measured calibration", "law, without assist"
LEVEL_FACTOR, PRESLIDING_FACTOR, DAMPING_FACTOR = "level", "pre-sliding distance", "micro-damping"
STEP_FACTOR, SITE_FACTOR, LOAD_FACTOR = "step length", "site", "load"
DIRECTION_FACTOR, POSITION_FACTOR, TEMPERATURE_FACTOR = "direction", "position", "temperature"
LEVELS = (2.0 / 3.0, 4.0 / 3.0)  # of the default F_c: 0.6 and 1.2 N m, within the preloads of workshop manuals
DISTANCES = (0.5, 2.0)  # of the default F_c/sigma_0: 0.26 and 1.03 deg; assumed
DAMPERS = (0.0, 0.25, 2.0)  # of the default sigma_1; the range of damping ratios is 0 to 0.9; assumed
ASYMMETRIES = (0.1, 0.3)  # of the friction's level by direction; assumed [1]
BY_POSITION = 0.2  # of the friction's level, largest in the middle; assumed [1]
ORDERS = ((2.0, "twice"), (8.0, "eight times"))  # in a turn of the column: a joint, a pinion of eight teeth; assumed
COLD, RATE = -30.0, 0.01  # temperature below that of the calibration [K], and decrease of friction by it [1/K]; assumed
SUBSTEPS = (2, 4)  # steps in a sample of 1 ms
COLUMN_FRICTION = 0.15  # above the torsion bar: column bearings and shaft, 0.1 to 0.2 N m; assumed [N m]
# A driver with arms in the loop, and a servo of the angle in the place of hands that park or go with the traffic.
DRIVER_TASKS = ("steer_env/AssistLaneKeeping-v3", "steer_env/AssistWeave-v3")
SERVO_TASKS = ("steer_env/DriverParking-v3", "steer_env/DriverStopAndGo-v0")
FRICTION_TESTS = ("parking", "release", "returnability", "hold")  # tests in which friction is most of what is felt


class Case(NamedTuple):
    """One change of the friction, or of what it acts in."""

    factor: str
    level: str  # what was changed, in words
    base: str  # label of the case that it is compared with; that of a base is its own
    friction: Any  # parameters of the law below the torsion bar
    above: Any = None  # parameters of a law above the torsion bar
    load: float = 1.0  # factor on the part of the friction that grows with the rack force [1]
    conditions: tuple[tuple[str, float], ...] = ()  # fields of steer_env.friction.level.Level and their values
    substeps: int = 1
    assist: bool = True

    @property
    def label(self) -> str:
        """Factor and level in words."""
        return f"{self.factor}: {self.level}"


def cases(laws: Mapping[str, Any], measured: Mapping[str, Any]) -> list[Case]:
    """Every case, with the base of each factor.

    Parameters
    ----------
    laws : name -> parameters
        With the calibration that the defaults share, LuGre among them.
    measured : name -> parameters
        Calibrated to one measured record, at the scale of the car; LuGre is the base of the others, else the first.
    """
    p = laws[BASE_LAW]
    base = f"{LAW_FACTOR}: {BASE_LAW}"
    found = [Case(LAW_FACTOR, name, base, of) for name, of in laws.items()]
    first = BASE_LAW if BASE_LAW in measured else next(iter(measured), "")
    found += [Case(MEASURED_LAW_FACTOR, name, f"{MEASURED_LAW_FACTOR}: {first}", of) for name, of in measured.items()]
    bare = f"{UNASSISTED_LAW_FACTOR}: {BASE_LAW}"
    found += [Case(UNASSISTED_LAW_FACTOR, name, bare, of, assist=False) for name, of in laws.items()]
    found += [Case(LEVEL_FACTOR, f"{part * defaults.F_C:.2g} N m", base, scale_record(p, part, 1.0)) for part in LEVELS]
    for part in DISTANCES:
        degrees = math.degrees(part * p.F_c / p.sigma_0)
        found.append(Case(PRESLIDING_FACTOR, f"{degrees:.2g} deg", base, p._replace(sigma_0=p.sigma_0 / part)))
    found += [
        Case(DAMPING_FACTOR, f"{part * p.sigma_1:.2g} N m s/rad", base, p._replace(sigma_1=part * p.sigma_1))
        for part in DAMPERS
    ]
    found += [Case(STEP_FACTOR, f"{1e3 * SAMPLE_TIME / n:.2g} ms", base, p, substeps=n) for n in SUBSTEPS]
    column = COLUMN_FRICTION / p.F_c
    found += [
        Case(SITE_FACTOR, f"{COLUMN_FRICTION:g} N m moved above the torsion bar", base, *_split_at_bar(p, column)),
        Case(SITE_FACTOR, "half moved above the torsion bar", base, *_split_at_bar(p, 0.5)),
    ]
    found += [
        Case(LOAD_FACTOR, text, base, p, load=part) for text, part in (("none by load", 0.0), ("twice by load", 2.0))
    ]
    found += [
        Case(DIRECTION_FACTOR, f"{100 * part:g} % more to the left", base, p, conditions=(("asymmetry", part),))
        for part in ASYMMETRIES
    ]
    found += [
        Case(
            POSITION_FACTOR,
            f"{100 * BY_POSITION:g} % more and less, {times} a turn",
            base,
            p,
            conditions=(("position", BY_POSITION), ("order", order)),
        )
        for order, times in ORDERS
    ]
    cold = (("temperature_rate", RATE), ("temperature_rise", COLD))
    return [*found, Case(TEMPERATURE_FACTOR, f"{COLD:g} K", base, p, conditions=cold)]


def _split_at_bar(p: Any, share: float) -> tuple[Any, Any]:
    """A law below and above the torsion bar, whose torques add up to those of ``p``."""
    return scale_record(p, 1.0 - share, 1.0), scale_record(p, share, 1.0)


def recording(case: Case, car: Car, manoeuvre: manoeuvres.Manoeuvre, p: Any) -> Recording:
    """Drive a manoeuvre as a case wants it.

    Friction above the torsion bar acts on the handwheel, whose angle the robot prescribes, so that it only adds to the
    hand torque.

    Raises
    ------
    ValueError
        For friction above the torsion bar in a manoeuvre with free hands, and as :func:`manoeuvres.drive`.
    """
    whole = build_plant(car, manoeuvre, p)
    level = whole.level._replace(load=case.load * whole.level.load, **dict(case.conditions))
    whole = step_limit.checked(whole._replace(level=level))
    if not case.assist:
        whole = whole._replace(assist=without_assist(whole.assist))
    found = drive_plant(car, whole, manoeuvre, substeps=case.substeps, near=battery.near_amplitude(car, manoeuvre))
    if case.above is None:
        return found
    if not manoeuvre.robot or manoeuvre.released:
        raise ValueError(f"{manoeuvre.name}: friction above the torsion bar needs a handwheel that a robot holds")
    extra = friction.response(case.above, found[ANGLE], SAMPLE_TIME)
    channels = {**found.channels, TORQUE: found[TORQUE] + extra}
    return Recording(found.time, channels, found.units, found.meta)


def drives(job: tuple[Car, Case, tuple[str, ...]]) -> dict[str, Drive]:
    """Every test of a case, without its curves; a job of the sweep."""
    car, case, tests = job
    found = {test: battery.drive(car, case.friction, test, run=partial(recording, case)) for test in tests}
    return {test: of._replace(curves={}) for test, of in found.items()}


class Effect(NamedTuple):
    """What a case changes in one metric."""

    case: Case
    test: str
    metric: str
    base: Value
    found: Difference

    @property
    def noticed(self) -> bool:
        """Whether the difference is real and a driver would notice it."""
        return self.found.real and self.found.perception.verdict == just_noticeable.PERCEPTIBLE

    @property
    def known(self) -> bool:
        """Whether a threshold of perception is known for this difference."""
        return self.found.perception.verdict != just_noticeable.UNKNOWN


def effects(
    every: Sequence[Case], driven: Sequence[Mapping[str, Drive]], noticed: float = just_noticeable.SHARE
) -> list[Effect]:
    """The effect of every case on every metric, against the base of its factor; ``noticed`` as in the battery."""
    bases = {case.label: of for case, of in zip(every, driven)}
    found = []
    for case, of in zip(every, driven):
        if case.label == case.base:
            continue
        for test, drive in of.items():
            for metric, value in drive.values.items():
                base = bases[case.base][test].values[metric]
                found.append(Effect(case, test, metric, base, battery.difference(metric, value, base, noticed)))
    return found


class Summary(NamedTuple):
    """What a group of cases changes."""

    compared: int  # metrics with a value on both sides
    real: int  # of them, with an interval that excludes zero
    large: int  # of them, above 5 %
    known: int  # metrics for which a threshold of perception is known
    noticed: int  # of them, perceptibly different
    largest: Effect | None  # the real difference with the largest share


def summary(rows: Iterable[Effect]) -> Summary:
    """Counts over some effects."""
    rows = [row for row in rows if math.isfinite(row.found.value)]
    real = [row for row in rows if row.found.real]
    return Summary(
        compared=len(rows),
        real=len(real),
        large=sum(abs(row.found.share) > MATTERS for row in real),
        known=sum(row.known for row in rows),
        noticed=sum(row.noticed for row in rows),
        largest=max(real, key=lambda row: abs(row.found.share), default=None),
    )


def by_test(rows: Iterable[Effect], tests: Sequence[str]) -> dict[str, list[Effect]]:
    """Effects in some tests, by test."""
    rows = list(rows)
    return {test: found for test in tests if (found := [row for row in rows if row.test == test])}


def by_factor(rows: Sequence[Effect]) -> dict[str, list[Effect]]:
    """Effects by factor, in the order of the cases."""
    found: dict[str, list[Effect]] = {}
    for row in rows:
        found.setdefault(row.case.factor, []).append(row)
    return found


def by_level(rows: Sequence[Effect]) -> dict[str, list[Effect]]:
    """Effects of one factor by level."""
    found: dict[str, list[Effect]] = {}
    for row in rows:
        found.setdefault(row.case.level, []).append(row)
    return found


class DriverEpisodes(NamedTuple):
    """Episodes of one law with a driver model in the loop, one value for each seed."""

    law: str
    task: str
    metrics: dict[str, list[float]]  # by metric [unit of the metric]


def with_driver(job: tuple[str, Any, str, int]) -> DriverEpisodes:
    """Episodes in which a driver model with arms steers and only the car's own assist helps; a job of the sweep.

    In ``SERVO_TASKS`` the action is the hands', and a servo of the angle that knows of no law has it.
    """
    name, p, task, episodes = job
    env = gym.make(task, friction=p)
    servo, nothing = drivers.AngleServo(env) if task in SERVO_TASKS else None, np.zeros(1, np.float32)
    found: dict[str, list[float]] = {}
    for seed in range(episodes):
        observation, info = env.reset(seed=seed)
        if servo is not None:
            servo.reset()
        over = False
        while not over:
            action = nothing if servo is None else servo.act(observation)
            observation, _, terminated, truncated, info = env.step(action)
            over = terminated or truncated
        for metric, value in info["metrics"].items():
            found.setdefault(metric, []).append(float(value))
    env.close()
    return DriverEpisodes(name, task, found)


def paired_difference(one: Sequence[float], other: Sequence[float]) -> tuple[float, float]:
    """Mean difference by seed and half its 95 % interval (Student)."""
    from scipy import stats

    gap = np.array(one) - np.array(other)
    if gap.size < 2:
        return float(gap.mean()), math.nan
    half = stats.t.ppf(0.975, gap.size - 1) * gap.std(ddof=1) / math.sqrt(gap.size)
    return float(gap.mean()), float(half)
