"""Release: the assist returns a released handwheel to the centre, quickly and without overshoot."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from steer_env import manoeuvres
from steer_env.friction.numerics.kernel import kernel
from steer_env.manoeuvres.release import FREE, HELD, RISE
from steer_env.tasks.common import scripted
from steer_env.tasks.common.definition import (
    ASSIST_CHANNELS,
    ASSIST_TORQUE,
    GOES_ON,
    RMS,
    EpisodeContext,
    EpisodeMetric,
    EpisodeSetup,
    Quantity,
    Task,
    Term,
    register,
)
from steer_env.tasks.common.feel_term import FEEL_METRIC, FEEL_SCALE, feel_error, feel_quality, feel_term
from steer_env.tasks.common.terms import (
    COMMON_MEMORY,
    COMMON_METRICS,
    COMMON_REWARDS,
    assist_costs,
    evaluate_added_work,
    evaluate_common,
    quality,
)
from steer_env.vehicle.plant import CHANNEL

RELEASE_TIME = RISE + HELD  # [s]
LOW, HIGH = 0.1, 0.5  # of the amplitude; 0.24 rad is 2 m/s2 at 100 km/h on the compact car [rad]

ANGLE_SCALE = 0.05  # handwheel angle at which the quality of the return is 71 %, assumed [rad]

_ANGLE = CHANNEL["handwheel_angle"]


class Release(NamedTuple):
    """Parameters of the task."""

    time: float  # at which the hands let go [s]


def _draw_setup(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
    side = 1.0 if rng.random() < 0.5 else -1.0
    amplitude = TASK.draw_option(rng, options, "amplitude", LOW, HIGH)
    if "amplitude" not in options:
        amplitude *= side
    motion = scripted.hand_motion(manoeuvres.make("release"), amplitude, RELEASE_TIME + FREE)
    return EpisodeSetup(motion, release_time=RELEASE_TIME)


@kernel
def _observe(parameters, channels, path, data, step, memory, observations):
    observations[0] = 1.0 if step.time >= parameters.time else 0.0


@kernel
def _evaluate(parameters, channels, observations, data, step, memory, rewards, costs, metrics):
    evaluate_common(channels, step, step.dt, memory, rewards, costs, metrics)
    evaluate_added_work(channels, step, costs)
    if step.time > parameters.time:
        rewards["return"] += step.dt * quality(channels[_ANGLE] / ANGLE_SCALE)
        metrics.rms_feel_error, metrics.rms_released_angle = 0.0, channels[_ANGLE]
    else:
        error = feel_error(channels)
        rewards.feel += step.dt * feel_quality(error)
        metrics.rms_feel_error, metrics.rms_released_angle = error, 0.0
    return GOES_ON


TASK = register(
    Task(
        name="AssistRelease",
        summary="Return a handwheel that is released in a steady turn to the centre, without overshoot.",
        parameters=Release(RELEASE_TIME),
        action=ASSIST_TORQUE,
        channels=ASSIST_CHANNELS,
        task_observations=(Quantity("released", "1", 1.0, "1 from the release on, 0 before"),),
        rewards=(
            feel_term(0.35)._replace(
                meaning="while the robot holds the handwheel, quality of the hand torque against the reference feel; "
                f"71 % at {FEEL_SCALE:g} N m"
            ),
            Term("return", 0.35, f"after the release, quality of the handwheel angle; 71 % at {ANGLE_SCALE:g} rad"),
            *COMMON_REWARDS,
        ),
        costs=assist_costs(0.2),
        metrics=(
            *COMMON_METRICS,
            FEEL_METRIC._replace(meaning=f"{FEEL_METRIC.meaning}, taken as zero after the release"),
            EpisodeMetric("rms_released_angle", "rad", RMS, "handwheel angle, taken as zero before the release"),
        ),
        draw_setup=_draw_setup,
        begins=(
            f"The car drives straight ahead at the held speed. A robot turns the handwheel to {LOW:g} to {HIGH:g} rad, "
            f"left or right, within {RISE:g} s, holds it and releases it after {RELEASE_TIME:g} s."
        ),
        ends=f"The episode is truncated {FREE:g} s after the release.",
        speed=100.0 / 3.6,
        scripted_inputs=scripted.HANDS,
        robot=True,
        options={"amplitude": (-2.0, 2.0, "handwheel angle that the robot holds, left positive [rad]")},
        memory_size=COMMON_MEMORY,
    ),
    _observe,
    _evaluate,
)
