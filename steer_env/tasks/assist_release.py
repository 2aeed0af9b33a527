"""Release: the assist leads a released handwheel back to the centre along a wanted motion."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.manoeuvres.common.shapes import ramp_and_hold
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
from steer_env.tasks.common.feel_term import FEEL_METRIC, FEEL_SCALE, feel_error, feel_quality
from steer_env.tasks.common.terms import (
    COMMON_MEMORY,
    COMMON_METRICS,
    COMMON_REWARDS,
    assist_costs,
    evaluate_added_work,
    evaluate_common,
    quality,
)
from steer_env.vehicle.cars import Car
from steer_env.vehicle.plant import CHANNEL

RISE_TIME, HOLD_TIME, FREE_TIME = 1.5, 1.0, 2.5  # the robot turns the handwheel, holds it, and nobody does [s]
RELEASE_TIME = RISE_TIME + HOLD_TIME  # [s]
SPEEDS = 12.0 / 3.6, 100.0 / 3.6  # held, lowest and highest [m/s]
ACCELERATIONS = 2.0, 4.0  # lateral, that the held angle aims at [m/s2]
UNDERSTEER = math.radians(2.0) / 9.81  # road-wheel angle beyond the path's; 2 deg/g is usual, assumed [rad s2/m]
MOST_ANGLE = 3.0  # of the handwheel, which a robot turns in ``RISE_TIME``; binds below some 30 km/h, assumed [rad]

# The wanted return is that of a critically damped second-order system: it starts without a jump of the speed, does not
# overshoot, and leaves a tenth of the angle after 1.9 s. By itself a car returns more slowly at low speed, and friction
# stops it short of the centre; at high speed it snaps back and overshoots. Assumed.
RETURN_TIME = 0.5  # [s]
RETURN_SCALE = 0.02  # error over the held angle at which the quality is 71 %: the band of a settling time, assumed [1]
LEAST_ANGLE = 0.01  # held angle below which the scale stays, so that an angle of zero has one [rad]
# What a second counts while the robot holds the handwheel, of one after the release: enough that a torque against the
# hands does not pay, little enough that the episode is about the return; assumed.
HELD_SHARE = 0.1
RETURN_ERRORS = "return_error", "return_speed_error"  # observations, wanted minus present

_ANGLE, _SPEED = CHANNEL["handwheel_angle"], CHANNEL["handwheel_speed"]


class Release(NamedTuple):
    """Parameters of the task. The episode's data is the angle that the robot holds [rad]."""

    time: float  # at which the hands let go [s]


@kernel
def wanted_return(held_angle, since):
    """Wanted angle [rad] and speed [rad/s] of the handwheel some time [s] after its release at an angle [rad]."""
    s = since / RETURN_TIME
    left = held_angle * math.exp(-s)
    return left * (1.0 + s), -left * s / RETURN_TIME


def _usual_angle(car: Car, speed: float, acceleration: float) -> float:
    """About the handwheel angle [rad] of a steady turn at a speed [m/s] and a lateral acceleration [m/s2]."""
    wheelbase = car.chassis["front_axle"] + car.chassis["rear_axle"]
    return min(car.steering_ratio(speed) * (wheelbase / speed**2 + UNDERSTEER) * acceleration, MOST_ANGLE)


def _draw_setup(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
    side = 1.0 if rng.random() < 0.5 else -1.0
    low, high = (_usual_angle(context.car, context.speed, acceleration) for acceleration in ACCELERATIONS)
    amplitude = TASK.draw_option(rng, options, "amplitude", low, high)
    if "amplitude" not in options:
        amplitude *= side
    motion = np.column_stack(ramp_and_hold(scripted.update_times(RELEASE_TIME + FREE_TIME), amplitude, RISE_TIME))
    return EpisodeSetup(motion, data=np.array([amplitude]), release_time=RELEASE_TIME)


@kernel
def _observe(parameters, channels, path, data, step, memory, observations):
    observations[0] = observations[1] = observations[2] = 0.0
    if step.time >= parameters.time:
        angle, speed = wanted_return(data[0], step.time - parameters.time)
        observations[0], observations[1], observations[2] = 1.0, angle - channels[_ANGLE], speed - channels[_SPEED]


@kernel
def _evaluate(parameters, channels, observations, data, step, memory, rewards, costs, metrics):
    if step.time > parameters.time:
        error = observations[1]
        share = step.dt * quality(error / (RETURN_SCALE * within(abs(data[0]), LEAST_ANGLE, math.inf)))
        metrics.rms_angle_error, metrics.rms_feel_error = error, 0.0
    else:
        error = feel_error(channels)
        share = step.dt * HELD_SHARE * feel_quality(error)
        metrics.rms_angle_error, metrics.rms_feel_error = 0.0, error
    # A torque that chatters follows any motion, and one that does nothing is smooth: neither is worth much alone.
    rewards.goal += share * evaluate_common(channels, step, share, memory, rewards, costs, metrics)
    evaluate_added_work(channels, step, costs)
    return GOES_ON


TASK = register(
    Task(
        name="AssistRelease",
        summary="Lead a handwheel that is released in a turn back to the centre, in the same time at every speed.",
        parameters=Release(RELEASE_TIME),
        action=ASSIST_TORQUE._replace(scale=10.0),
        channels=ASSIST_CHANNELS,
        task_observations=(
            Quantity("released", "1", 1.0, "1 from the release on, 0 before"),
            Quantity(RETURN_ERRORS[0], "rad", 12.0, "wanted minus present handwheel angle; 0 before the release", 0.02),
            Quantity(RETURN_ERRORS[1], "rad/s", 40.0, "the same of the handwheel speed", 0.2),
        ),
        rewards=(
            Term(
                "goal",
                0.7,
                "quality of the angle against the wanted return after the release, 71 % at an error of "
                f"{100.0 * RETURN_SCALE:g} % of the held angle; before it {HELD_SHARE:g} of that of the hand torque "
                f"against the reference feel, 71 % at {FEEL_SCALE:g} N m; both times that of `smoothness`. The terms "
                "below count in proportion to the quality of the angle, or to that share of the hand torque's",
            ),
            *COMMON_REWARDS,
        ),
        costs=assist_costs(1.5),
        metrics=(
            *COMMON_METRICS,
            EpisodeMetric("rms_angle_error", "rad", RMS, "return error"),
            FEEL_METRIC._replace(meaning=f"{FEEL_METRIC.meaning}, taken as zero after the release"),
        ),
        draw_setup=_draw_setup,
        begins=(
            "The car drives straight ahead at the held speed, which is drawn where neither the environment nor `reset` "
            f"gives one. A robot turns the handwheel, left or right, within {RISE_TIME:g} s, to an angle of some "
            f"{ACCELERATIONS[0]:g} to {ACCELERATIONS[1]:g} m/s2 but at most {MOST_ANGLE:g} rad, holds it and releases "
            f"it after {RELEASE_TIME:g} s. At a time t after the release, the wanted angle is the held one times "
            f"(1 + t/T) exp(-t/T) with T = {RETURN_TIME:g} s."
        ),
        ends=f"The episode is truncated {FREE_TIME:g} s after the release.",
        speed=40.0 / 3.6,
        speeds=SPEEDS,
        scripted_inputs=scripted.HANDS,
        robot=True,
        options={"amplitude": (-MOST_ANGLE, MOST_ANGLE, "handwheel angle that the robot holds, left positive [rad]")},
        memory_size=COMMON_MEMORY,
        usual={"handwheel_angle": 1.0, "handwheel_speed": 1.0, "column_speed": 1.0},
    ),
    _observe,
    _evaluate,
)
