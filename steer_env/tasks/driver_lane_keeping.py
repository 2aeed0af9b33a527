"""Keep a car in its lane on a motorway by hand torque, in crosswind and on a rough surface."""

from steer_env.tasks.common import lane
from steer_env.tasks.common.definition import DRIVING, HAND_TORQUE, Task, register
from steer_env.tasks.common.path_following import ACTION_REWARDS, FOLLOWING_FIGURES, FOLLOWING_MEMORY, FOLLOWING_REWARDS
from steer_env.tasks.common.terms import COSTS, SIGHT

PEAK = 1.0  # lateral acceleration in the road's curves at the held speed [m/s2]

TASK = register(
    Task(
        name="DriverLaneKeeping",
        summary="Keep a car in its lane on a motorway by hand torque, in crosswind and on a rough surface.",
        rules=lane.Lane(lane.LANE_HALF_WIDTH),
        action=HAND_TORQUE,
        channels=DRIVING,
        situation=SIGHT,
        rewards=(*FOLLOWING_REWARDS, *ACTION_REWARDS, lane.DEPARTURE),
        costs=COSTS,
        figures=FOLLOWING_FIGURES,
        start=lane.starter(PEAK),
        begins=lane.BEGINS.format(PEAK),
        ends=lane.ENDS,
        speed=100.0 / 3.6,
        scripted=lane.DISTURBANCES,
        options=lane.OPTIONS,
        memory=FOLLOWING_MEMORY,
        lane_half_width=lane.LANE_HALF_WIDTH,
    ),
    lane.look,
    lane.judge,
)
