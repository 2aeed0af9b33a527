"""What a driver knows of the torque that a motion of the handwheel needs, from the car that he is used to.

    T_need = K alpha + C angle' + I angle'',   alpha = angle - (v_y + a r)/(v i_s)

alpha is the front axle's slip angle, at the handwheel: in a quick swerve the slip, and with it the torque, leads the
lateral acceleration. I is the inertia of the column. K and C, with all that assist and friction add, are the least
squares of sines of several frequencies that the car itself answers to, both not negative: at one frequency alpha may
have no part in phase with the angle, and two equations for two unknowns then give anything. A slip whose amplitude is
below ``LEAST_SLIP`` of the angle's, as up to 4 to 9 m/s by car, tells little of the torque, and is a small
difference of what is observed; there K counts the angle itself:

    T_need = K angle + C angle' + I angle''
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.episode.randomise import Conditions
from steer_env.vehicle.cars import Car

Array = NDArray[np.float64]

# Of the sines: up to a brisk lane change. The same acceleration in all, because assists are progressive and a gentler
# motion needs more torque per angle. Errors count by frequency: in slow motions the arms' stiffness corrects them.
FREQUENCIES, ACCELERATION, LARGEST_ANGLE = np.array([0.2, 0.4, 0.7]), 3.0, 1.0  # assumed [Hz], [m/s2], [rad]
LEAST_SLIP = 0.4  # amplitude of the slip over that of the angle, assumed [1]

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
    from steer_env.vehicle.analysis import linear  # here, because it takes longer to import than an environment

    model = linear.from_car(car, speed)
    per_acceleration = (model.front_axle + model.rear_axle) / speed**2 + max(model.understeer_gradient(), 0.0)  # (L4)
    return model.steering_ratio / per_acceleration


def known_torque(car: Car, conditions: Conditions, response: Response) -> KnownTorque:
    """The torque that a driver knows to be needed in some conditions, from the car's response to a sine.

    ``car`` is the car with the conditions' load.
    """
    from scipy.optimize import nnls  # here, because it takes longer to import than an environment

    speed, omega = conditions.speed, 2.0 * np.pi * FREQUENCIES
    ahead = car.chassis["front_axle"]
    amplitude = min(ACCELERATION / acceleration_gain(car, speed), LARGEST_ANGLE)
    torque, lateral_speed, yaw_rate = np.array([response(conditions, amplitude, f) for f in FREQUENCIES]).T
    by_speed = 1.0 / (speed * car.steering_gain(speed))
    alpha = 1.0 - by_speed * (lateral_speed + ahead * yaw_rate)
    if np.linalg.norm(omega * alpha) < LEAST_SLIP * np.linalg.norm(omega):
        by_speed, alpha = 0.0, np.ones_like(alpha)
    inertia = car.column.I1 + car.column.I2
    equations = omega * np.array([alpha, 1j * omega, torque + inertia * omega**2])
    *regressors, rest = np.hstack([equations.real, equations.imag])
    stiffness, damping = nnls(np.column_stack(regressors), rest)[0]
    return KnownTorque(stiffness, damping, inertia, -stiffness * by_speed, -stiffness * by_speed * ahead)
