"""Drive a double lane change after ISO 3888-1 by hand torque without touching a cone."""

from steer_env.tasks.common import cones
from steer_env.tasks.common.definition import DRIVER_CHANNELS, HAND_TORQUE, Task, register
from steer_env.vehicle.chassis.common.interface import COAST

NAME = "DriverDoubleLaneChange"

TASK = register(
    Task(
        name=NAME,
        summary="Drive a double lane change after ISO 3888-1 by hand torque without touching a cone.",
        parameters=cones.DriverCones(cones.COURSE_HALF_WIDTH),
        action=HAND_TORQUE,
        channels=DRIVER_CHANNELS,
        rewards=cones.DRIVER_REWARDS,
        costs=cones.CALM_COSTS,
        metrics=cones.DRIVER_METRICS,
        draw_setup=cones.setup_drawer(NAME, "double-lane-change"),
        speed=80.0 / 3.6,
        scripted_inputs=(COAST,),
        **cones.SHARED,
    ),
    cones.observe,
    cones.evaluate,
)
