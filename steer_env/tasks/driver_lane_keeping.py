"""Keep a car in its lane on a motorway by hand torque, in crosswind and on a rough surface."""

from steer_env.tasks.common import lane
from steer_env.tasks.common.definition import register

TASK = register(
    lane.driver_task(
        "DriverLaneKeeping",
        "Keep a car in its lane on a motorway by hand torque, in crosswind and on a rough surface.",
        speed=100.0 / 3.6,
        peak_lateral_acceleration=1.0,
    ),
    lane.observe,
    lane.evaluate,
)
