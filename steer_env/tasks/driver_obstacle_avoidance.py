"""Swerve around an obstacle after ISO 3888-2 by hand torque; the throttle is released on entry."""

from steer_env.tasks.common import cones
from steer_env.tasks.common.definition import DRIVER_CHANNELS, HAND_TORQUE, Task, register
from steer_env.tasks.common.terms import COMMON_COSTS
from steer_env.vehicle.chassis.common.interface import COAST

NAME = "DriverObstacleAvoidance"

TASK = register(
    Task(
        name=NAME,
        summary="Swerve around an obstacle after ISO 3888-2 by hand torque; the throttle is released on entry.",
        parameters=cones.DriverCones(cones.COURSE_HALF_WIDTH),
        action=HAND_TORQUE,
        channels=DRIVER_CHANNELS,
        rewards=cones.DRIVER_REWARDS,
        costs=COMMON_COSTS,
        metrics=cones.DRIVER_METRICS,
        draw_setup=cones.setup_drawer(NAME, "obstacle-avoidance", coasts=True),
        speed=50.0 / 3.6,
        scripted_inputs=(COAST,),
        chassis=("two_track", "single_track"),
        **cones.SHARED,
    ),
    cones.observe,
    cones.evaluate,
)
