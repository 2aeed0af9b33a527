"""Assist a driver model through a double lane change after ISO 3888-1."""

from steer_env.tasks.common import cones
from steer_env.tasks.common.definition import ASSIST_CHANNELS, ASSIST_TORQUE, Task, register
from steer_env.vehicle.chassis.common.interface import HAND

NAME = "AssistLaneChange"

TASK = register(
    Task(
        name=NAME,
        summary="Assist a driver model through a double lane change after ISO 3888-1.",
        parameters=cones.AssistCones(cones.COURSE_HALF_WIDTH),
        action=ASSIST_TORQUE,
        channels=ASSIST_CHANNELS,
        rewards=cones.ASSIST_REWARDS,
        costs=cones.lane_change_costs(1.5),
        metrics=cones.ASSIST_METRICS,
        draw_setup=cones.setup_drawer(NAME, "double-lane-change"),
        speed=80.0 / 3.6,
        scripted_inputs=(HAND,),
        driver_in_loop=True,
        **cones.SHARED,
    ),
    cones.observe,
    cones.evaluate_assist,
)
