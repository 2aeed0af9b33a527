"""Release: the assist brings a handwheel that is let go back to the middle, quickly and without swinging past."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from steer_env import manoeuvres
from steer_env.friction.numerics.kernel import kernel
from steer_env.manoeuvres.release import FREE, HELD, RISE
from steer_env.tasks.common import scripted
from steer_env.tasks.common.definition import (
    ASSIST_TORQUE,
    ASSISTING,
    RMS,
    Case,
    Figure,
    Quantity,
    Setting,
    Task,
    Term,
    register,
)
from steer_env.tasks.common.feel import RATE_SCALE
from steer_env.tasks.common.terms import COSTS, FIGURES, MEMORY, judge_common
from steer_env.vehicle.plant import CHANNEL

RELEASED = RISE + HELD  # [s]
LOW, HIGH = 0.1, 0.5  # of the amplitude; 0.26 rad is 2 m/s2 at 100 km/h on the compact car [rad]

_ANGLE, _YAW_RATE = CHANNEL["handwheel_angle"], CHANNEL["yaw_rate"]


class Release(NamedTuple):
    """Rules of the task."""

    released: float  # when the hands let go [s]


def _start(rng: np.random.Generator, setting: Setting, options: Mapping[str, float]) -> Case:
    side = 1.0 if rng.random() < 0.5 else -1.0
    amplitude = TASK.chosen(rng, options, "amplitude", LOW, HIGH)
    if "amplitude" not in options:
        amplitude *= side
    return Case(scripted.nodes(manoeuvres.make("release"), amplitude, RELEASED + FREE), released=RELEASED)


@kernel
def _look(rules, row, path, values, now, memory, situation):
    situation[0] = 1.0 if now.time >= rules.released else 0.0


@kernel
def _judge(rules, row, situation, values, now, memory, rewards, costs, figures):
    judge_common(row, now, memory, costs, figures)
    angle, yaw_rate = row[_ANGLE], row[_YAW_RATE]
    n = figures.size
    figures[n - 1] = 0.0
    if now.time > rules.released:
        rewards[0] += now.dt * angle * angle
        rewards[1] += now.dt * yaw_rate * yaw_rate
        figures[n - 1] = angle
    rewards[2] += now.dt * now.action * now.action
    rewards[3] += now.dt * now.rate * now.rate
    return False


TASK = register(
    Task(
        name="AssistRelease",
        summary="Return a handwheel that is let go in a steady turn to the middle, without swinging past.",
        rules=Release(RELEASED),
        action=ASSIST_TORQUE,
        channels=ASSISTING,
        situation=(Quantity("released", "1", 1.0, "1 once the hands have let go"),),
        rewards=(
            Term("angle", -1.0 / 0.1**2, "rad2 s", "squared handwheel angle after the release"),
            Term("yaw", -1.0 / 0.05**2, "rad2/s", "squared yaw rate after the release"),
            Term("effort", -0.01, "s", "squared action"),
            Term("smoothness", -0.01 / RATE_SCALE**2, "1/s", "squared rate of the action"),
        ),
        costs=COSTS,
        figures=(*FIGURES, Figure("rms_released_angle", "rad", RMS, "handwheel angle, zero before the release")),
        start=_start,
        begins=(
            f"Straight ahead at the held speed; a robot turns the handwheel to {LOW:g} to {HIGH:g} rad, left or right, "
            f"within {RISE:g} s, holds it and lets go after {RELEASED:g} s."
        ),
        ends=f"Truncates {FREE:g} s after the release.",
        speed=100.0 / 3.6,
        scripted=scripted.HANDS,
        robot=True,
        options={"amplitude": (-2.0, 2.0, "handwheel angle held, left positive [rad]")},
        memory=MEMORY,
    ),
    _look,
    _judge,
)
