"""Turn the wheels of a standing car by hand torque, along a target of the handwheel angle."""

from steer_env.tasks.common import angle_following
from steer_env.tasks.common.definition import (
    HAND_TORQUE,
    STEERING_CHANNELS,
    Task,
    register,
)
from steer_env.tasks.common.standstill import CREEPING, TWO_TRACK, USUAL, angle_at_lock
from steer_env.tasks.common.terms import COMMON_COSTS, COMMON_MEMORY

MOVES = angle_following.Moves(duration=24.0, number=6, fastest=5.0)
LOCK_SHARE = 0.9  # of the angle at lock that the targets reach
ERROR_SCALE = 0.2  # error at which the quality is 71 %, assumed [rad]


TASK = register(
    Task(
        name="DriverParking",
        summary="Turn the wheels of a standing car by hand torque, along a target of the handwheel angle.",
        parameters=angle_following.AngleTarget(ERROR_SCALE),
        action=HAND_TORQUE,
        channels=STEERING_CHANNELS,
        task_observations=angle_following.observations(2.0),
        rewards=angle_following.rewards(ERROR_SCALE),
        costs=COMMON_COSTS,
        metrics=angle_following.METRICS,
        draw_setup=angle_following.setup_drawer(MOVES, lambda context: LOCK_SHARE * angle_at_lock(context)),
        begins=(
            f"The car stands with its wheels straight. {MOVES.number} target angles are drawn within nine tenths of "
            "lock to lock."
        ),
        ends=f"The episode is truncated after {MOVES.duration:g} s.",
        speed=0.0,
        speed_range=CREEPING,
        chassis=TWO_TRACK,
        memory_size=COMMON_MEMORY,
        usual=USUAL,
        scenery=angle_following.scenery,
    ),
    angle_following.observe,
    angle_following.evaluate,
)
