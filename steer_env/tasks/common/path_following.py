"""What every task that follows a path shares: what is observed of the path, and the terms for leaving it."""

import math

from steer_env.courses import path as paths
from steer_env.courses.preview import PREVIEW_NAMES, PREVIEW_TIMES
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common.definition import PEAK, RMS, EpisodeMetric, Quantity, Term
from steer_env.tasks.common.terms import COMMON_MEMORY, COMMON_METRICS, action_terms, evaluate_common
from steer_env.vehicle.plant import CHANNEL

# An offset [m] and a heading error [rad] that cost as much as driving on is rewarded.
OFFSET_SCALE, HEADING_SCALE = 0.5, 0.1

PATH_OBSERVATIONS = (
    Quantity("lateral_offset", "m", 5.0, "offset from the path, positive where the car is left of it"),
    Quantity("heading_error", "rad", math.pi, "heading minus the path's direction, left positive"),
    *(
        Quantity(name, "m", 30.0, f"lateral position of the path {t:.1f} s ahead, in the car's frame")
        for name, t in zip(PREVIEW_NAMES, PREVIEW_TIMES)
    ),
)
FOLLOWING_REWARDS = (
    Term("progress", 1.0, "s", "time driven"),
    Term("offset", -1.0 / OFFSET_SCALE**2, "m2 s", "squared lateral offset"),
    Term("heading", -1.0 / HEADING_SCALE**2, "rad2 s", "squared heading error"),
)
ACTION_REWARDS = action_terms(0.1)
FOLLOWING_METRICS = (
    *COMMON_METRICS,
    EpisodeMetric("rms_lateral_offset", "m", RMS, "lateral offset from the path"),
    EpisodeMetric("peak_lateral_offset", "m", PEAK, "lateral offset from the path"),
)
FOLLOWING_MEMORY = COMMON_MEMORY + 1  # the last float is the arc length of the nearest point [m]

_X, _Y, _YAW = CHANNEL["x"], CHANNEL["y"], CHANNEL["yaw_angle"]


@kernel
def observe_path(channels, path, step, memory, observations):
    """Write ``PATH_OBSERVATIONS``: lateral offset, heading error and the path ahead."""
    memory[COMMON_MEMORY] = paths.locate(
        path, channels[_X], channels[_Y], channels[_YAW], memory[COMMON_MEMORY], 0.1 * step.speed, observations
    )


@kernel
def evaluate_following(channels, observations, step, memory, rewards, costs, metrics):
    """Add the quantities of ``FOLLOWING_REWARDS`` (first) and of the common costs; give ``FOLLOWING_METRICS``."""
    evaluate_common(channels, step, memory, costs, metrics)
    offset, heading = observations[0], observations[1]
    rewards[0] += step.dt
    rewards[1] += step.dt * offset * offset
    rewards[2] += step.dt * heading * heading
    n = metrics.size
    metrics[n - 2] = offset
    metrics[n - 1] = offset


@kernel
def has_departed(observations, half_width):
    """Whether the car has left a lane of this half width [m] or points across it."""
    return abs(observations[0]) > half_width or abs(observations[1]) > 0.5 * math.pi
