"""Swerve around an obstacle after ISO 3888-2 by hand torque, throttle released on entry."""

from steer_env.tasks.common import cones
from steer_env.tasks.common.definition import DRIVING, HAND_TORQUE, Task, register
from steer_env.tasks.common.path_following import ACTION_REWARDS, FOLLOWING_REWARDS
from steer_env.vehicle.chassis.common.interface import COAST

NAME = "DriverObstacleAvoidance"

TASK = register(
    Task(
        name=NAME,
        summary="Swerve around an obstacle after ISO 3888-2 by hand torque, throttle released on entry.",
        rules=cones.Cones(cones.LEFT_COURSE),
        action=HAND_TORQUE,
        channels=DRIVING,
        rewards=(*FOLLOWING_REWARDS, *ACTION_REWARDS, *cones.LOSSES),
        start=cones.starter(NAME, "obstacle-avoidance", coasts=True),
        speed=50.0 / 3.6,
        scripted=(COAST,),
        chassis=("two_track", "single_track"),
        **cones.SHARED,
    ),
    cones.look,
    cones.judge,
)
