"""Reference feel: the hand torque of a good steering system, as a function of the car's motion.

The torque grows degressively with lateral acceleration and contains a little friction and damping. The gradient on
centre is near the 23 N m/g that drivers preferred (Segel, 1964); the rest is assumed, within the passenger-car ranges
of the weave metrics.
"""

import math

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.constants import GRAVITY

GRADIENT = 20.0  # on centre [N m/g]
SOFTENING = 0.12  # lateral acceleration at which the gradient has fallen to 42 % [g]
FRICTION = 0.5  # half width of the torque-angle loop [N m]
FRICTION_SPEED = 0.05  # handwheel speed at which the friction has reached 76 % [rad/s]
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
