"""Brakes of the wheels, and the step of the angular velocity of a wheel that a brake may hold at rest.

    wheel     I omega' = T - T_b,  |T_b| <= capacity,  T_b = capacity sgn(omega) in motion               (D5)

A wheel's angular velocity is positive where it rolls forward, a torque where it drives forward; a brake torque resists
forward rolling. Source: derived here; the default torques are assumed.
"""

import math
from typing import NamedTuple

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.keys import checked


class Brakes(NamedTuple):
    """Torques that the brakes can hold; :func:`make` checks."""

    front: float  # each front wheel, full pedal [N m]
    rear: float  # each rear wheel, full pedal [N m]
    hand: float  # each rear wheel, hand brake full on [N m]


def make(*, front: float = 1900.0, rear: float = 330.0, hand: float = 900.0) -> Brakes:
    """Checked brakes; torques of each wheel [N m] as in :class:`Brakes`, the defaults assumed for the compact car.

    The full pedal can decelerate the compact car at 1.1 g. The distribution keeps its rear wheels from locking first on
    any road; the hand brake locks the rear wheels.

    Raises
    ------
    ValueError
        Naming the parameter, the value and what is allowed.
    """
    return Brakes(
        checked("brakes", "front", front),
        checked("brakes", "rear", rear),
        checked("brakes", "hand", hand),
    )


@kernel
def brake_torques(b, pedal, hand):
    """Torque that the brake of a front and of a rear wheel can hold [N m]; pedal and hand brake from 0 to 1."""
    return pedal * b.front, pedal * b.rear + hand * b.hand


@kernel
def _torque_beyond_brake(R, capacity):
    """The part of ``R`` that exceeds a brake torque of at most ``capacity``."""
    return math.copysign(max(abs(R) - capacity, 0.0), R)


@kernel
def wheel_step(I, omega, torque, capacity, h):
    """One step of a wheel with a set-valued brake, ``I omega' = torque - T_b`` with ``|T_b| <= capacity``.

    The step is that of :func:`steer_env.friction.law.step` with the Coulomb law, ``S w + T_b = R``, but for the angular
    velocity at the end of the step instead of the mean one. A brake that stops the mean angular velocity would leave
    the wheel turning backwards at its initial speed.

    Parameters
    ----------
    I : float
        Moment of inertia [kg m2].
    omega : float
        Angular velocity at the start [rad/s].
    torque : float
        Mean of all other torques over the step [N m].
    capacity : float
        What the brake can hold, at least 0 [N m].
    h : float
        Step [s].

    Returns
    -------
    omega : float
        Angular velocity at the end, exactly zero where the brake holds the wheel [rad/s].
    T_b : float
        Mean brake torque from the balance [N m]; its product with ``h`` and the mean of both angular velocities closes
        the energy balance.
    """
    S = I / h
    new = _torque_beyond_brake(S * omega + torque, capacity) / S  # (D5)
    return new, torque - S * (new - omega)


@kernel
def axle_step(I, J, omega_l, omega_r, torque_l, torque_r, capacity_l, capacity_r, h):
    """:func:`wheel_step` of two wheels on an open differential that carries an inertia.

    Kinetic energy ``I (omega_l^2 + omega_r^2)/2 + J ((omega_l + omega_r)/2)^2/2``. With ``c = J/(4 h)`` and
    ``y = c (w_l + w_r)`` each wheel takes the step of :func:`wheel_step` at ``R - y``; ``y`` is the root of an
    increasing function that is linear between the four values at which a brake starts or stops sliding.

    Parameters
    ----------
    I, J : float
        Moment of inertia of each wheel, and of what turns with the mean angular velocity, at least 0 [kg m2].
    omega_l, omega_r, torque_l, torque_r, capacity_l, capacity_r, h : float
        As in :func:`wheel_step`, left and right.

    Returns
    -------
    omega_l, omega_r, T_b_l, T_b_r : float
        Angular velocities at the end [rad/s] and mean brake torques [N m].
    """
    if capacity_l == 0.0 and capacity_r == 0.0:
        mean, half = h * (torque_l + torque_r) / (2.0 * I + J), h * (torque_l - torque_r) / (2.0 * I)
        return omega_l + (mean + half), omega_r + (mean - half), 0.0, 0.0
    S, c = I / h, 0.25 * J / h
    before = omega_l + omega_r
    R_l, R_r = S * omega_l + c * before + torque_l, S * omega_r + c * before + torque_r
    low, high = -math.inf, math.inf
    for y in (R_l - capacity_l, R_l + capacity_l, R_r - capacity_r, R_r + capacity_r):
        excess = S * y - c * (_torque_beyond_brake(R_l - y, capacity_l) + _torque_beyond_brake(R_r - y, capacity_r))
        if excess <= 0.0:  # equality counts for both bounds, so that backwards is the exact mirror of forwards
            low = max(low, y)
        if excess >= 0.0:
            high = min(high, y)
    beyond, sliding = 0.0, 0.0
    for R, capacity in ((R_l, capacity_l), (R_r, capacity_r)):
        if high <= R - capacity:
            beyond += R - capacity
            sliding += 1.0
        elif low >= R + capacity:
            beyond += R + capacity
            sliding += 1.0
    y = c * beyond / (S + sliding * c)
    new_l, new_r = _torque_beyond_brake(R_l - y, capacity_l) / S, _torque_beyond_brake(R_r - y, capacity_r) / S  # (D5)
    gain = c * (new_l + new_r - before)
    return new_l, new_r, torque_l - S * (new_l - omega_l) - gain, torque_r - S * (new_r - omega_r) - gain
