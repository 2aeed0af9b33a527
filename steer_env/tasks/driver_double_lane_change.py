"""Drive a double lane change after ISO 3888-1 by hand torque, without touching a cone."""

from steer_env.tasks.common import cones
from steer_env.tasks.common.definition import DRIVING, HAND_TORQUE, Task, register
from steer_env.tasks.common.path_following import ACTION_REWARDS, FOLLOWING_REWARDS
from steer_env.vehicle.chassis.common.interface import COAST

NAME = "DriverDoubleLaneChange"

TASK = register(
    Task(
        name=NAME,
        summary="Drive a double lane change after ISO 3888-1 by hand torque, without touching a cone.",
        rules=cones.Cones(cones.LEFT_COURSE),
        action=HAND_TORQUE,
        channels=DRIVING,
        rewards=(*FOLLOWING_REWARDS, *ACTION_REWARDS, *cones.LOSSES),
        start=cones.starter(NAME, "double-lane-change"),
        speed=80.0 / 3.6,
        scripted=(COAST,),
        **cones.SHARED,
    ),
    cones.look,
    cones.judge,
)
