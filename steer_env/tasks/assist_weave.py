"""Weave: the assist shapes the hand torque of a robot's on-centre weave."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from steer_env import manoeuvres
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common import scripted
from steer_env.tasks.common.definition import ASSIST_TORQUE, ASSISTING, Case, Setting, Task, register
from steer_env.tasks.common.feel import FEEL_FIGURE, FEEL_REWARDS, judge_feel
from steer_env.tasks.common.terms import COSTS, FIGURES, MEMORY, judge_common

DURATION = 20.0  # [s]
NOMINAL = math.radians(15.0)  # 2 m/s2 at 100 km/h on the compact car


class Weave(NamedTuple):
    """No rules but the manoeuvre's."""


def _start(rng: np.random.Generator, setting: Setting, options: Mapping[str, float]) -> Case:
    amplitude = TASK.chosen(rng, options, "amplitude", 0.8 * NOMINAL, 1.2 * NOMINAL)
    return Case(scripted.nodes(manoeuvres.make("weave"), amplitude, DURATION))


@kernel
def _look(rules, row, path, values, now, memory, situation):
    pass


@kernel
def _judge(rules, row, situation, values, now, memory, rewards, costs, figures):
    judge_common(row, now, memory, costs, figures)
    figures[figures.size - 1] = judge_feel(row, now, 0, rewards)
    return False


TASK = register(
    Task(
        name="AssistWeave",
        summary="Shape the feel of an on-centre weave by assist torque; a robot steers.",
        rules=Weave(),
        action=ASSIST_TORQUE,
        channels=ASSISTING,
        situation=(),
        rewards=FEEL_REWARDS,
        costs=COSTS,
        figures=(*FIGURES, FEEL_FIGURE),
        start=_start,
        begins=(
            "Straight ahead at the held speed; the 0.2 Hz weave grows over its first cycle. Its amplitude is drawn "
            "from 80 to 120 % of 15 deg, which is 2 m/s2 for the default car at 100 km/h, whatever the speed is."
        ),
        ends=f"Truncates after {DURATION:g} s.",
        speed=100.0 / 3.6,
        scripted=scripted.HANDS,
        robot=True,
        options={"amplitude": (0.0, 2.0, "of the handwheel angle [rad]")},
        memory=MEMORY,
    ),
    _look,
    _judge,
)
