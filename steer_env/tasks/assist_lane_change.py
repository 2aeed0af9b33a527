"""Assist a driver model through a double lane change after ISO 3888-1."""

from steer_env.tasks.common import cones
from steer_env.tasks.common.definition import ASSIST_TORQUE, ASSISTING, Task, register
from steer_env.tasks.common.feel import FEEL_REWARDS
from steer_env.tasks.common.path_following import FOLLOWING_REWARDS
from steer_env.vehicle.chassis.common.interface import HAND

NAME = "AssistLaneChange"

TASK = register(
    Task(
        name=NAME,
        summary="Assist a driver model through a double lane change after ISO 3888-1.",
        rules=cones.AssistedCones(cones.LEFT_COURSE),
        action=ASSIST_TORQUE,
        channels=ASSISTING,
        rewards=(*FOLLOWING_REWARDS, *FEEL_REWARDS, *cones.LOSSES),
        start=cones.starter(NAME, "double-lane-change"),
        speed=80.0 / 3.6,
        scripted=(HAND,),
        person=True,
        **cones.SHARED,
    ),
    cones.look,
    cones.judge_assist,
)
