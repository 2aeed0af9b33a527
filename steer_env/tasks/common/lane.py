"""What lane-keeping tasks share: the road, crosswind and surface that are drawn, the terms for keeping the lane."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from steer_env.courses import path
from steer_env.episode.timing import UPDATE_INTERVAL
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common.definition import (
    DEPARTED,
    DRIVER_CHANNELS,
    GOES_ON,
    HAND_TORQUE,
    DrawSetup,
    EpisodeContext,
    EpisodeSetup,
    Task,
)
from steer_env.tasks.common.feel_term import feel_error, feel_quality
from steer_env.tasks.common.path_following import (
    FOLLOWING_MEMORY,
    FOLLOWING_METRICS,
    PATH_OBSERVATIONS,
    evaluate_following,
    has_departed,
    observe_path,
    offset_term,
)
from steer_env.tasks.common.terms import COMMON_COSTS, COMMON_REWARDS, evaluate_added_work
from steer_env.vehicle.chassis.common.interface import RACK_DISTURBANCE, WIND_FORCE, WIND_MOMENT

DURATION = 30.0  # [s]
LANE_HALF_WIDTH = 1.75  # [m]
# Lateral offset at which a driver's quality is 71 %, and that of an assist, whose driver keeps the lane; assumed [m].
DRIVER_OFFSET, ASSIST_OFFSET = 0.3, 0.1
WIND = 300.0  # standard deviation of the crosswind's force, assumed [N]
WIND_CORRELATION = 1.0  # correlation time of the crosswind [s]
WIND_ARM = 0.3  # centre of pressure ahead of the centre of gravity, assumed [m]
ROAD = 60.0  # standard deviation of the rack force of a rough surface, assumed [N]
ROAD_CORRELATION = 0.02  # correlation time of the rough surface [s]
DISTURBANCES = (WIND_FORCE, WIND_MOMENT, RACK_DISTURBANCE)


class DriverLane(NamedTuple):
    """Parameters of the driver's tasks."""

    half_width: float  # of the lane [m]


class AssistLane(NamedTuple):
    """Parameters of the assist's task."""

    half_width: float  # of the lane [m]


@kernel
def _low_pass(noise, deviation, pole):
    """Turn white noise of unit variance into first-order noise with a standard deviation, in place, from zero."""
    # These lines save every start of an environment the 0.7 s that importing scipy.signal takes.
    gain = deviation * math.sqrt(1.0 - pole * pole)
    value = 0.0
    for i in range(noise.size):
        value = pole * value + gain * noise[i]
        noise[i] = value


def disturbances(rng: np.random.Generator, duration: float, wind: float, road: float) -> np.ndarray:
    """Wind force, wind moment and rack disturbance (U, 3) at every update, from zero; standard deviations [N]."""
    n = round(duration / UPDATE_INTERVAL) + 1
    inputs = np.zeros((n, 3))
    for column, deviation, correlation in ((0, wind, WIND_CORRELATION), (2, road, ROAD_CORRELATION)):
        noise = rng.standard_normal(n)
        _low_pass(noise, deviation, math.exp(-UPDATE_INTERVAL / correlation))
        inputs[:, column] = noise
    inputs[:, 1] = WIND_ARM * inputs[:, 0]
    return inputs


def setup_drawer(peak_lateral_acceleration: float, driver_in_loop: bool = False) -> DrawSetup:
    """The ``draw_setup`` on winding roads with curvatures up to a lateral acceleration [m/s2].

    With a driver model in the loop, its hand torque is the first scripted input, zero at first.
    """

    def draw_setup(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
        road = path.winding(rng, context.speed * (DURATION + 2.0), peak_lateral_acceleration / context.speed**2)
        inputs = disturbances(rng, DURATION, options.get("wind", WIND), options.get("road", ROAD))
        return EpisodeSetup(np.insert(inputs, 0, 0.0, axis=1) if driver_in_loop else inputs, path=road)

    return draw_setup


OPTIONS = {
    "wind": (0.0, 2000.0, "standard deviation of the crosswind's force [N]"),
    "road": (0.0, 500.0, "standard deviation of the rough surface's rack force [N]"),
}
BEGINS = (
    "The car drives straight ahead in the middle of the lane at the held speed. The road, with curvatures up to {:g} "
    "m/s2 at that speed, is drawn, and so are the crosswind's force (standard deviation "
    f"{WIND:g} N, correlation time {WIND_CORRELATION:g} s) and the rack force of the rough surface ({ROAD:g} N, "
    f"{1e3 * ROAD_CORRELATION:g} ms)."
)
ENDS = (
    f"The episode fails when the car leaves its lane ({LANE_HALF_WIDTH:g} m to either side) or points across it; it is "
    f"truncated after {DURATION:g} s."
)


def driver_task(name: str, summary: str, *, speed: float, peak_lateral_acceleration: float) -> Task:
    """A task that keeps the lane by hand torque, at a held speed [m/s] on roads with a peak acceleration [m/s2]."""
    return Task(
        name=name,
        summary=summary,
        parameters=DriverLane(LANE_HALF_WIDTH),
        action=HAND_TORQUE,
        channels=DRIVER_CHANNELS,
        task_observations=PATH_OBSERVATIONS,
        rewards=(offset_term(0.7, DRIVER_OFFSET), *COMMON_REWARDS),
        costs=COMMON_COSTS,
        metrics=FOLLOWING_METRICS,
        draw_setup=setup_drawer(peak_lateral_acceleration),
        begins=BEGINS.format(peak_lateral_acceleration),
        ends=ENDS,
        speed=speed,
        scripted_inputs=DISTURBANCES,
        options=OPTIONS,
        memory_size=FOLLOWING_MEMORY,
        lane_half_width=LANE_HALF_WIDTH,
    )


@kernel
def observe(parameters, channels, path, data, step, memory, observations):
    """The ``observe`` of these tasks: the path ahead, as :func:`observe_path` gives it."""
    observe_path(channels, path, step, memory, observations)


@kernel
def evaluate(parameters, channels, observations, data, step, memory, rewards, costs, metrics):
    """The ``evaluate_step`` of the driver tasks: following, and departure from the lane, which ends the episode."""
    evaluate_following(channels, observations, DRIVER_OFFSET, step, memory, rewards, costs, metrics)
    return DEPARTED if has_departed(observations, parameters.half_width) else GOES_ON


@kernel
def evaluate_assist(parameters, channels, observations, data, step, memory, rewards, costs, metrics):
    """The ``evaluate_step`` of the assist task: following, feel, departure from the lane, which ends the episode."""
    progress = evaluate_following(channels, observations, ASSIST_OFFSET, step, memory, rewards, costs, metrics)
    evaluate_added_work(channels, step, costs)
    error = feel_error(channels)
    rewards.feel += progress * feel_quality(error)
    metrics.rms_feel_error = error
    return DEPARTED if has_departed(observations, parameters.half_width) else GOES_ON
