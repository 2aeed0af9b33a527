"""Kernels of every task that follows a path: what is seen of it, and what leaving it costs."""

import math

from steer_env.courses import path as paths
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common.definition import PEAK, RMS, Figure, Term
from steer_env.tasks.common.terms import FIGURES, MEMORY, judge_common
from steer_env.vehicle.plant import CHANNEL

OFFSET_SCALE, HEADING_SCALE = (
    0.5,
    0.1,
)  # of an offset [m] and a heading error [rad] that cost as much as driving on earns
RATE_SCALE = 10.0  # of the action [1/s]

FOLLOWING_REWARDS = (
    Term("progress", 1.0, "s", "time driven"),
    Term("offset", -1.0 / OFFSET_SCALE**2, "m2 s", "squared lateral offset"),
    Term("heading", -1.0 / HEADING_SCALE**2, "rad2 s", "squared heading error"),
)
ACTION_REWARDS = (
    Term("effort", -0.1, "s", "squared action"),
    Term("smoothness", -0.1 / RATE_SCALE**2, "1/s", "squared rate of the action"),
)
FOLLOWING_FIGURES = (
    *FIGURES,
    Figure("rms_lateral_offset", "m", RMS, "from the path"),
    Figure("peak_lateral_offset", "m", PEAK, "from the path"),
)
FOLLOWING_MEMORY = MEMORY + 1  # then: arc length of the nearest point [m]

_X, _Y, _YAW = CHANNEL["x"], CHANNEL["y"], CHANNEL["yaw_angle"]


@kernel
def see(row, path, now, memory, situation):
    """Lateral offset, heading error and the path ahead."""
    memory[MEMORY] = paths.see(path, row[_X], row[_Y], row[_YAW], memory[MEMORY], 0.1 * now.speed, situation)


@kernel
def judge_following(row, situation, now, memory, rewards, costs, figures):
    """Adds the terms of ``FOLLOWING_REWARDS`` (first), of the common costs and of ``FOLLOWING_FIGURES``."""
    judge_common(row, now, memory, costs, figures)
    offset, heading = situation[0], situation[1]
    rewards[0] += now.dt
    rewards[1] += now.dt * offset * offset
    rewards[2] += now.dt * heading * heading
    n = figures.size
    figures[n - 2] = offset
    figures[n - 1] = offset


@kernel
def judge_action(now, first, rewards):
    """Adds the terms of ``ACTION_REWARDS``, which stand from ``first`` on."""
    rewards[first] += now.dt * now.action * now.action
    rewards[first + 1] += now.dt * now.rate * now.rate


@kernel
def lost(situation, half_width):
    """Whether the car has left the lane or points across it."""
    return abs(situation[0]) > half_width or abs(situation[1]) > 0.5 * math.pi
