"""What lane-change tasks share: the cones of a course after ISO 3888, and the reward of passing them."""

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.courses import iso3888, path
from steer_env.friction.numerics.kernel import kernel
from steer_env.manoeuvres.double_lane_change import APPROACH, RUN_OUT
from steer_env.tasks.common.definition import NODE, SUM, TASKS, Case, Figure, Scenery, Setting, Term
from steer_env.tasks.common.feel import judge_feel
from steer_env.tasks.common.path_following import (
    FOLLOWING_FIGURES,
    FOLLOWING_MEMORY,
    judge_action,
    judge_following,
    lost,
    see,
)
from steer_env.tasks.common.terms import COSTS, SIGHT
from steer_env.vehicle.plant import CHANNEL

Array = NDArray[np.float64]

LEFT_COURSE = 4.0  # from the path, where nothing is left to be learnt [m]
SLACK = 1.5  # time for a run over that at the held speed
BEHIND, BEYOND = 20.0, 80.0  # of the path, kept before the start and after the end [m]
CONES = 64  # a course has fewer

# Layout of the case's values: the course's end, the car's outline, then x, y of the cones.
_END, _LENGTH, _WIDTH, _CENTRE, _FIRST = range(5)
_X, _Y, _YAW = CHANNEL["x"], CHANNEL["y"], CHANNEL["yaw_angle"]


class Cones(NamedTuple):
    """The driver's rules."""

    left_course: float  # [m]


class AssistedCones(NamedTuple):
    """The assist's rules."""

    left_course: float  # [m]


@lru_cache(maxsize=16)
def _course(manoeuvre: str, size: iso3888.Outline) -> tuple[Array, Array, float]:
    """Path (P, 4), cones (N, 2) and the end of a course to the left that begins ``APPROACH`` after the start."""
    course = iso3888.course(manoeuvre, size.width)
    whole = iso3888.path(course, size) + np.array([APPROACH, 0.0])
    end = APPROACH + course.length + RUN_OUT
    # The straights at both ends are given by their ends alone.
    middle = whole[1:-1]
    before = np.arange(-BEHIND, middle[0, 0] - 0.5)
    after = np.arange(middle[-1, 0] + 1.0, end + BEYOND)
    points = np.concatenate(
        [
            np.column_stack([before, np.full(before.size, middle[0, 1])]),
            middle,
            np.column_stack([after, np.full(after.size, middle[-1, 1])]),
        ]
    )
    return path.through(points), np.concatenate([course.left, course.right]) + np.array([APPROACH, 0.0]), end


def starter(name: str, manoeuvre: str, coasts: bool = False):
    """Episodes of the task ``name`` through the course of a manoeuvre; ``coasts``: throttle released on entry."""

    def start(rng: np.random.Generator, setting: Setting, options: Mapping[str, float]) -> Case:
        task = TASKS[name]
        side = -1.0 if rng.random() < 0.5 else 1.0
        if "mirrored" in options:
            side = -1.0 if task.checked("mirrored", options["mirrored"]) else 1.0
        offset = task.chosen(rng, options, "entry_offset", -0.2, 0.2)
        heading = task.chosen(rng, options, "entry_heading", -0.01, 0.01)
        size = iso3888.outline(setting.car)
        road, cones, end = _course(manoeuvre, size)
        values = np.concatenate([[end, *size], (cones * [1.0, side]).ravel()])
        t = NODE * np.arange(math.ceil(SLACK * end / setting.speed / NODE) + 1)
        column = (t >= APPROACH / setting.speed).astype(float) if coasts else np.zeros(t.size)
        return Case(column[:, None], path=road * [1.0, side, side, side], values=values, pose=(0.0, offset, heading))

    return start


@kernel
def look(rules, row, path, values, now, memory, situation):
    see(row, path, now, memory, situation)


@kernel
def _newly_hit(row, values, memory):
    """Cones that the car's outline touches for the first time; each is remembered in the memory after the path's."""
    c, s = math.cos(row[_YAW]), math.sin(row[_YAW])
    half_length, half_width = 0.5 * values[_LENGTH], 0.5 * values[_WIDTH]
    hit = 0.0
    for k in range((values.size - _FIRST) // 2):
        ahead, left = values[_FIRST + 2 * k] - row[_X], values[_FIRST + 2 * k + 1] - row[_Y]
        if abs(c * ahead + s * left - values[_CENTRE]) < half_length and abs(c * left - s * ahead) < half_width:
            hit += 1.0 - memory[FOLLOWING_MEMORY + k]
            memory[FOLLOWING_MEMORY + k] = 1.0
    return hit


@kernel
def _ended(rules, row, situation, values):
    return lost(situation, rules.left_course) or row[_X] >= values[_END]


@kernel
def judge(rules, row, situation, values, now, memory, rewards, costs, figures):
    judge_following(row, situation, now, memory, rewards, costs, figures)
    judge_action(now, 3, rewards)
    hit = _newly_hit(row, values, memory)
    rewards[5] += hit
    costs[3] += hit
    figures[5] = hit
    if lost(situation, rules.left_course):
        rewards[6] += 1.0
    return _ended(rules, row, situation, values)


@kernel
def judge_assist(rules, row, situation, values, now, memory, rewards, costs, figures):
    judge_following(row, situation, now, memory, rewards, costs, figures)
    judge_feel(row, now, 3, rewards)
    hit = _newly_hit(row, values, memory)
    rewards[6] += hit
    costs[3] += hit
    figures[5] = hit
    if lost(situation, rules.left_course):
        rewards[7] += 1.0
    return _ended(rules, row, situation, values)


def _scenery(row: Array, situation: Array, values: Array, memory: Array) -> Scenery:
    cones = values[_FIRST:].reshape(-1, 2)
    return Scenery(cones=np.column_stack([cones, memory[FOLLOWING_MEMORY : FOLLOWING_MEMORY + len(cones)]]))


LOSSES = (
    Term("cones", -10.0, "1", "cones touched for the first time"),
    Term("departure", -100.0, "1", f"more than {LEFT_COURSE:g} m from the path, or across it"),
)
_COSTS = (*COSTS, Term("cones", 1.0, "1", "cones touched for the first time"))
# The common figures are five; hits follow them.
_FIGURES = (*FOLLOWING_FIGURES[:5], Figure("cones_hit", "1", SUM, "each once"), *FOLLOWING_FIGURES[5:])
_OPTIONS = {
    "mirrored": (0.0, 1.0, "1 for a side lane to the right"),
    "entry_offset": (-1.0, 1.0, "of the start, left positive [m]"),
    "entry_heading": (-0.1, 0.1, "of the start, left positive [rad]"),
}
SHARED: dict[str, Any] = {
    "situation": SIGHT,
    "costs": _COSTS,
    "figures": _FIGURES,
    "begins": (
        f"{APPROACH:g} m before the first cone at the held speed, up to 0.2 m beside the middle, 0.01 rad askew; the "
        "side lane lies to the left or to the right. All of it is drawn. The course fits the car's width; the path is "
        "the smoothest that leaves half of each lane's clearance."
    ),
    "ends": (
        f"Terminates {RUN_OUT:g} m behind the last cone, or {LEFT_COURSE:g} m from the path or across it; truncates "
        f"after {SLACK:g} times the time for the course."
    ),
    "options": _OPTIONS,
    "memory": FOLLOWING_MEMORY + CONES,
    "scenery": _scenery,
}
