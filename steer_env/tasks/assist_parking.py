"""Give parking an even, light hand torque by assist torque; a robot turns from lock to lock."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from steer_env import manoeuvres
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common import scripted
from steer_env.tasks.common.definition import ASSISTING, RMS, Action, Case, Figure, Setting, Task, Term, register
from steer_env.tasks.common.standstill import ACTION_TERMS, CREEPING, TWO_TRACK, lock
from steer_env.tasks.common.terms import COSTS, FIGURES, MEMORY, judge_common
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST
from steer_env.vehicle.plant import CHANNEL

DURATION = 24.0  # [s]
WANTED = 3.0  # hand torque while turning, in the middle of the 2 to 4 N m of practice [N m]
TURNING = 0.2  # handwheel speed that brings 76 % of it [rad/s]

_SPEED, _TORQUE = CHANNEL["handwheel_speed"], CHANNEL["handwheel_torque"]


class Robot(NamedTuple):
    """The assist's rules."""

    torque: float  # while turning [N m]


def _lock_to_lock(rng: np.random.Generator, setting: Setting, options: Mapping[str, float]) -> Case:
    share = TASK.chosen(rng, options, "share", 0.6, 0.95)
    return Case(scripted.nodes(manoeuvres.make("parking"), share * lock(setting), DURATION))


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


TASK = register(
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
            *ACTION_TERMS,
        ),
        costs=COSTS,
        figures=(*FIGURES, Figure("rms_feel_error", "N m", RMS, "hand torque less the wanted one")),
        start=_lock_to_lock,
        begins="At a standstill, wheels straight; a robot turns the handwheel to 60 to 95 % of both locks.",
        ends=f"Truncates after {DURATION:g} s, one cycle.",
        speed=0.0,
        speeds=CREEPING,
        scripted=scripted.HANDS,
        robot=True,
        chassis=TWO_TRACK,
        options={"share": (0.1, 0.99, "of the handwheel angle at lock [1]")},
        memory=MEMORY,
    ),
    _look,
    _judge,
)
