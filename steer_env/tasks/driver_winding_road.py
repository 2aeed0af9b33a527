"""Drive along a winding country road by hand torque, in crosswind and on a rough surface."""

from steer_env.tasks.common import lane
from steer_env.tasks.common.definition import register

TASK = register(
    lane.driver_task(
        "DriverWindingRoad",
        "Drive along a winding country road by hand torque, in crosswind and on a rough surface.",
        speed=70.0 / 3.6,
        peak_lateral_acceleration=4.0,
    ),
    lane.observe,
    lane.evaluate,
)
