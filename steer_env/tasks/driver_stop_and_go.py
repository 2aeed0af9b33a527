"""Turn the handwheel as a road asks in stop-and-go traffic, by hand torque, while the car follows a recorded speed.

What is recorded is the speed of a car in dense traffic on a divided motorway (``steer_env/courses/data/SOURCES.md``).
The road is assumed, as the record has no position: level, with bends whose handwheel angle is that of a car that rolls
without slip, and with corrections in the lane on top. Their sizes are chosen so that the targets spread as the recorded
handwheel angle does, by 2.5 deg against 2.7; the recorded hands move faster and rest more.
"""

import math
from collections.abc import Mapping
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from steer_env.courses import path
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common import angle_following
from steer_env.tasks.common.definition import (
    DRIVER_CHANNELS,
    HAND_TORQUE,
    EpisodeContext,
    EpisodeSetup,
    Task,
    register,
)
from steer_env.tasks.common.scripted import update_times
from steer_env.tasks.common.standstill import TWO_TRACK
from steer_env.tasks.common.terms import COMMON_COSTS, COMMON_MEMORY
from steer_env.vehicle.chassis.common.interface import TARGET_SPEED

with files("steer_env.courses").joinpath("data", "stop_and_go.csv").open(encoding="utf-8") as file:
    TIMES, SPEEDS = np.loadtxt(file, delimiter=",", skiprows=1, unpack=True)  # [s], [m/s]
CORRECTIONS = angle_following.Moves(duration=30.0, number=20, fastest=0.5)
BEGINNINGS = float(TIMES[0]), float(TIMES[-1]) - CORRECTIONS.duration  # of episodes [s]
LARGEST = math.radians(2.0)  # correction, assumed [rad]
RADIUS = 400.0  # of the narrowest bend, assumed [m]
# Error at which the quality is 71 %: three steps of the recorded angle. For three seconds at 8 m/s it moves the default
# car aside by 3 cm; assumed [rad].
ERROR_SCALE = math.radians(0.3)
USUAL = {  # sizes of channels, amid those with zero action and under the angle servo
    "handwheel_angle": 0.04,
    "handwheel_speed": 0.03,
    "torsion_bar_torque": 0.5,
    "lateral_acceleration": 0.1,
    "yaw_rate": 0.008,
    "lateral_speed": 0.01,
}


class StopAndGo(NamedTuple):
    """Parameters of the task. The first of the episode's data is the scenario, then come the target angles."""

    scale: float  # error at which the quality is 71 % [rad]


def _draw_scenario(rng: np.random.Generator, options: Mapping[str, float]) -> tuple[int, float]:
    begin = TASK.draw_whole_option(rng, options, "scenario")
    return begin, float(np.interp(begin, TIMES, SPEEDS))


def _draw_setup(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
    t = update_times(CORRECTIONS.duration)
    speed = np.interp(context.scenario + t, TIMES, SPEEDS)
    way = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))))
    road = path.winding(rng, way[-1], 1.0 / RADIUS)
    curvature = np.interp(way, path.SPACING * np.arange(len(road)), road[:, path.CURVATURE])
    wheelbase = context.car.chassis["front_axle"] + context.car.chassis["rear_axle"]
    target = context.car.steering_ratio() * wheelbase * curvature
    target += angle_following.targets(rng, CORRECTIONS, LARGEST)
    return EpisodeSetup((speed - context.speed)[:, None], data=np.append(context.scenario, target))


@kernel
def _observe(parameters, channels, path, data, step, memory, observations):
    angle_following.observe(parameters, channels, path, data[1:], step, memory, observations)


TASK = register(
    Task(
        name="DriverStopAndGo",
        summary="Turn the handwheel as a road asks in stop-and-go traffic, by hand torque, at a recorded speed.",
        parameters=StopAndGo(ERROR_SCALE),
        action=HAND_TORQUE._replace(scale=5.0),
        channels=DRIVER_CHANNELS,
        task_observations=angle_following.observations(0.02),
        rewards=angle_following.rewards(ERROR_SCALE),
        costs=COMMON_COSTS,
        metrics=angle_following.METRICS,
        draw_setup=_draw_setup,
        draw_scenario=_draw_scenario,
        begins=(
            f"The car drives straight ahead at a whole second of a recorded drive, from {TIMES[0]:g} s on, which is "
            f"drawn evenly, and its speed hold follows the recorded speed ({SPEEDS.min():.2g} to {SPEEDS.max():.2g} "
            "m/s; a Lincoln MKZ in dense traffic, Udacity, MIT licence). The target angle is that of an assumed level "
            f"road, drawn with bends of {RADIUS:g} m and more, plus {CORRECTIONS.number} corrections drawn within "
            f"{math.degrees(LARGEST):g} deg to both sides, each of which is held for a while. "
            "Where the car is on that road is not observed."
        ),
        ends=f"The episode is truncated after {CORRECTIONS.duration:g} s.",
        speed=10.0,
        scripted_inputs=(TARGET_SPEED,),
        chassis=TWO_TRACK,
        options={
            "scenario": (*BEGINNINGS, "whole second of the drive at which the episode begins"),
        },
        memory_size=COMMON_MEMORY,
        usual=USUAL,
        scenery=angle_following.scenery,
    ),
    _observe,
    angle_following.evaluate,
)
