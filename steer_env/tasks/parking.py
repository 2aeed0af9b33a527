"""Parking: turning the wheels of a standing car, as the driver and as the assist."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from friction.bounds import within
from friction.kernel import kernel
from steer_env import manoeuvres
from steer_env.manoeuvres.shapes import ramp_and_hold
from steer_env.tasks import scripted
from steer_env.tasks.common import COSTS, FIGURES, MEMORY, judge_common
from steer_env.tasks.definition import (
    ASSISTING,
    HAND_TORQUE,
    NODE,
    RMS,
    STEERING,
    Action,
    Case,
    Figure,
    Quantity,
    Scenery,
    Setting,
    Task,
    Term,
    register,
)
from steer_env.tasks.feel import RATE_SCALE
from vehicle.chassis import ASSIST_REQUEST
from vehicle.plant import CHANNEL

DURATION = 24.0  # [s]
MOVES = 6  # of the driver's task
FASTEST = 5.0  # handwheel speed that they ask for [rad/s]
PREVIEW = (0.0, 0.2, 0.5, 1.0)  # [s]
WANTED = 3.0  # hand torque while turning, in the middle of the 2 to 4 N m of practice [N m]
TURNING = 0.2  # handwheel speed that brings 76 % of it [rad/s]

_ANGLE, _SPEED, _TORQUE = (CHANNEL[name] for name in ("handwheel_angle", "handwheel_speed", "handwheel_torque"))
_CREEPING = (0.0, 3.0)  # speeds, assumed [m/s]
_TWO_TRACK = ("two_track",)  # only there a car can stand


class Targets(NamedTuple):
    """The driver's rules: none but the targets, which are the case's values, one a node."""


class Robot(NamedTuple):
    """The assist's rules."""

    torque: float  # while turning [N m]


def lock(setting: Setting) -> float:
    """Handwheel angle at the rack's end stop [rad]."""
    return setting.car.steering["rack_limit"] / setting.car.steering["pinion_radius"]


def _targets(rng: np.random.Generator, setting: Setting, options: Mapping[str, float]) -> Case:
    """Smooth moves between angles drawn from nine tenths of lock to lock, each as fast as the fastest or slower."""
    t: NDArray[np.float64] = NODE * np.arange(round(DURATION / NODE) + 1.0)
    end = 0.9 * lock(setting)
    angle, each, last = np.zeros(t.size), DURATION / MOVES, 0.0
    for k in range(MOVES):
        most = each * FASTEST / 1.5  # the smooth rise is half as fast again as its mean
        to = min(max(float(rng.uniform(-end, end)), last - most), last + most)
        rise = float(rng.uniform(0.5, 1.0)) * 0.8 * each
        angle += ramp_and_hold(t - k * each, to - last, max(rise, abs(to - last) / most * each))[0]
        last = to
    return Case(np.zeros((t.size, 0)), values=angle)


def _lock_to_lock(rng: np.random.Generator, setting: Setting, options: Mapping[str, float]) -> Case:
    share = ASSIST.chosen(rng, options, "share", 0.6, 0.95)
    return Case(scripted.nodes(manoeuvres.make("parking"), share * lock(setting), DURATION))


@kernel
def _look_targets(rules, row, path, values, now, memory, situation):
    for k in range(situation.size):
        place = within(int((now.time + PREVIEW[k]) / NODE + 0.5), 0, values.size - 1)
        situation[k] = values[place] - row[_ANGLE]


@kernel
def _judge_targets(rules, row, situation, values, now, memory, rewards, costs, figures):
    judge_common(row, now, memory, costs, figures)
    error = situation[0]
    figures[figures.size - 1] = error
    rewards[0] += now.dt * error * error
    rewards[1] += now.dt * now.action * now.action
    rewards[2] += now.dt * now.rate * now.rate
    return False


@kernel
def _look(rules, row, path, values, now, memory, situation):
    pass


@kernel
def wanted_torque(torque, handwheel_speed):
    """Hand torque [N m] that parking should take, one way or the other as the handwheel turns [rad/s]."""
    return torque * math.tanh(handwheel_speed / TURNING)


@kernel
def _judge(rules, row, situation, values, now, memory, rewards, costs, figures):
    judge_common(row, now, memory, costs, figures)
    error = row[_TORQUE] - wanted_torque(rules.torque, row[_SPEED])
    figures[figures.size - 1] = error
    rewards[0] += now.dt * error * error
    rewards[1] += now.dt * now.action * now.action
    rewards[2] += now.dt * now.rate * now.rate
    return False


def _scenery(row: np.ndarray, situation: np.ndarray, values: np.ndarray, memory: np.ndarray) -> Scenery:
    return Scenery(wanted_angle=float(row[_ANGLE] + situation[0]))


_ACTION_TERMS = (
    Term("effort", -0.01, "s", "squared action"),
    Term("smoothness", -0.01 / RATE_SCALE**2, "1/s", "squared rate of the action"),
)

DRIVER = register(
    Task(
        name="DriverParking",
        summary="Turn the wheels of a standing car by hand torque, along a target of the handwheel angle.",
        rules=Targets(),
        action=HAND_TORQUE,
        channels=STEERING,
        situation=tuple(
            Quantity(f"target_{t:.1f}s", "rad", 25.0, f"target {t:g} s from now less the handwheel angle now")
            for t in PREVIEW
        ),
        rewards=(Term("angle", -1.0 / 0.2**2, "rad2 s", "squared error of the handwheel angle"), *_ACTION_TERMS),
        costs=COSTS,
        figures=(*FIGURES, Figure("rms_angle_error", "rad", RMS, "of the handwheel against the target")),
        start=_targets,
        begins=f"At a standstill, wheels straight; {MOVES} targets are drawn within nine tenths of lock to lock.",
        ends=f"Truncates after {DURATION:g} s.",
        speed=0.0,
        speeds=_CREEPING,
        chassis=_TWO_TRACK,
        memory=MEMORY,
        scenery=_scenery,
    ),
    _look_targets,
    _judge_targets,
)

ASSIST = register(
    Task(
        name="AssistParking",
        summary="Give parking an even, light hand torque by assist torque; a robot turns from lock to lock.",
        rules=Robot(WANTED),
        action=Action(
            "assist torque at the column, left positive, on top of the boost curve's", "N m", 20.0, ASSIST_REQUEST
        ),
        channels=ASSISTING,
        situation=(),
        rewards=(
            Term(
                "feel", -1.0, "(N m)2 s", f"squared difference of the hand torque from {WANTED:g} N m the way it turns"
            ),
            *_ACTION_TERMS,
        ),
        costs=COSTS,
        figures=(*FIGURES, Figure("rms_feel_error", "N m", RMS, "hand torque less the wanted one")),
        start=_lock_to_lock,
        begins="At a standstill, wheels straight; a robot turns the handwheel to 60 to 95 % of both locks.",
        ends=f"Truncates after {DURATION:g} s, one cycle.",
        speed=0.0,
        speeds=_CREEPING,
        scripted=scripted.HANDS,
        robot=True,
        chassis=_TWO_TRACK,
        options={"share": (0.1, 0.99, "of the handwheel angle at lock [1]")},
        memory=MEMORY,
    ),
    _look,
    _judge,
)
