"""Reference feel: the hand torque that a good steering would ask for, as a function of what the car does.

A torque that grows with lateral acceleration, softens, and carries a little friction and damping. The slope on centre
is near the 23 N m/g that drivers have preferred (Segel, 1964); the rest is assumed, within the passenger-car ranges of
the weave metrics.
"""

import math

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.constants import GRAVITY

GRADIENT = 20.0  # on centre [N m/g]
SOFTENING = 0.12  # lateral acceleration at which the slope has fallen to 42 % [g]
FRICTION = 0.5  # half width of the loop [N m]
FRICTION_SPEED = 0.05  # handwheel speed that spans the half width to 76 % [rad/s]
DAMPING = 0.2  # [N m s/rad]


@kernel
def reference_torque(lateral_acceleration, handwheel_speed):
    """Hand torque [N m] at a lateral acceleration [m/s2] and a handwheel speed [rad/s]; odd in both."""
    a = lateral_acceleration / (GRAVITY * SOFTENING)
    return (
        GRADIENT * SOFTENING * math.tanh(a)
        + FRICTION * math.tanh(handwheel_speed / FRICTION_SPEED)
        + DAMPING * handwheel_speed
    )
