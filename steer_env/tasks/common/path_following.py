"""What every task that follows a path shares: what is observed of the path, progress along it, and leaving it."""

import math

from steer_env.courses import path as paths
from steer_env.courses.preview import HEADING_ERROR, LATERAL_OFFSET, PREVIEW_NAMES, PREVIEW_TIMES
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common.definition import PEAK, RMS, EpisodeMetric, Quantity, Term
from steer_env.tasks.common.terms import COMMON_MEMORY, COMMON_METRICS, evaluate_common, quality
from steer_env.vehicle.plant import CHANNEL

PATH_OBSERVATIONS = (
    Quantity("lateral_offset", "m", 5.0, "offset from the path, positive where the car is left of it", 0.3),
    Quantity("heading_error", "rad", math.pi, "heading minus the path's direction, left positive", 0.02),
    *(
        Quantity(name, "m", 30.0, f"lateral position of the path {t:.1f} s ahead, in the car's frame", 0.2 + t)
        for name, t in zip(PREVIEW_NAMES, PREVIEW_TIMES)
    ),
)
FOLLOWING_METRICS = (
    *COMMON_METRICS,
    EpisodeMetric("rms_lateral_offset", "m", RMS, "lateral offset from the path"),
    EpisodeMetric("peak_lateral_offset", "m", PEAK, "lateral offset from the path"),
)
# The last two floats are the arc length of the nearest point and the largest one so far [m].
FOLLOWING_MEMORY = COMMON_MEMORY + 2
_NEAREST, _FURTHEST = COMMON_MEMORY, COMMON_MEMORY + 1

_X, _Y, _YAW = CHANNEL["x"], CHANNEL["y"], CHANNEL["yaw_angle"]


def offset_term(weight: float, scale: float) -> Term:
    """The term for the lateral offset, for a task that gives it a weight [1/s] and a scale [m]."""
    return Term("offset", weight, f"quality of the lateral offset; 71 % at {scale:g} m")


@kernel
def observe_path(channels, path, step, memory, observations):
    """Write ``PATH_OBSERVATIONS``: lateral offset, heading error and the path ahead."""
    memory[_NEAREST] = paths.locate(
        path, channels[_X], channels[_Y], channels[_YAW], memory[_NEAREST], 0.1 * step.speed, observations
    )
    if step.time == 0.0:
        memory[_FURTHEST] = memory[_NEAREST]


@kernel
def evaluate_following(channels, observations, scale, step, memory, rewards, costs, metrics):
    """Add the common terms and the quality of the lateral offset, whose scale [m] is given.

    Returns the progress that all rewards of the step count: way gained along the path over the held speed, at most
    ``step.dt`` [s]. Way that the car has gained before is not counted again.
    """
    gained = (memory[_NEAREST] - memory[_FURTHEST]) / step.held_speed
    memory[_FURTHEST] = max(memory[_FURTHEST], memory[_NEAREST])
    progress = within(gained, 0.0, step.dt)
    evaluate_common(channels, step, progress, memory, rewards, costs, metrics)
    offset = observations[LATERAL_OFFSET]
    rewards.offset += progress * quality(offset / scale)
    metrics.rms_lateral_offset = offset
    metrics.peak_lateral_offset = offset
    return progress


@kernel
def has_departed(observations, half_width):
    """Whether the car has left a lane of this half width [m] or points across it."""
    return abs(observations[LATERAL_OFFSET]) > half_width or abs(observations[HEADING_ERROR]) > 0.5 * math.pi
