"""Assist a driver model that keeps its lane on a winding road, in crosswind and on a rough surface."""

from steer_env.tasks.common import lane
from steer_env.tasks.common.definition import ASSIST_TORQUE, ASSISTING, Task, register
from steer_env.tasks.common.feel import FEEL_REWARDS
from steer_env.tasks.common.path_following import FOLLOWING_FIGURES, FOLLOWING_MEMORY, FOLLOWING_REWARDS
from steer_env.tasks.common.terms import COSTS, SIGHT
from steer_env.vehicle.chassis.common.interface import HAND

PEAK = 2.0  # lateral acceleration in the road's curves at the held speed [m/s2]

TASK = register(
    Task(
        name="AssistLaneKeeping",
        summary="Assist a driver model that keeps its lane on a winding road, in crosswind and on a rough surface.",
        rules=lane.AssistedLane(lane.LANE_HALF_WIDTH),
        action=ASSIST_TORQUE,
        channels=ASSISTING,
        situation=SIGHT,
        rewards=(*FOLLOWING_REWARDS, *FEEL_REWARDS, lane.DEPARTURE),
        costs=COSTS,
        figures=FOLLOWING_FIGURES,
        start=lane.starter(PEAK, held=True),
        begins=lane.BEGINS.format(PEAK),
        ends=lane.ENDS,
        speed=100.0 / 3.6,
        scripted=(HAND, *lane.DISTURBANCES),
        person=True,
        options=lane.OPTIONS,
        memory=FOLLOWING_MEMORY,
        lane_half_width=lane.LANE_HALF_WIDTH,
    ),
    lane.look,
    lane.judge_assist,
)
