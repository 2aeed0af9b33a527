"""Two-track chassis: a body with six degrees of freedom and four wheels that move up and down in it and rotate.

The body frame has x forward, y left and z up, and its origin O is the centre of gravity of the car in the design
position. The unsprung mass m_i at (x_i, y_i) moves along the z axis of the body with the travel s_i. With the velocity
v and the angular velocity w of the body, and the angular velocity Omega_i of a wheel about its axle,

    T = m v^2/2 + w I w/2 + sum m_i s_i' (v_z + w_x y_i - w_y x_i) + sum m_i s_i'^2/2 + sum I_w Omega_i^2/2   (B1)
    G = dT/dv,      H = dT/dw                                                                                 (B2)
    G' = F - w x G,  H' = N - w x H                                                                           (B3)

and for each travel d/dt(dT/ds_i') = Q_i, which is (B4); Q_i (B9) contains the force m_i (v_x w_y - v_y w_x) that the
motion of the frame adds.
The generalised forces follow from the virtual work of the tyre forces on the velocities that define slip and tyre
compression. Spring, damper, anti-roll bar and bump stop act along the travel. Lateral forces do work on the path of the
contact point (roll centre), longitudinal forces on that of the wheel centre, and brake torques on the pitch of the
wheel carrier (anti-dive).

Each file holds one step: ``rotation``, ``suspension``, ``contact``, ``tyres``, ``wheels`` and ``body``, which
``derivative`` calls in turn; ``drivetrain``, ``brakes`` and ``speed_hold`` hold the parameters and kernels of these
parts. The numbers are those of docs/model.md.

Source: derived here; the parameters are in the data file of the car.
"""

from steer_env.vehicle.chassis.common.interface import SPEED_MAX, WHEELS, register
from steer_env.vehicle.chassis.two_track.derivative import derivative
from steer_env.vehicle.chassis.two_track.from_car import from_car
from steer_env.vehicle.chassis.two_track.layout import (
    BORE_ANGLE,
    CHANNELS,
    COMPLIANCE,
    DISTANCE,
    GEAR,
    INTEGRAL,
    KAPPA,
    MEANINGS,
    OMEGA,
    OUTPUTS,
    PITCH,
    ROLL,
    SHIFT_TIME,
    STATES,
    TAN_ALPHA,
    TRAVEL,
    TRAVEL_RATE,
    YAW,
    P,
    Q,
    R,
    U,
    V,
    W,
    X,
    Y,
    Z,
)
from steer_env.vehicle.chassis.two_track.parameters import Body, TwoTrack
from steer_env.vehicle.chassis.two_track.step import advance, begin, output_size, report, speed, state_size

__all__ = [
    "BORE_ANGLE",
    "CHANNELS",
    "COMPLIANCE",
    "DISTANCE",
    "GEAR",
    "INTEGRAL",
    "KAPPA",
    "OMEGA",
    "OUTPUTS",
    "PITCH",
    "ROLL",
    "SHIFT_TIME",
    "STATES",
    "TAN_ALPHA",
    "TRAVEL",
    "TRAVEL_RATE",
    "WHEELS",
    "YAW",
    "Body",
    "P",
    "Q",
    "R",
    "TwoTrack",
    "U",
    "V",
    "W",
    "X",
    "Y",
    "Z",
    "derivative",
    "report",
]

register(
    "two_track",
    TwoTrack,
    states=STATES,
    outputs=OUTPUTS,
    channels=CHANNELS,
    speeds=(0.0, SPEED_MAX),
    from_car=from_car,
    begin=begin,
    derivative=derivative,
    advance=advance,
    report=report,
    speed=speed,
    state_size=state_size,
    output_size=output_size,
    meanings=MEANINGS,
)
