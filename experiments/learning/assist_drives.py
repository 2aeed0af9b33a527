"""What the suite for assists drives: hands that let go, a weave, arms of a driver, each over many conditions at once.

The drives are tasks of the package with another setup: hands that prescribe a torque in place of an angle, a straight
road. They are no ids. A drive is one vector environment, whose rows differ in what ``reset`` fixes: speed, load,
friction scale, sensors, delay, the gain of the action. Law, car and chassis differ between drives.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import friction, manoeuvres, tasks
from steer_env.courses import path
from steer_env.episode.timing import UPDATE_INTERVAL
from steer_env.manoeuvres.release import FREE_TIME, HOLD_TIME, RISE_TIME
from steer_env.tasks import Task
from steer_env.tasks.common import lane, scripted
from steer_env.tasks.common.definition import EpisodeContext, EpisodeSetup
from steer_env.tasks.common.standstill import CREEPING
from steer_env.vehicle.cars import Car
from steer_env.vehicle.chassis.common.interface import HAND

Array = NDArray[np.float64]

PULSE, PULSE_TIME, SETTLING = 3.0, 0.3, 10.0  # hand torque [N m], its duration and that of the drive [s]
RELEASE_ANGLE = 0.3  # handwheel angle from which the hands let go, some 2.5 m/s2 at 100 km/h on the default car [rad]
LANE_OFFSET, LANE_OFFSET_TIME = 0.5, 15.0  # lateral offset from which a driver steers back [m], and the time for it [s]
SPEEDS = tuple(range(30, 181, 15))  # with free hands [km/h]
WOVEN = (60, 100, 140)  # in the weave [km/h]
DRIVEN = (60, 80, 100, 120)  # with a driver in a lane [km/h]
TURNED = (60, 80)  # with a driver in the lane change [km/h]
LEVELS = (1.0, 2.0)  # of the friction
OTHER_CARS = ("bmw_320i", "ford_escort", "rear_drive_saloon")
ARMED_CARS = OTHER_CARS[1:]  # on the others the driver model swings the handwheel by itself


class RowConditions(NamedTuple):
    """Conditions of one row of a drive."""

    speed: float  # [km/h]
    variant: str  # in words
    options: Mapping[str, float]  # of ``reset``, beside the speed

    @property
    def place(self) -> str:
        """Speed and friction scale in words."""
        level = self.options["friction_level"]
        return f"{self.speed:g} km/h" + (f", friction {level:g} times" if level != 1.0 else "")


class Drive(NamedTuple):
    """Rows that share an environment."""

    kind: str  # of ``DRIVE_KINDS``
    condition: str  # law, car or chassis, in words
    arguments: Mapping[str, Any]  # of the environment
    rows: tuple[RowConditions, ...]


class Kind(NamedTuple):
    """What is driven, and how it is judged."""

    task: str  # whose setup is replaced
    judge: str  # of ``steer_env.experiments.learning.assist_suite.JUDGES``
    changes: Mapping[str, Any] = {}
    released: float = np.inf  # time from which on nobody holds the handwheel [s]


def _pulse(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
    t = scripted.update_times(SETTLING)
    # The torque is a straight line between updates of 10 ms, so that it rises and falls within one of them.
    return EpisodeSetup(np.where((t > 0.0) & (t < PULSE_TIME + 0.5 * UPDATE_INTERVAL), PULSE, 0.0)[:, None])


def _release(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
    motion = scripted.hand_motion(manoeuvres.make("release"), RELEASE_ANGLE, RISE_TIME + HOLD_TIME + FREE_TIME)
    return EpisodeSetup(motion, release_time=RISE_TIME + HOLD_TIME)


def _straight(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
    calm = np.zeros((scripted.update_times(LANE_OFFSET_TIME).size, 1 + len(lane.DISTURBANCES)))
    road = path.from_curvature(np.zeros(round(context.speed * (LANE_OFFSET_TIME + 2.0))))
    return EpisodeSetup(calm, path=road, pose=(0.0, LANE_OFFSET, 0.0))


_BY_TORQUE = {"draw_setup": _pulse, "scripted_inputs": (HAND,), "robot": False}
DRIVE_KINDS = {
    "pulse": Kind("AssistWeave", "free swing", _BY_TORQUE, PULSE_TIME),
    "release": Kind("AssistWeave", "free swing", {"draw_setup": _release}, RISE_TIME + HOLD_TIME),
    "weave": Kind("AssistWeave", "ripple"),
    "arms": Kind("AssistLaneKeeping", "held swing", {"draw_setup": _straight}),
    "lane keeping": Kind("AssistLaneKeeping", "steering"),
    "lane change": Kind("AssistLaneChange", "steering"),
    "parked pulse": Kind("AssistParking", "free swing", _BY_TORQUE, PULSE_TIME),
    "parking": Kind("AssistParking", "ripple"),
}


def task_of(kind: str, home: Task) -> Task:
    """The task of a kind of drive, with the action of the task that a controller comes from."""
    of = DRIVE_KINDS[kind]
    return replace(tasks.task(of.task), action=home.action, **of.changes)


OWN_FRICTION = "friction of the car"
_UNCHANGED_VARIANT: dict[str, Mapping[str, float]] = {"as it is": {}}
_LATE: dict[str, Mapping[str, float]] = {"20 ms more delay": {"delay": 0.02}}
_DOUBLED: dict[str, Mapping[str, float]] = {"action doubled": {"action_gain": 2.0}}
_MARGINS = {**_UNCHANGED_VARIANT, **_DOUBLED, "10 ms more delay": {"delay": 0.01}, **_LATE}
_LOADED: dict[str, Mapping[str, float]] = {"sensor noise": {"sensor_noise": 1.0}, "300 kg of load": {"load": 300.0}}
_ALL_VARIANTS = {**_MARGINS, **_LOADED}


def _rows(
    speeds: tuple[int, ...], levels: tuple[float, ...], variants: Mapping[str, Mapping[str, float]]
) -> tuple[RowConditions, ...]:
    """A row for every speed, friction scale and variant (words -> options of ``reset``)."""
    return tuple(
        RowConditions(speed, words, {**options, "friction_level": level})
        for words, options in variants.items()
        for level in levels
        for speed in speeds
    )


def suite(home: Task, car: Car | None = None) -> list[Drive]:
    """The drives of the suite for the controllers of an assist task: driving, standing, or both.

    With a ``car`` all are driven with it, and those of other cars are left out.
    """
    low, high = home.speed_limits(home.chassis[0])
    drives = (_driving() if high > CREEPING[1] else []) + (_standing() if low == 0.0 else [])
    if car is None:
        return drives
    own = {"vehicle": car.data()}
    return [
        drive._replace(arguments={**drive.arguments, **own}) for drive in drives if "vehicle" not in drive.arguments
    ]


def _driving() -> list[Drive]:
    one = LEVELS[:1]
    drives = [
        Drive("weave", OWN_FRICTION, {}, _rows(WOVEN, LEVELS, _ALL_VARIANTS)),
        Drive("arms", OWN_FRICTION, {}, _rows(DRIVEN, one, _ALL_VARIANTS)),
        Drive("release", OWN_FRICTION, {}, _rows(SPEEDS, one, _ALL_VARIANTS)),
        Drive("pulse", OWN_FRICTION, {}, _rows(SPEEDS, LEVELS, _MARGINS)),
        Drive("pulse", OWN_FRICTION, {}, _rows(SPEEDS, one, _LOADED)),
        Drive("lane change", OWN_FRICTION, {}, _rows(TURNED, one, _ALL_VARIANTS)),
        Drive("lane keeping", OWN_FRICTION, {}, _rows(DRIVEN, one, _ALL_VARIANTS)),
    ]
    for law in sorted({*friction.available()} - {"lugre"}):  # that of the car is LuGre
        drives.append(
            Drive("weave", law, {"friction": law}, _rows(WOVEN[1:2], LEVELS, {**_UNCHANGED_VARIANT, **_LATE}))
        )
        drives.append(Drive("arms", law, {"friction": law}, _rows(DRIVEN, one, {**_UNCHANGED_VARIANT, **_DOUBLED})))
        drives.append(Drive("release", law, {"friction": law}, _rows(SPEEDS, one, _MARGINS)))
        drives.append(Drive("pulse", law, {"friction": law}, _rows(SPEEDS, LEVELS, _MARGINS)))
    for car in OTHER_CARS:
        drives.append(Drive("weave", car, {"vehicle": car}, _rows(WOVEN[1:2], one, {**_UNCHANGED_VARIANT, **_LATE})))
        if car in ARMED_CARS:
            drives.append(Drive("arms", car, {"vehicle": car}, _rows(DRIVEN, one, {**_UNCHANGED_VARIANT, **_DOUBLED})))
        drives.append(Drive("pulse", car, {"vehicle": car}, _rows(SPEEDS, one, _MARGINS)))
    for kind, speeds in (("arms", DRIVEN), ("pulse", SPEEDS)):
        drives.append(
            Drive(kind, "two tracks", {"chassis": "two_track"}, _rows(speeds, LEVELS[:1], _UNCHANGED_VARIANT))
        )
    return drives


def _standing() -> list[Drive]:
    return [
        Drive("parking", OWN_FRICTION, {}, _rows((0,), LEVELS, _MARGINS)),
        *(Drive("parked pulse", law, {"friction": law}, _rows((0,), LEVELS, _MARGINS)) for law in friction.available()),
    ]
