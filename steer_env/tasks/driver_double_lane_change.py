"""Drive a double lane change after ISO 3888-1 by hand torque without touching a cone."""

from typing import NamedTuple

from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common import cones
from steer_env.tasks.common.definition import DRIVER_CHANNELS, HAND_TORQUE, Cost, Task, register
from steer_env.tasks.common.terms import COMMON_COSTS
from steer_env.vehicle.chassis.common.interface import COAST
from steer_env.vehicle.plant import CHANNEL

NAME = "DriverDoubleLaneChange"
HAND_SPEED_LIMIT = 2.0  # above it steering is hectic, assumed [rad/s]

_HAND_SPEED = CHANNEL["handwheel_speed"]


class CalmDriver(NamedTuple):
    """Parameters of the task."""

    half_width: float  # lateral offset that ends an episode [m]


@kernel
def _evaluate(parameters, channels, observations, data, step, memory, rewards, costs, metrics):
    if abs(channels[_HAND_SPEED]) > HAND_SPEED_LIMIT:
        costs.hand_speed += step.dt
    return cones.evaluate(parameters, channels, observations, data, step, memory, rewards, costs, metrics)


TASK = register(
    Task(
        name=NAME,
        summary="Drive a double lane change after ISO 3888-1 by hand torque without touching a cone.",
        parameters=CalmDriver(cones.COURSE_HALF_WIDTH),
        action=HAND_TORQUE,
        channels=DRIVER_CHANNELS,
        rewards=cones.DRIVER_REWARDS,
        # What the preview drivers keep at the usual speed; the swerve of obstacle avoidance cannot be driven so calmly.
        costs=(
            *COMMON_COSTS,
            Cost("hand_speed", 0.35, "s", f"time with a handwheel speed above {HAND_SPEED_LIMIT:g} rad/s"),
        ),
        metrics=cones.DRIVER_METRICS,
        draw_setup=cones.setup_drawer(NAME, "double-lane-change"),
        speed=80.0 / 3.6,
        scripted_inputs=(COAST,),
        **cones.SHARED,
    ),
    cones.observe,
    _evaluate,
)
