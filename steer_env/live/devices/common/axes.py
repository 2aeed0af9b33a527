"""From the axes of a device to an angle and to pedals."""

import math

from steer_env.friction.numerics.bounds import within


def wheel_angle(value: float, low: float, high: float, degrees: float) -> float:
    """Angle [rad], left positive, of an axis whose ends are a wheel's locks, so many degrees apart; right is high."""
    return math.radians(degrees) * (0.5 - (value - low) / (high - low))


def pedal(value: float, rest: float, full: float) -> float:
    """How far a pedal is pressed, 0 to 1, whose axis reads ``rest`` and ``full`` at its ends."""
    return within((value - rest) / (full - rest), 0.0, 1.0)
