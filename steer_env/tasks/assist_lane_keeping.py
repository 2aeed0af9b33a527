"""Assist a driver model that keeps its lane on a winding road, in crosswind and on a rough surface."""

from steer_env.tasks.common import lane
from steer_env.tasks.common.definition import ASSIST_CHANNELS, ASSIST_TORQUE, Task, register
from steer_env.tasks.common.feel_term import FEEL_METRIC, feel_term
from steer_env.tasks.common.path_following import FOLLOWING_MEMORY, FOLLOWING_METRICS, PATH_OBSERVATIONS, offset_term
from steer_env.tasks.common.terms import COMMON_METRICS, COMMON_REWARDS, assist_costs
from steer_env.vehicle.chassis.common.interface import HAND

PEAK = 2.0  # lateral acceleration in the road's curves at the held speed [m/s2]

TASK = register(
    Task(
        name="AssistLaneKeeping",
        summary="Assist a driver model that keeps its lane on a winding road, in crosswind and on a rough surface.",
        parameters=lane.AssistLane(lane.LANE_HALF_WIDTH),
        action=ASSIST_TORQUE,
        channels=ASSIST_CHANNELS,
        task_observations=PATH_OBSERVATIONS,
        rewards=(offset_term(0.2, lane.ASSIST_OFFSET), feel_term(0.5), *COMMON_REWARDS),
        costs=assist_costs(1.0),
        metrics=(*COMMON_METRICS, FEEL_METRIC, *FOLLOWING_METRICS[-2:]),
        draw_setup=lane.setup_drawer(PEAK, driver_in_loop=True),
        begins=lane.BEGINS.format(PEAK),
        ends=lane.ENDS,
        speed=100.0 / 3.6,
        scripted_inputs=(HAND, *lane.DISTURBANCES),
        driver_in_loop=True,
        options=lane.OPTIONS,
        memory_size=FOLLOWING_MEMORY,
        lane_half_width=lane.LANE_HALF_WIDTH,
    ),
    lane.observe,
    lane.evaluate_assist,
)
