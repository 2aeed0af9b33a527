"""Assist in everything that an EPS meets: weave, release, parking and lane change, without being told which it is."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import manoeuvres
from steer_env.friction.numerics.kernel import kernel
from steer_env.manoeuvres.release import FREE_TIME, HOLD_TIME, RISE_TIME
from steer_env.tasks import assist_lane_change, assist_parking, assist_release, assist_weave
from steer_env.tasks.common import cones, scripted
from steer_env.tasks.common.definition import (
    ASSIST_CHANNELS,
    ASSIST_TORQUE,
    GOES_ON,
    RMS,
    EpisodeContext,
    EpisodeMetric,
    EpisodeSetup,
    Scenery,
    Task,
    Term,
    register,
)
from steer_env.tasks.common.feel_term import FEEL_SCALE, feel_error, feel_quality
from steer_env.tasks.common.path_following import PATH_OBSERVATIONS, observe_path
from steer_env.tasks.common.standstill import TWO_TRACK
from steer_env.tasks.common.terms import COMMON_METRICS, COMMON_REWARDS, evaluate_added_work, evaluate_common, quality
from steer_env.vehicle.plant import CHANNEL

Array = NDArray[np.float64]

WEAVE, RELEASE, PARKING, LANE_CHANGE = range(4)
SCENARIO_TASKS = (assist_weave.TASK, assist_release.TASK, assist_parking.TASK, assist_lane_change.TASK)
SPEEDS = ((30.0, 180.0), (30.0, 180.0), (0.0, 0.0), (60.0, 85.0))  # held, lowest and highest of each scenario [km/h]
# Of the release: handwheel angles that are held, 0.24 rad is 2 m/s2 at 100 km/h on the compact car [rad], and the angle
# at which the quality of the return is 71 %, assumed [rad].
LOW, HIGH, ANGLE_SCALE = 0.1, 0.5, 0.05
RELEASE_TIME = RISE_TIME + HOLD_TIME  # [s]
FULL_ANGLES = 100.0 / 3.6  # speed above which angles shrink with it, as the car then answers more strongly [m/s]

_ANGLE, _SPEED, _TORQUE = (CHANNEL[name] for name in ("handwheel_angle", "handwheel_speed", "handwheel_torque"))


class AllRound(NamedTuple):
    """Parameters of the task. The first of the episode's data is the scenario, the others are those of its own task."""

    release_time: float  # [s]
    parking_torque: float  # wanted hand torque while the handwheel turns [N m]
    half_width: float  # lateral offset that ends a lane change [m]


def _draw_scenario(rng: np.random.Generator, options: Mapping[str, float]) -> tuple[int, float]:
    scenario, share = TASK.draw_whole_option(rng, options, "scenario"), float(rng.random())
    low, high = SPEEDS[scenario]
    return scenario, (low + share * (high - low)) / 3.6


def _release(amplitude: float) -> EpisodeSetup:
    motion = scripted.hand_motion(manoeuvres.make("release"), amplitude, RELEASE_TIME + FREE_TIME)
    return EpisodeSetup(motion, release_time=RELEASE_TIME)


def _draw_setup(rng: np.random.Generator, context: EpisodeContext, options: Mapping[str, float]) -> EpisodeSetup:
    own: dict[str, float] = {}
    share = min(FULL_ANGLES / max(context.speed, 1.0), 1.0)
    if context.scenario == WEAVE:
        own["amplitude"] = share * float(rng.uniform(*assist_weave.AMPLITUDES))
    if context.scenario == RELEASE:
        setup = _release(float(rng.choice((-share, share)) * rng.uniform(LOW, HIGH)))
        rng.random(2)  # which a seed's sensor noise comes after
    else:
        setup = SCENARIO_TASKS[context.scenario].draw_setup(rng, context, own)
    data = np.zeros(0) if setup.data is None else setup.data
    own_inputs = setup.inputs()
    given = np.zeros((len(own_inputs), len(scripted.HANDS)))
    given[:, : own_inputs.shape[1]] = own_inputs
    return setup._replace(
        scripted_inputs=given, data=np.append(context.scenario, data), robot=SCENARIO_TASKS[context.scenario].robot
    )


@kernel
def _observe(parameters, channels, path, data, step, memory, observations):
    if data[0] == LANE_CHANGE:
        observe_path(channels, path, step, memory, observations)


@kernel
def _evaluate(parameters, channels, observations, data, step, memory, rewards, costs, metrics):
    evaluate_common(channels, step, step.dt, memory, rewards, costs, metrics)
    evaluate_added_work(channels, step, costs)
    scenario = data[0]
    metrics.cones_hit = metrics.rms_feel_error = metrics.rms_released_angle = 0.0
    if scenario == RELEASE and step.time > parameters.release_time:
        metrics.rms_released_angle = channels[_ANGLE]
        rewards.goal += step.dt * quality(channels[_ANGLE] / ANGLE_SCALE)
        return GOES_ON
    if scenario == PARKING:
        error = channels[_TORQUE] - assist_parking.wanted_torque(parameters.parking_torque, channels[_SPEED])
    else:
        error = feel_error(channels)
    metrics.rms_feel_error = error
    rewards.goal += step.dt * feel_quality(error)
    if scenario != LANE_CHANGE:
        return GOES_ON
    touched = cones.newly_touched(channels, data[1:], memory)
    metrics.cones_hit = touched
    costs.cones += touched
    return cones.course_outcome(parameters, channels, observations, data[1:])


def _scenery(channels: Array, observations: Array, data: Array, memory: Array) -> Scenery:
    return cones.scenery(channels, observations, data[1:], memory) if data[0] == LANE_CHANGE else Scenery()


TASK = register(
    Task(
        name="AssistAllRound",
        summary="Assist in a weave, a release, parking or a lane change with a driver model, without being told which.",
        parameters=AllRound(RELEASE_TIME, assist_parking.WANTED, cones.COURSE_HALF_WIDTH),
        action=ASSIST_TORQUE._replace(scale=10.0),
        channels=ASSIST_CHANNELS,
        task_observations=PATH_OBSERVATIONS,
        unseen=len(PATH_OBSERVATIONS),
        rewards=(
            Term(
                "goal",
                0.7,
                "after a release, quality of the handwheel angle, 71 % at "
                f"{ANGLE_SCALE:g} rad; else of the hand torque against the reference feel, in parking "
                f"against {assist_parking.WANTED:g} N m in the direction of turning; 71 % at {FEEL_SCALE:g} N m",
            ),
            *COMMON_REWARDS,
        ),
        costs=cones.lane_change_costs(50.0),
        metrics=(
            *COMMON_METRICS,
            cones.CONE_METRIC,
            EpisodeMetric("rms_feel_error", "N m", RMS, "hand torque minus the wanted one, zero after a release"),
            EpisodeMetric("rms_released_angle", "rad", RMS, "handwheel angle after a release, zero before"),
        ),
        draw_setup=_draw_setup,
        draw_scenario=_draw_scenario,
        begins=(
            "An episode is that of AssistWeave, AssistParking or AssistLaneChange, with their courses and motions, or "
            f"a release: a robot turns the handwheel to {LOW:g} to {HIGH:g} rad, left or right, within {RISE_TIME:g} s "
            "and "
            f"lets go after {RELEASE_TIME:g} s. Each is as likely as the others. The held speed is drawn with it: "
            "{:g} to {:g} km/h in weave and release, where handwheel angles shrink above 100 km/h, standing in "
            "parking, and {:g} to {:g} km/h in the lane change."
        ).format(*SPEEDS[WEAVE], *SPEEDS[LANE_CHANGE]),
        ends=f"The episode ends as that of the task that is drawn, and that of a release {FREE_TIME:g} s after it.",
        speed=100.0 / 3.6,
        speed_range=(0.0, 70.0),
        scripted_inputs=scripted.HANDS,
        robot=True,
        driver_in_loop=True,
        chassis=TWO_TRACK,
        options={"scenario": (0.0, 3.0, "0 weave, 1 release, 2 parking, 3 lane change")},
        memory_size=cones.MEMORY,
        usual={"handwheel_angle": 1.0, "handwheel_speed": 1.0, "column_speed": 1.0, "motor_torque": 6.0},
        scenery=_scenery,
    ),
    _observe,
    _evaluate,
)
