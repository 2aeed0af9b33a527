"""Reference feel: the hand torque that a good steering would ask for, as a function of what the car does."""

import math
from typing import NamedTuple

from vehicle.single_track import GRAVITY


class ReferenceFeel(NamedTuple):
    """A torque that grows with lateral acceleration, softens, and carries a little friction and damping.

    The slope on centre is near the 23 N m/g that drivers have preferred (Segel, 1964); the rest is assumed, within the
    passenger-car ranges of the weave metrics.
    """

    gradient: float = 20.0  # on centre [N m/g]
    softening: float = 0.12  # lateral acceleration at which the slope has fallen to 42 % [g]
    friction: float = 0.5  # half width of the loop [N m]
    friction_speed: float = 0.05  # handwheel speed that spans the half width to 76 % [rad/s]
    damping: float = 0.2  # [N m s/rad]

    def torque(self, lateral_acceleration: float, handwheel_speed: float) -> float:
        """Hand torque [N m] at a lateral acceleration [m/s2] and a handwheel speed [rad/s]; odd in both."""
        a = lateral_acceleration / (GRAVITY * self.softening)
        return (
            self.gradient * self.softening * math.tanh(a)
            + self.friction * math.tanh(handwheel_speed / self.friction_speed)
            + self.damping * handwheel_speed
        )
