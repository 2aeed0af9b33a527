"""Weave: the assist shapes the hand torque of a robot's on-centre weave."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from steer_env import manoeuvres
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common import scripted
from steer_env.tasks.common.definition import (
    ASSIST_CHANNELS,
    ASSIST_TORQUE,
    GOES_ON,
    EpisodeContext,
    EpisodeSetup,
    Script,
    Task,
    register,
)
from steer_env.tasks.common.feel_term import FEEL_METRIC, feel_error, feel_quality, feel_term
from steer_env.tasks.common.terms import (
    COMMON_MEMORY,
    COMMON_METRICS,
    COMMON_REWARDS,
    assist_costs,
    evaluate_added_work,
    evaluate_common,
)

MANOEUVRE = manoeuvres.make("weave")
DURATION = 20.0  # [s]
NOMINAL = math.radians(15.0)  # amplitude; some 2 m/s2 at 100 km/h on the compact car
AMPLITUDES = 0.8 * NOMINAL, 1.2 * NOMINAL  # that are drawn [rad]


class Weave(NamedTuple):
    """Parameters of the task; there are none, and the class selects the kernels."""


def _draw_setup(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
    amplitude = TASK.draw_option(rng, options, "amplitude", *AMPLITUDES)
    return EpisodeSetup(Script(scripted.sine_factors(MANOEUVRE.frequency, DURATION), amplitude))


@kernel
def _observe(parameters, channels, path, data, step, memory, observations):
    pass


@kernel
def _evaluate(parameters, channels, observations, data, step, memory, rewards, costs, metrics):
    evaluate_common(channels, step, step.dt, memory, rewards, costs, metrics)
    evaluate_added_work(channels, step, costs)
    error = feel_error(channels)
    rewards.feel += step.dt * feel_quality(error)
    metrics.rms_feel_error = error
    return GOES_ON


TASK = register(
    Task(
        name="AssistWeave",
        summary="Shape the feel of an on-centre weave by assist torque; a robot steers.",
        parameters=Weave(),
        action=ASSIST_TORQUE,
        channels=ASSIST_CHANNELS,
        task_observations=(),
        rewards=(feel_term(0.7), *COMMON_REWARDS),
        costs=assist_costs(2.0),
        metrics=(*COMMON_METRICS, FEEL_METRIC),
        draw_setup=_draw_setup,
        begins=(
            "The car drives straight ahead at the held speed; the 0.2 Hz weave grows over its first cycle. At every "
            "speed the amplitude is drawn from 80 to 120 % of 15 deg, some 2 m/s2 for the default car at 100 km/h."
        ),
        ends=f"The episode is truncated after {DURATION:g} s.",
        speed=100.0 / 3.6,
        scripted_inputs=scripted.HANDS,
        robot=True,
        options={"amplitude": (0.0, 2.0, "amplitude of the handwheel angle [rad]")},
        memory_size=COMMON_MEMORY,
    ),
    _observe,
    _evaluate,
)
