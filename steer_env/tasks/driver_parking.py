"""Turn the wheels of a standing car by hand torque, along a target of the handwheel angle."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.manoeuvres.common.shapes import ramp_and_hold
from steer_env.tasks.common.definition import (
    HAND_TORQUE,
    NODE,
    RMS,
    STEERING,
    Case,
    Figure,
    Quantity,
    Scenery,
    Setting,
    Task,
    Term,
    register,
)
from steer_env.tasks.common.standstill import ACTION_TERMS, CREEPING, TWO_TRACK, lock
from steer_env.tasks.common.terms import COSTS, FIGURES, MEMORY, judge_common
from steer_env.vehicle.plant import CHANNEL

DURATION = 24.0  # [s]
MOVES = 6
FASTEST = 5.0  # handwheel speed that they ask for [rad/s]
PREVIEW = (0.0, 0.2, 0.5, 1.0)  # [s]

_ANGLE = CHANNEL["handwheel_angle"]


class Targets(NamedTuple):
    """The driver's rules: none but the targets, which are the case's values, one a node."""


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


@kernel
def _look(rules, row, path, values, now, memory, situation):
    for k in range(situation.size):
        place = within(int((now.time + PREVIEW[k]) / NODE + 0.5), 0, values.size - 1)
        situation[k] = values[place] - row[_ANGLE]


@kernel
def _judge(rules, row, situation, values, now, memory, rewards, costs, figures):
    judge_common(row, now, memory, costs, figures)
    error = situation[0]
    figures[figures.size - 1] = error
    rewards[0] += now.dt * error * error
    rewards[1] += now.dt * now.action * now.action
    rewards[2] += now.dt * now.rate * now.rate
    return False


def _scenery(row: np.ndarray, situation: np.ndarray, values: np.ndarray, memory: np.ndarray) -> Scenery:
    return Scenery(wanted_angle=float(row[_ANGLE] + situation[0]))


TASK = register(
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
        rewards=(Term("angle", -1.0 / 0.2**2, "rad2 s", "squared error of the handwheel angle"), *ACTION_TERMS),
        costs=COSTS,
        figures=(*FIGURES, Figure("rms_angle_error", "rad", RMS, "of the handwheel against the target")),
        start=_targets,
        begins=f"At a standstill, wheels straight; {MOVES} targets are drawn within nine tenths of lock to lock.",
        ends=f"Truncates after {DURATION:g} s.",
        speed=0.0,
        speeds=CREEPING,
        chassis=TWO_TRACK,
        memory=MEMORY,
        scenery=_scenery,
    ),
    _look,
    _judge,
)
