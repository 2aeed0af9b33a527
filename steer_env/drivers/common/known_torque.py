"""What a driver knows of the torque that a motion of the handwheel needs, from the car that he is used to.

    T_need = K_slip alpha + C angle' + I angle'',   alpha = angle - (v_y + a r)/(v i_s)

alpha is the front axle's slip angle, at the handwheel: in a quick swerve the slip, and with it the torque, leads the
lateral acceleration. I is the inertia of the column. K_slip and C, with all that assist and friction add, are those of
a sine that the car itself answers to.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.randomise import Conditions
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]

# Of the sine: a brisk lane change. Assists are progressive, so a gentler motion needs more torque per angle.
FREQUENCY, ACCELERATION, LARGEST_ANGLE = 0.7, 3.0, 1.0  # assumed [Hz], [m/s2], [rad]

# Conditions, amplitude [rad], frequency [Hz] -> hand torque, lateral speed and yaw rate over handwheel angle (3,).
Response = Callable[[Conditions, float, float], NDArray[np.complex128]]


class KnownTorque(NamedTuple):
    """Hand torque over what it is needed for."""

    angle: float  # [N m/rad]
    speed: float  # [N m s/rad]
    acceleration: float  # [kg m2]
    lateral_speed: float  # [N s]
    yaw_rate: float  # [N m s/rad]


def acceleration_gain(car: Car, speed: float) -> float:
    """Lateral acceleration over handwheel angle of the linear car in a steady turn [m/s2/rad].

    An oversteering car counts as neutral, because its gain is infinite at the critical speed.
    """
    from steer_env.vehicle import linear  # here, because it takes longer to import than an environment

    model = linear.from_car(car, speed)
    per_acceleration = (model.front_axle + model.rear_axle) / speed**2 + max(model.understeer_gradient(), 0.0)  # (L4)
    return model.steering_ratio / per_acceleration


def known_torque(car: Car, conditions: Conditions, response: Response) -> KnownTorque:
    """The torque that a driver knows to be needed in some conditions, from the car's response to a sine.

    ``car`` is the car with the conditions' load.
    """
    speed, omega = conditions.speed, 2.0 * np.pi * FREQUENCY
    ahead = car.chassis["front_axle"]
    amplitude = min(ACCELERATION / acceleration_gain(car, speed), LARGEST_ANGLE)
    torque, lateral_speed, yaw_rate = response(conditions, amplitude, FREQUENCY)
    by_speed = 1.0 / (speed * car.steering_gain())
    alpha = 1.0 - by_speed * (lateral_speed + ahead * yaw_rate)
    inertia = car.column.I1 + car.column.I2
    rest = torque + inertia * omega**2
    stiffness = rest.real / alpha.real
    damping = (rest.imag - stiffness * alpha.imag) / omega
    return KnownTorque(stiffness, damping, inertia, -stiffness * by_speed, -stiffness * by_speed * ahead)
