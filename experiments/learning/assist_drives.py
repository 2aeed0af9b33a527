"""What the suite for assists drives: hands that let go, a weave, arms of a driver, each over many conditions at once.

The drives are tasks of the package with another setup: hands that prescribe a torque in place of an angle, a straight
road. They are no ids. A drive is one vector environment, whose rows differ in speed, load, friction level, sensors and
the factor on the action; law, car and chassis differ between drives.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import friction, manoeuvres, tasks
from steer_env.courses import path
from steer_env.manoeuvres.release import FREE, HELD, RISE
from steer_env.tasks import Task
from steer_env.tasks.common import lane, scripted
from steer_env.tasks.common.definition import EpisodeContext, EpisodeSetup
from steer_env.timing import UPDATE_INTERVAL
from steer_env.vehicle.chassis.common.interface import HAND

Array = NDArray[np.float64]

PULSE, PULSE_TIME, SETTLING = 3.0, 0.3, 10.0  # hand torque [N m], its duration and that of the drive [s]
TURN = 0.3  # handwheel angle from which the hands let go, some 2.5 m/s2 at 100 km/h on the default car [rad]
STEP, STEP_TIME = 0.5, 15.0  # lateral offset from which a driver steers back [m], and the time for it [s]
SEED = 3_000_000  # of the rows' draws; apart from training, validation and held-out episodes
SPEEDS = tuple(range(30, 181, 15))  # with free hands [km/h]
DRIVEN = (60, 80, 100, 120)  # with a driver [km/h]
TURNED = (60, 80)  # in the lane change [km/h]
OTHER_CARS = ("bmw_320i", "ford_escort")


class Row(NamedTuple):
    """Conditions of one row of a drive."""

    speed: float  # [km/h]
    variant: str = "as it is"  # in words
    gain: float = 1.0  # factor on the action [1]
    options: tuple[tuple[str, float], ...] = ()  # of reset

    @property
    def place(self) -> str:
        """Speed and friction level in words."""
        level = dict(self.options).get("friction_level", 1.0)
        return f"{self.speed:g} km/h" + (f", friction {level:g} times" if level != 1.0 else "")


class Drive(NamedTuple):
    """Rows that share an environment."""

    kind: str  # of ``KINDS``
    condition: str  # in words: law, or car and chassis
    arguments: tuple[tuple[str, Any], ...]  # of the environment
    rows: tuple[Row, ...]


class Kind(NamedTuple):
    """What is driven, and how it is judged."""

    task: str  # whose setup is replaced
    changes: Mapping[str, Any]  # fields of the task
    judge: str  # of ``steer_env.experiments.learning.assist_suite.JUDGES``
    released: float = np.inf  # time from which on nobody holds the handwheel [s]


def _pulse(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
    t = scripted.update_times(SETTLING)
    # The torque is a straight line between updates of 10 ms, so its ends fall halfway between two of them.
    return EpisodeSetup(np.where((t > 0.0) & (t < PULSE_TIME + 0.5 * UPDATE_INTERVAL), PULSE, 0.0)[:, None])


def _release(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
    motion = scripted.hand_motion(manoeuvres.make("release"), TURN, RISE + HELD + FREE)
    return EpisodeSetup(motion, release_time=RISE + HELD)


def _straight(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
    calm = np.zeros((scripted.update_times(STEP_TIME).size, 1 + len(lane.DISTURBANCES)))
    road = path.from_curvature(np.zeros(round(context.speed * (STEP_TIME + 2.0))))
    return EpisodeSetup(calm, path=road, pose=(0.0, STEP, 0.0))


KINDS = {
    "pulse": Kind(
        "AssistWeave", {"draw_setup": _pulse, "scripted_inputs": (HAND,), "robot": False}, "swing", PULSE_TIME
    ),
    "release": Kind("AssistWeave", {"draw_setup": _release}, "swing", RISE + HELD),
    "weave": Kind("AssistWeave", {}, "ripple"),
    "arms": Kind("AssistLaneKeeping", {"draw_setup": _straight}, "held swing"),
    "lane keeping": Kind("AssistLaneKeeping", {}, "effort"),
    "lane change": Kind("AssistLaneChange", {}, "effort"),
}


def task_of(kind: str, home: Task) -> Task:
    """The task of a kind of drive, with the action of the task that a controller comes from."""
    of = KINDS[kind]
    return replace(tasks.task(of.task), action=home.action, **of.changes)


_LATE, _LATER, _DOUBLED = (("delay", 0.01),), (("delay", 0.02),), 2.0
LEVELS = (1.0, 2.0)


def _rows(speeds: tuple[int, ...], levels: tuple[float, ...], *variants: tuple[str, float, Any]) -> tuple[Row, ...]:
    """A row for every speed, friction level and variant (words, factor on the action, options of reset)."""
    return tuple(
        Row(speed, words, gain, (*options, ("friction_level", level)))
        for words, gain, options in variants
        for level in levels
        for speed in speeds
    )


_PLAIN = ("as it is", 1.0, ())
_MARGINS = (("action doubled", _DOUBLED, ()), ("10 ms more delay", 1.0, _LATE), ("20 ms more delay", 1.0, _LATER))
_NOISE, _LOAD = ("sensor noise", 1.0, (("sensor_noise", 1.0),)), ("300 kg of load", 1.0, (("load", 300.0),))


def suite() -> list[Drive]:
    """The drives of the suite."""
    every = (_PLAIN, *_MARGINS, _NOISE, _LOAD)
    hands_off = partial(_rows, SPEEDS)
    drives = [
        Drive("pulse", law, (("friction", law),), hands_off(LEVELS, _PLAIN, *_MARGINS)) for law in friction.available()
    ]
    drives += [
        Drive("pulse", "lugre", (), hands_off((1.0,), _NOISE, _LOAD)),
        Drive("pulse", "two tracks", (("chassis", "two_track"),), hands_off((1.0,), _PLAIN)),
        Drive("release", "lugre", (), hands_off((1.0,), *every)),
        Drive("weave", "lugre", (), _rows((60, 100, 140), LEVELS, *every)),
        Drive("arms", "lugre", (), _rows(DRIVEN, (1.0,), *every)),
        Drive("lane keeping", "lugre", (), _rows(DRIVEN, (1.0,), *every)),
        Drive("lane change", "lugre", (), _rows(TURNED, (1.0,), *every)),
        Drive("arms", "two tracks", (("chassis", "two_track"),), _rows(DRIVEN, (1.0,), _PLAIN)),
    ]
    for law in friction.available():
        if law != "lugre":
            drives.append(Drive("weave", law, (("friction", law),), _rows((100,), LEVELS, _PLAIN, _MARGINS[-1])))
            drives.append(Drive("arms", law, (("friction", law),), _rows(DRIVEN, (1.0,), _PLAIN, _MARGINS[0])))
    for car in OTHER_CARS:
        drives.append(Drive("pulse", car, (("vehicle", car),), hands_off((1.0,), _PLAIN, *_MARGINS)))
        drives.append(Drive("arms", car, (("vehicle", car),), _rows(DRIVEN, (1.0,), _PLAIN, _MARGINS[0])))
        drives.append(Drive("weave", car, (("vehicle", car),), _rows((100,), (1.0,), _PLAIN, _MARGINS[-1])))
    return drives
