"""Observer of the rack force: what the motor gives and the rack does not do is what tyres and friction take.

    d = T_m - C2 w2 - I2 w2'                       over a sample, the sum of rack force and friction       (W13)
    F' = omega_o ((d - L T_law(w2))/r_p - F),   L = 1 + (c |T_m| + l r_p |F|)/F_c                          (W14)

T_law is a friction law that the rack turns, by which the observer knows of friction; ``viscous,sigma_2=0`` is none. c
is the torque that the gear loses over the motor's, and l the growth of the friction over the rack's torque.

Source: disturbance observers of servo drives (Ohnishi); its numbers are assumed.
"""

import math
from typing import Any, NamedTuple

from steer_env.friction.law import advance
from steer_env.friction.law import torque as law_torque
from steer_env.friction.numerics.kernel import kernel

STATES = (
    ("estimated_rack_force", "N"),
    ("actuator_torque_before", "N m"),
    ("pinion_angle_before", "rad"),
    ("pinion_speed_before", "rad/s"),
)
FORCE, TORQUE_BEFORE, ANGLE_BEFORE, SPEED_BEFORE, MEMORY = range(5)


class Rack(NamedTuple):
    """What a controller knows of the rack, seen at the pinion."""

    lock: float  # angle at the end stops [rad]
    limit: float  # largest torque of the actuator [N m]
    inertia: float  # I2 [kg m2]
    damping: float  # C2 [N m s/rad]
    radius: float  # r_p [m]


class Observer(NamedTuple):
    """Parameters as the kernels take them."""

    rack: Rack
    decay: float  # share of what is left that remains after a sample [1]
    law: Any  # of the friction that it knows of
    law_size: int  # floats that the law remembers
    sliding: float  # F_c [N m]
    gear_loss: float  # c [1]
    load: float  # l [1]


@kernel
def observe(p, x, memory, torque, angle, speed, h):
    """Estimated rack force [N], positive where it resists a left turn, after a sample ``h`` [s].

    ``torque`` is that of the motor [N m], ``angle`` and ``speed`` those of the rack, all at the pinion at the sample.
    """
    given, moving = 0.5 * (torque + x[TORQUE_BEFORE]), (angle - x[ANGLE_BEFORE]) / h
    left = given - p.rack.damping * moving - p.rack.inertia * (speed - x[SPEED_BEFORE]) / h  # (W13)
    x[TORQUE_BEFORE], x[ANGLE_BEFORE], x[SPEED_BEFORE] = torque, angle, speed
    grown = p.gear_loss * abs(given) + p.load * p.rack.radius * abs(x[FORCE])
    scale = 1.0 + grown / p.sliding if p.sliding > 0.0 else 1.0
    advance(p.law, scale, memory, moving, h)
    wanted = (left - law_torque(p.law, scale, memory, moving)) / p.rack.radius
    x[FORCE] = wanted + p.decay * (x[FORCE] - wanted)  # (W14)
    return x[FORCE]


def decay(bandwidth: float, h: float) -> float:
    """What remains after a sample ``h`` [s] of a difference that goes with a bandwidth [Hz]."""
    return math.exp(-2.0 * math.pi * bandwidth * h)
