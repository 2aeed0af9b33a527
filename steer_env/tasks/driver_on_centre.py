"""Make the small corrections of straight-ahead driving by hand torque: what friction does decides.

The targets need hand torques about as large as the friction of the steering system. A law that sticks must be pushed
over its friction and then holds by itself; a law without sticking has to be held all the time.
"""

import math

from steer_env.tasks.common import angle_following
from steer_env.tasks.common.definition import (
    DRIVER_CHANNELS,
    HAND_TORQUE,
    Task,
    register,
)
from steer_env.tasks.common.terms import COMMON_COSTS, COMMON_MEMORY

MOVES = angle_following.Moves(duration=20.0, number=10, fastest=0.5)
LARGEST = math.radians(2.0)  # corrections in lane keeping on straight roads are of this size, assumed [rad]
USUAL = {  # sizes of channels, amid those with zero action and under a proportional controller
    "handwheel_angle": 0.015,
    "handwheel_speed": 0.03,
    "torsion_bar_torque": 0.5,
    "lateral_acceleration": 0.1,
    "yaw_rate": 0.004,
    "lateral_speed": 0.007,
}
ERROR_SCALE = math.radians(0.2)  # error at which the quality is 71 %, assumed [rad]


TASK = register(
    Task(
        name="DriverOnCentre",
        summary="Make the small corrections of straight-ahead driving by hand torque, along a target of the angle.",
        parameters=angle_following.AngleTarget(ERROR_SCALE),
        action=HAND_TORQUE._replace(scale=5.0),
        channels=DRIVER_CHANNELS,
        task_observations=angle_following.observations(0.02),
        rewards=angle_following.rewards(ERROR_SCALE),
        costs=COMMON_COSTS,
        metrics=angle_following.METRICS,
        draw_setup=angle_following.setup_drawer(MOVES, lambda _: LARGEST),
        begins=(
            f"The car drives straight ahead at the held speed. {MOVES.number} target angles are drawn within "
            f"{math.degrees(LARGEST):g} deg to both sides, each of which is held for a while."
        ),
        ends=f"The episode is truncated after {MOVES.duration:g} s.",
        speed=100.0 / 3.6,
        memory_size=COMMON_MEMORY,
        usual=USUAL,
        scenery=angle_following.scenery,
    ),
    angle_following.observe,
    angle_following.evaluate,
)
