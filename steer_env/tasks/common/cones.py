"""What lane-change tasks share: the cones of a course after ISO 3888, and the terms for touching them."""

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.courses import iso3888, path
from steer_env.episode.timing import UPDATE_INTERVAL
from steer_env.friction.numerics.kernel import kernel
from steer_env.manoeuvres.double_lane_change import APPROACH, RUN_OUT
from steer_env.tasks.common.definition import (
    DEPARTED,
    FINISHED,
    GOES_ON,
    SUM,
    TASKS,
    Cost,
    DrawSetup,
    EpisodeContext,
    EpisodeMetric,
    EpisodeSetup,
    Scenery,
    Term,
)
from steer_env.tasks.common.feel_term import FEEL_METRIC, feel_error, feel_quality, feel_term
from steer_env.tasks.common.path_following import (
    FOLLOWING_MEMORY,
    FOLLOWING_METRICS,
    PATH_OBSERVATIONS,
    evaluate_following,
    has_departed,
    observe_path,
    offset_term,
)
from steer_env.tasks.common.terms import COMMON_METRICS, COMMON_REWARDS, assist_costs, evaluate_added_work
from steer_env.vehicle.plant import CHANNEL

Array = NDArray[np.float64]

COURSE_HALF_WIDTH = 4.0  # lateral offset from the path that ends an episode: nothing is learnt beyond it [m]
TIME_RATIO = 1.5  # time for a run over the time that the course takes at the held speed [1]
PATH_BEFORE_START, PATH_AFTER_END = 20.0, 80.0  # length of the path before the start and after the end [m]
MAX_CONES = 64  # a course has fewer
# Lateral offset at which a driver's quality is 71 %, and that of an assist, whose driver follows the path; assumed [m].
DRIVER_OFFSET, ASSIST_OFFSET = 0.3, 0.1

# Layout of the episode's data: the course's end, the car's outline, then x, y of the cones.
_END, _LENGTH, _WIDTH, _CENTRE, _FIRST = range(5)
_COUNT = FOLLOWING_MEMORY  # place of the number of touched cones in a task's memory; the flags of the cones follow
_FLAGS = _COUNT + 1
MEMORY = _FLAGS + MAX_CONES
_X, _Y, _YAW = (CHANNEL[name] for name in ("x", "y", "yaw_angle"))


class DriverCones(NamedTuple):
    """Parameters of the driver's tasks."""

    half_width: float  # lateral offset that ends an episode [m]


class AssistCones(NamedTuple):
    """Parameters of the assist's task."""

    half_width: float  # lateral offset that ends an episode [m]


@lru_cache(maxsize=16)
def course(manoeuvre: str, size: iso3888.Footprint) -> tuple[Array, Array, float]:
    """Path (P, 4), cones (N, 2) and the end of a course to the left that begins ``APPROACH`` after the start."""
    lanes = iso3888.course(manoeuvre, size.width)
    whole = iso3888.path(lanes, size) + np.array([APPROACH, 0.0])
    end = APPROACH + lanes.length + RUN_OUT
    # The straights at both ends are given by their ends alone.
    middle = whole[1:-1]
    before = np.arange(-PATH_BEFORE_START, middle[0, 0] - 0.5)
    after = np.arange(middle[-1, 0] + 1.0, end + PATH_AFTER_END)
    points = np.concatenate(
        [
            np.column_stack([before, np.full(before.size, middle[0, 1])]),
            middle,
            np.column_stack([after, np.full(after.size, middle[-1, 1])]),
        ]
    )
    return path.path_through_points(points), np.concatenate([lanes.left, lanes.right]) + np.array([APPROACH, 0.0]), end


def setup_drawer(name: str, manoeuvre: str, coasts: bool = False) -> DrawSetup:
    """The ``draw_setup`` of a task on a manoeuvre's course; ``coasts``: with the throttle released on entry."""

    def draw_setup(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
        task = TASKS[name]
        side = -1.0 if rng.random() < 0.5 else 1.0
        if "mirrored" in options:
            side = -1.0 if task.checked_option("mirrored", options["mirrored"]) else 1.0
        offset = task.draw_option(rng, options, "entry_offset", -0.2, 0.2)
        heading = task.draw_option(rng, options, "entry_heading", -0.01, 0.01)
        size = iso3888.footprint(context.car)
        road, cones, end = course(manoeuvre, size)
        data = np.concatenate([[end, *size], (cones * [1.0, side]).ravel()])
        t = UPDATE_INTERVAL * np.arange(math.ceil(TIME_RATIO * end / context.speed / UPDATE_INTERVAL) + 1)
        column = (t >= APPROACH / context.speed).astype(float) if coasts else np.zeros(t.size)
        return EpisodeSetup(
            column[:, None], path=road * [1.0, side, side, side], data=data, pose=(0.0, offset, heading)
        )

    return draw_setup


@kernel
def observe(parameters, channels, path, data, step, memory, observations):
    """The ``observe`` of these tasks: the path ahead, as :func:`observe_path` gives it."""
    observe_path(channels, path, step, memory, observations)


@kernel
def newly_touched(channels, data, memory):
    """Number of cones that the car's outline touches for the first time; the memory holds 1 for each touched cone."""
    c, s = math.cos(channels[_YAW]), math.sin(channels[_YAW])
    half_length, half_width = 0.5 * data[_LENGTH], 0.5 * data[_WIDTH]
    touched = 0.0
    for k in range((data.size - _FIRST) // 2):
        ahead, left = data[_FIRST + 2 * k] - channels[_X], data[_FIRST + 2 * k + 1] - channels[_Y]
        if abs(c * ahead + s * left - data[_CENTRE]) < half_length and abs(c * left - s * ahead) < half_width:
            touched += 1.0 - memory[_FLAGS + k]
            memory[_FLAGS + k] = 1.0
    return touched


@kernel
def course_outcome(parameters, channels, observations, data):
    """Whether the car has left the course or reached its end."""
    if has_departed(observations, parameters.half_width):
        return DEPARTED
    return FINISHED if channels[_X] >= data[_END] else GOES_ON


@kernel
def _evaluate(parameters, channels, observations, data, scale, step, memory, rewards, costs, metrics):
    """What both roles share: following with an offset's scale [m], touched cones as a metric, and the outcome.

    Returns the progress [s], the cones touched for the first time, and the outcome.
    """
    progress = evaluate_following(channels, observations, scale, step, memory, rewards, costs, metrics)
    touched = newly_touched(channels, data, memory)
    metrics.cones_hit = touched
    return progress, touched, course_outcome(parameters, channels, observations, data)


@kernel
def evaluate(parameters, channels, observations, data, step, memory, rewards, costs, metrics):
    """The ``evaluate_step`` of the driver tasks: following, standing cones, departure, end of the course."""
    progress, touched, outcome = _evaluate(
        parameters, channels, observations, data, DRIVER_OFFSET, step, memory, rewards, costs, metrics
    )
    memory[_COUNT] += touched
    rewards.clean += progress / (1.0 + memory[_COUNT])
    return outcome


@kernel
def evaluate_assist(parameters, channels, observations, data, step, memory, rewards, costs, metrics):
    """The ``evaluate_step`` of the assist task: following, feel, touched cones, departure, end of the course."""
    progress, touched, outcome = _evaluate(
        parameters, channels, observations, data, ASSIST_OFFSET, step, memory, rewards, costs, metrics
    )
    evaluate_added_work(channels, step, costs)
    costs.cones += touched
    error = feel_error(channels)
    rewards.feel += progress * feel_quality(error)
    metrics.rms_feel_error = error
    return outcome


def scenery(channels: Array, observations: Array, data: Array, memory: Array) -> Scenery:
    """The cones, for the picture."""
    cones = data[_FIRST:].reshape(-1, 2)
    return Scenery(cones=np.column_stack([cones, memory[_FLAGS : _FLAGS + len(cones)]]))


_TOUCHED = "number of cones touched, each counted once"
CONE_METRIC = EpisodeMetric("cones_hit", "1", SUM, _TOUCHED)
DRIVER_REWARDS = (
    offset_term(0.4, DRIVER_OFFSET),
    Term("clean", 0.3, "1 over 1 plus the number of cones touched so far"),
    *COMMON_REWARDS,
)
DRIVER_METRICS = (*COMMON_METRICS, CONE_METRIC, *FOLLOWING_METRICS[-2:])
ASSIST_REWARDS = (offset_term(0.2, ASSIST_OFFSET), feel_term(0.5), *COMMON_REWARDS)
ASSIST_METRICS = (*COMMON_METRICS, CONE_METRIC, FEEL_METRIC, *FOLLOWING_METRICS[-2:])


def lane_change_costs(budget: float) -> tuple[Cost, ...]:
    """The costs of an assist task with a lane change, with a budget for the work of its torque [J]."""
    return (*assist_costs(budget), Cost("cones", 0.1, "1", _TOUCHED))


_OPTIONS = {
    "mirrored": (0.0, 1.0, "1 for a side lane to the right, 0 for one to the left"),
    "entry_offset": (-1.0, 1.0, "lateral offset of the start, left positive [m]"),
    "entry_heading": (-0.1, 0.1, "heading of the start, left positive [rad]"),
}
SHARED: dict[str, Any] = {
    "task_observations": PATH_OBSERVATIONS,
    "begins": (
        f"The car starts {APPROACH:g} m before the first cone at the held speed, at most 0.2 m beside the lane's "
        "middle and at most 0.01 rad askew; the side lane lies to the left or to the right. All three are drawn. "
        "The course fits the car's width; the path is the smoothest one that keeps half of each lane's clearance."
    ),
    "ends": (
        f"The episode ends {RUN_OUT:g} m behind the last cone. It fails when the car is more than "
        f"{COURSE_HALF_WIDTH:g} m from the path or points across it. It is truncated after {TIME_RATIO:g} times the "
        "time that the course takes at the held speed."
    ),
    "options": _OPTIONS,
    "memory_size": MEMORY,
    "scenery": scenery,
}
