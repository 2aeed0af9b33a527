"""Parameters of the two-track chassis as the kernels take them; :mod:`.from_car` builds and checks them."""

from typing import Any, NamedTuple

import numpy as np

from steer_env.vehicle import road
from steer_env.vehicle.chassis.two_track.brakes import Brakes
from steer_env.vehicle.chassis.two_track.drivetrain import Drivetrain
from steer_env.vehicle.chassis.two_track.speed_hold import SpeedHold


class Body(NamedTuple):
    """Numbers of the chassis; the kernels take them as a record."""

    speed: float  # held speed [m/s]
    mu: float  # factor on the friction of the road [1]
    m: float  # mass [kg]
    m_f: float  # unsprung mass of each front wheel [kg]
    m_r: float  # unsprung mass of each rear wheel [kg]
    a: float  # O to front axle [m]
    b: float  # O to rear axle [m]
    I_x: float  # roll inertia less the part that moves with the travel, sum of m_i y_i^2 [kg m2]
    I_y: float  # pitch inertia less sum of m_i x_i^2 [kg m2]
    I_z: float  # yaw inertia [kg m2]
    I_xz: float  # product of inertia, positive where mass ahead is high [kg m2]
    I_w: float  # inertia of a wheel about its axle [kg m2]
    h: float  # height of O in the design position [m]
    t_f: float  # front track [m]
    t_r: float  # rear track [m]
    R_l: float  # loaded radius in the design position [m]
    R_e: float  # effective rolling radius [m]
    K_t: float  # vertical tyre stiffness [N/m]
    F_zf: float  # load of each front wheel in the design position [N]
    F_zr: float  # load of each rear wheel in the design position [N]
    S_f: float  # force along each front strut in the design position [N]
    K_f: float  # front spring, along the strut [N/m]
    C_f: float  # front damper, along the strut [N s/m]
    S_r: float  # force of each rear spring along the travel in the design position [N]
    K_r: float  # rear spring, along the travel [N/m]
    C_r: float  # rear damper, along the travel [N s/m]
    B_f: float  # front anti-roll bar: force on each wheel over the difference of the travels [N/m]
    B_r: float  # rear anti-roll bar: force on each wheel over the difference of the travels [N/m]
    clearance_f: float  # front travel without contact of a bump stop, either way [m]
    clearance_r: float  # rear travel without contact of a bump stop, either way [m]
    K_stop: float  # stiffness of the bump stops [N/m]
    steer_r: float  # rear steer angle per travel, left wheel [rad/m]
    camber_r: float  # rear inclination per travel, left wheel [rad/m]
    compliance_steer_r: float  # rear steer angle per lateral force on the wheel [rad/N]
    contact_y_r: float  # rear contact-point displacement to the left per travel, left wheel [1]
    K_rack: float  # stiffness between the rack and both road wheels, each with half of it, seen at the rack [N/m]
    F_toe: float  # force of the left wheel on the rack in the design position, at which the toe is set [N]
    T_rack: float  # time constant of the steering compliance [s]
    sigma_x: float  # longitudinal relaxation length [m]
    sigma_y: float  # lateral relaxation length [m]
    stiffness_f: float  # factor on the cornering stiffness of the front tyres [1]
    stiffness_r: float  # factor on the cornering stiffness of the rear tyres [1]
    d_x: float  # longitudinal structural damping of the tyre at standstill, slip over slip speed [s/m]
    d_y: float  # lateral structural damping of the tyre at standstill, slip over slip speed [s/m]
    bore_load: float  # wheel load for which the parameters of the bore friction hold [N]
    sigma_z: float  # rolling distance over which rolling relaxes the state of the bore friction [m]
    g_x: float  # gravity along the road at yaw angle 0, from the grade, positive downhill [m/s2]
    g_y: float  # gravity across the road at yaw angle 0, from the bank, positive to the left [m/s2]
    g_z: float  # gravity normal to the road, positive upwards and therefore negative [m/s2]
    drag: float  # air drag over speed squared [kg/m]
    lift_f: float  # front lift over speed squared [kg/m]
    lift_r: float  # rear lift over speed squared [kg/m]


class TwoTrack(NamedTuple):
    """Parameters of the chassis, its drive, its brakes, its speed hold and its road."""

    body: np.recarray  # one Body
    bore_friction: Any  # friction law of the bore torque over the turning of the contact patch
    drive: Drivetrain
    brakes: Brakes
    hold: SpeedHold
    road: road.Road | road.WheelRoad
