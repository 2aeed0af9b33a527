"""Make the hand torque of parking even and light by assist torque; a robot turns from lock to lock."""

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
    RMS,
    EpisodeContext,
    EpisodeMetric,
    EpisodeSetup,
    Task,
    Term,
    register,
)
from steer_env.tasks.common.feel_term import FEEL_SCALE, feel_quality
from steer_env.tasks.common.standstill import CREEPING, TWO_TRACK, USUAL, angle_at_lock
from steer_env.tasks.common.terms import (
    COMMON_MEMORY,
    COMMON_METRICS,
    COMMON_REWARDS,
    assist_costs,
    evaluate_added_work,
    evaluate_common,
)
from steer_env.vehicle.plant import CHANNEL

DURATION = 24.0  # [s]
WANTED = 3.0  # hand torque while turning, in the middle of the 2 to 4 N m of practice [N m]
TURNING = 0.2  # handwheel speed at which the wanted torque reaches 76 % of it [rad/s]

_SPEED, _TORQUE = CHANNEL["handwheel_speed"], CHANNEL["handwheel_torque"]


class ParkingFeel(NamedTuple):
    """Parameters of the task."""

    torque: float  # wanted hand torque while the handwheel turns [N m]


def _draw_setup(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
    share = TASK.draw_option(rng, options, "share", 0.6, 0.95)
    parking = manoeuvres.make("parking", frequency=1.0 / DURATION)
    return EpisodeSetup(scripted.hand_motion(parking, share * angle_at_lock(context), DURATION))


@kernel
def _observe(parameters, channels, path, data, step, memory, observations):
    pass


@kernel
def wanted_torque(torque, handwheel_speed):
    """Wanted hand torque [N m] at a handwheel speed [rad/s]; it has the direction in which the handwheel turns."""
    return torque * math.tanh(handwheel_speed / TURNING)


@kernel
def _evaluate(parameters, channels, observations, data, step, memory, rewards, costs, metrics):
    evaluate_common(channels, step, step.dt, memory, rewards, costs, metrics)
    evaluate_added_work(channels, step, costs)
    error = channels[_TORQUE] - wanted_torque(parameters.torque, channels[_SPEED])
    metrics.rms_feel_error = error
    rewards.feel += step.dt * feel_quality(error)
    return GOES_ON


TASK = register(
    Task(
        name="AssistParking",
        summary="Make the hand torque of parking even and light by assist torque; a robot turns from lock to lock.",
        parameters=ParkingFeel(WANTED),
        action=ASSIST_TORQUE._replace(scale=20.0),
        channels=ASSIST_CHANNELS,
        task_observations=(),
        rewards=(
            Term(
                "feel",
                0.7,
                f"quality of the hand torque against {WANTED:g} N m in the direction of turning; 71 % at "
                f"{FEEL_SCALE:g} N m",
            ),
            *COMMON_REWARDS,
        ),
        costs=assist_costs(200.0),
        metrics=(
            *COMMON_METRICS,
            EpisodeMetric("rms_feel_error", "N m", RMS, "hand torque minus the wanted hand torque"),
        ),
        draw_setup=_draw_setup,
        begins=(
            "The car stands with its wheels straight. A robot then turns the handwheel to both sides, to 60 to 95 % of "
            "the angle at lock."
        ),
        ends=f"The episode is truncated after {DURATION:g} s, which is one cycle.",
        speed=0.0,
        speed_range=CREEPING,
        scripted_inputs=scripted.HANDS,
        robot=True,
        chassis=TWO_TRACK,
        options={"share": (0.1, 0.99, "largest handwheel angle over the angle at lock [1]")},
        memory_size=COMMON_MEMORY,
        usual=USUAL,
    ),
    _observe,
    _evaluate,
)
