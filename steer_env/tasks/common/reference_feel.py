"""Reference feel: the hand torque of a good steering system, as a function of the car's motion.

It is the torque build-up for which the boost of the packaged cars is designed, with a little friction and damping,
which are assumed, within the passenger-car ranges of the weave metrics.
"""

import math

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.steering.torque_build_up import torque_build_up

FRICTION = 0.5  # half width of the torque-angle loop [N m]
FRICTION_SPEED = 0.05  # handwheel speed at which the friction has reached 76 % [rad/s]
DAMPING = 0.2  # [N m s/rad]


@kernel
def reference_torque(lateral_acceleration, handwheel_speed):
    """Hand torque [N m] at a lateral acceleration [m/s2] and a handwheel speed [rad/s]; odd in both."""
    return (
        torque_build_up(lateral_acceleration)
        + FRICTION * math.tanh(handwheel_speed / FRICTION_SPEED)
        + DAMPING * handwheel_speed
    )
