"""Keep a car in its lane on a motorway by hand torque, in crosswind and on a rough surface."""

from steer_env.tasks.common import lane
from steer_env.tasks.common.definition import DRIVER_CHANNELS, HAND_TORQUE, Task, register
from steer_env.tasks.common.path_following import (
    ACTION_REWARDS,
    FOLLOWING_MEMORY,
    FOLLOWING_METRICS,
    FOLLOWING_REWARDS,
    PATH_OBSERVATIONS,
)
from steer_env.tasks.common.terms import COMMON_COSTS

PEAK = 1.0  # lateral acceleration in the road's curves at the held speed [m/s2]

TASK = register(
    Task(
        name="DriverLaneKeeping",
        summary="Keep a car in its lane on a motorway by hand torque, in crosswind and on a rough surface.",
        parameters=lane.DriverLane(lane.LANE_HALF_WIDTH),
        action=HAND_TORQUE,
        channels=DRIVER_CHANNELS,
        task_observations=PATH_OBSERVATIONS,
        rewards=(*FOLLOWING_REWARDS, *ACTION_REWARDS, lane.DEPARTURE),
        costs=COMMON_COSTS,
        metrics=FOLLOWING_METRICS,
        draw_setup=lane.setup_drawer(PEAK),
        begins=lane.BEGINS.format(PEAK),
        ends=lane.ENDS,
        speed=100.0 / 3.6,
        scripted_inputs=lane.DISTURBANCES,
        options=lane.OPTIONS,
        memory_size=FOLLOWING_MEMORY,
        lane_half_width=lane.LANE_HALF_WIDTH,
    ),
    lane.observe,
    lane.evaluate,
)
