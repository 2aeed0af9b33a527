"""The driver model that holds a speed: a demand from the speed error, and the throttle and brake pedal that meet it.

Source: derived here; the default gains are assumed.
"""

from typing import NamedTuple

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.chassis.two_track.drivetrain import axle_torques, reflected_inertia, throttle_for
from steer_env.vehicle.keys import checked


class SpeedHold(NamedTuple):
    """Gains of the driver that holds a speed; :func:`make` checks."""

    proportional: float  # [1/s]
    integral: float  # [1/s2]
    band: float  # speed error at which the integral works at half its gain [m/s]
    acceleration: float  # largest demand [m/s2]
    deceleration: float  # [m/s2]


def make(
    *,
    proportional: float = 2.0,
    integral: float = 0.1,
    band: float = 0.3,
    acceleration: float = 4.0,
    deceleration: float = 8.0,
) -> SpeedHold:
    """Checked gains, units as in :class:`SpeedHold`; the defaults are assumed.

    Raises
    ------
    ValueError
        Naming the parameter, the value and what is allowed.
    """
    return SpeedHold(
        checked("speed_hold", "proportional", proportional),
        checked("speed_hold", "integral", integral),
        checked("speed_hold", "band", band),
        checked("speed_hold", "acceleration", acceleration),
        checked("speed_hold", "deceleration", deceleration),
    )


@kernel
def longitudinal_demand(s, speed, target, integral):
    """Proportional and integral demand of a driver who holds a speed (D6).

    The gain of the integral decreases with the distance from the target, and the integral stops where the demand is at
    a limit. What engine or brakes cannot deliver therefore does not wind it up.

    Parameters
    ----------
    s : SpeedHold
    speed, target : float
        Along the body [m/s].
    integral : float
        State that the caller integrates, from zero [m/s2].

    Returns
    -------
    demand : float
        Wanted force over mass [m/s2].
    rate : float
        Derivative of the integral [m/s3].
    """
    error = target - speed
    wanted = s.proportional * error + integral
    demand = within(wanted, -s.deceleration, s.acceleration)  # (D6)
    if (wanted - demand) * error > 0.0:
        return demand, 0.0
    return demand, s.integral * error / (1.0 + (error / s.band) ** 2)  # (D6)


@kernel
def pedals(d, b, gear, engaged, demand, mass, radius, omega_front, omega_rear):
    """Throttle and brake pedal, each from 0 to 1, that meet a demand: engine braking first, then the brakes (D7).

    Parameters
    ----------
    d : Drivetrain
    b : Brakes
    gear, engaged, omega_front, omega_rear
        As in :func:`axle_torques`.
    demand : float
        Wanted force over mass [m/s2].
    mass : float
        Of the car, and the inertia of its wheels over the squared radius [kg]; the function adds that of the engine.
    radius : float
        Of the wheels [m].

    Returns
    -------
    throttle, pedal : float
    """
    J = reflected_inertia(d, gear, engaged, omega_front, omega_rear)
    torque = demand * (mass * radius + J / radius)
    front, rear = axle_torques(d, gear, engaged, 0.0, omega_front, omega_rear)
    excess = front + rear - torque
    if excess > 0.0:
        return 0.0, min(excess / (2.0 * (b.front + b.rear)), 1.0)  # (D7)
    return throttle_for(d, gear, torque, omega_front, omega_rear), 0.0  # (D7)
