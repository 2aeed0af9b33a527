"""Costs and figures that every task has, and what tasks with a path share."""

import math

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.tasks.common.definition import NODE, PEAK, RMS, SUM, Figure, Quantity, Term
from steer_env.vehicle.plant import CHANNEL

HAND_TORQUE_LIMIT = 8.0  # beyond it steering is heavy work at speed, assumed [N m]
SIDESLIP_LIMIT = math.radians(5.0)  # lateral over forward speed; passenger-car drivers hold less, assumed
JERK_LIMIT = 15.0  # lateral, some three times what a brisk lane change asks for on centre, assumed [m/s3]

COSTS = (
    Term("hand_torque", 1.0, "s", f"time with a hand torque above {HAND_TORQUE_LIMIT:g} N m"),
    Term("stability", 1.0, "s", "time with a sideslip angle above 5 deg"),
    Term("comfort", 1.0, "s", f"time with a lateral jerk above {JERK_LIMIT:g} m/s3"),
)
FIGURES = (
    Figure("peak_lateral_acceleration", "m/s2", PEAK, "of the centre of gravity"),
    Figure("peak_sideslip", "rad", PEAK, "lateral over forward speed"),
    Figure("rms_hand_torque", "N m", RMS, "what the hands feel"),
    Figure("rms_handwheel_speed", "rad/s", RMS, "how busy they are"),
    Figure("steering_work", "J", SUM, "of the hands, either way"),
)
MEMORY = 2  # floats at the start of a task's memory: the last node's lateral acceleration, and whether there was one

PREVIEW = tuple(0.1 * k for k in range(1, 16))  # [s]; published preview drivers look 1.0 to 1.5 s ahead
SIGHT = (
    Quantity("lateral_offset", "m", 5.0, "from the path, left of it positive"),
    Quantity("heading_error", "rad", math.pi, "against the path, left positive"),
    *(
        Quantity(f"path_{t:.1f}s", "m", 30.0, f"lateral place of the path {t:.1f} s ahead in the car's frame")
        for t in PREVIEW
    ),
)

_TORQUE, _SPEED = CHANNEL["handwheel_torque"], CHANNEL["handwheel_speed"]
_ACCELERATION, _LATERAL_SPEED = CHANNEL["lateral_acceleration"], CHANNEL["lateral_speed"]


@kernel
def judge_common(row, now, memory, costs, figures):
    """Adds the common costs and figures; they stand first in both."""
    torque, acceleration = row[_TORQUE], row[_ACCELERATION]
    # A car that stands has no sideslip angle.
    sideslip = abs(row[_LATERAL_SPEED]) / within(now.speed, 1.0, math.inf)
    if abs(torque) > HAND_TORQUE_LIMIT:
        costs[0] += now.dt
    if sideslip > SIDESLIP_LIMIT:
        costs[1] += now.dt
    nodes = now.time / NODE
    if abs(nodes - math.floor(nodes + 0.5)) < 0.01:  # between them the channel is extrapolated, with kinks
        if memory[1] > 0.0 and abs(acceleration - memory[0]) > JERK_LIMIT * NODE:
            costs[2] += NODE
        memory[0], memory[1] = acceleration, 1.0
    figures[0] = acceleration
    figures[1] = sideslip
    figures[2] = torque
    figures[3] = row[_SPEED]
    figures[4] = abs(torque * row[_SPEED]) * now.dt
