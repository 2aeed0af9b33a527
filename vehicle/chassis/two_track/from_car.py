"""Parameters of the two-track chassis from a car."""

import math
from typing import Any

from steer_env.friction import make as make_law
from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.kernel import record
from steer_env.vehicle import road
from steer_env.vehicle.chassis.common.interface import CarData
from steer_env.vehicle.chassis.two_track.parameters import Body, TwoTrack
from steer_env.vehicle.constants import AIR_DENSITY, GRAVITY
from steer_env.vehicle.tyre import Tyre

# Bore torque of a standing tyre after Gough: up to mu F_z^1.5/(3 sqrt p), 144 N m at mu 0.9, 3700 N and 2.2 bar.
BORE_FRICTION, BORE_LOAD, PRESSURE = 0.9, 4000.0, 220e3  # [1], [N], [Pa]
BORE_ANGLE = 0.05  # turning of the contact patch that gives 63 % of that torque, assumed [rad]
BORE_RELAXATION = 0.1  # rolling distance over which it decays, about half a contact length, assumed [m]
SLIP_DAMPING = (0.012, 0.06)  # of standing tyres, some 0.3 of critical on a wheel and on the car; assumed [s/m]


def from_car(car: CarData, v_x: float, mu: float, ground: road.Road | None) -> TwoTrack:
    """Parameters of a car at a held speed [m/s] on a road with a friction factor; None is the level, dry road.

    Raises
    ------
    ValueError
        A wheel or tyre too fast for the chassis step of 2 ms.
    """
    _require_slow(car)
    ground = ground or road.make_road()
    body = _body(car, v_x, mu, ground)
    return TwoTrack(record(body), bore_friction(car.tyre), car.drivetrain, car.brakes, car.speed_hold, ground)


def bore_friction(tyre: Tyre) -> Any:
    """Friction law of the bore torque of a tyre at the load ``BORE_LOAD`` (B16)."""
    pressure = tyre.coefficients.NOMPRES or PRESSURE  # that of the tyre file, if it names one
    saturated = BORE_FRICTION * BORE_LOAD**1.5 / (3.0 * math.sqrt(pressure))  # (B16)
    return make_law("dahl", sigma_0=saturated / BORE_ANGLE, F_c=saturated)  # (B16)


def _require_slow(car: CarData) -> None:
    """Refuse what the chassis step of 2 ms cannot follow; the limits were found by trial."""
    c, tyres = car.chassis, car.tyre
    for name, value, least in (
        (
            "wheel_inertia times the tyre's longitudinal relaxation length [kg m3]",
            c["wheel_inertia"] * tyres.longitudinal_relaxation_length,
            0.13,
        ),
        ("the tyre's lateral relaxation length [m]", tyres.relaxation_length, 0.15),
        ("the inverse of the tyre's vertical stiffness [m/N]", 1.0 / tyres.vertical_stiffness, 1.0 / 1.5e6),
    ):
        number(f"{name} on two tracks", value, minimum=least)


def _body(car: CarData, v_x: float, mu: float, ground: road.Road) -> Body:
    c, tyres, R_l = car.chassis, car.tyre, car.strut.loaded_radius
    m, m_s, a, b = c["mass"], c["sprung_mass"], c["front_axle"], c["rear_axle"]
    m_f, m_r = 0.5 * c["front_unsprung_mass"], 0.5 * (m - m_s - c["front_unsprung_mass"])
    # The sprung centre of gravity, from that of the whole car.
    h = (m_s * c["sprung_height"] + (m - m_s) * R_l) / m
    x_s, z_s, z_w = -2.0 * (m_f * a - m_r * b) / m_s, c["sprung_height"] - h, R_l - h
    g_x, g_y, g_z = (
        -GRAVITY * math.sin(ground.grade),
        -GRAVITY * math.cos(ground.grade) * math.sin(ground.bank),
        -GRAVITY * math.cos(ground.grade) * math.cos(ground.bank),
    )
    F_zf, F_zr = 0.5 * GRAVITY * m * b / (a + b), 0.5 * GRAVITY * m * a / (a + b)
    slope = float(car.strut.straight.per_travel.strut_length)  # negative: shorter in bump
    return Body(
        speed=v_x,
        mu=mu,
        m=m,
        m_f=m_f,
        m_r=m_r,
        a=a,
        b=b,
        I_x=c["roll_inertia"] + m_s * z_s**2 + (m - m_s) * z_w**2,
        I_y=c["pitch_inertia"] + m_s * (x_s**2 + z_s**2) + (m - m_s) * z_w**2,
        I_z=c["yaw_inertia"],
        I_xz=m_s * x_s * z_s + 2.0 * (m_f * a - m_r * b) * z_w,
        I_w=c["wheel_inertia"],
        h=h,
        t_f=c["front_track"],
        t_r=c["rear_track"],
        R_l=R_l,
        R_e=R_l + 2.0 / 3.0 * F_zf / tyres.vertical_stiffness,
        K_t=tyres.vertical_stiffness,
        F_zf=F_zf,
        F_zr=F_zr,
        S_f=(m_f * GRAVITY - F_zf) / slope,
        K_f=c["front_spring"] / slope**2,
        C_f=c["front_damper"] / slope**2,
        S_r=F_zr - m_r * GRAVITY,
        K_r=c["rear_spring"],
        C_r=c["rear_damper"],
        B_f=c["front_anti_roll"] / c["front_track"] ** 2,
        B_r=c["rear_anti_roll"] / c["rear_track"] ** 2,
        clearance_f=c["front_bump_clearance"],
        clearance_r=c["rear_bump_clearance"],
        K_stop=c["bump_stiffness"],
        steer_r=c["rear_bump_steer"],
        camber_r=c["rear_camber_gain"],
        compliance_steer_r=c["rear_lateral_compliance"],
        contact_y_r=2.0 * c["rear_roll_centre"] / c["rear_track"],
        K_rack=car.rack_stiffness(),
        F_toe=_toe_force(car, F_zf, m_f * GRAVITY),
        T_rack=c["compliance_time"],
        sigma_x=tyres.longitudinal_relaxation_length,
        sigma_y=tyres.relaxation_length,
        stiffness_f=c["front_cornering_stiffness_factor"],
        stiffness_r=c["rear_cornering_stiffness_factor"],
        d_x=SLIP_DAMPING[0],
        d_y=SLIP_DAMPING[1],
        bore_load=BORE_LOAD,
        sigma_z=BORE_RELAXATION,
        g_x=g_x,
        g_y=g_y,
        g_z=g_z,
        drag=0.5 * AIR_DENSITY * c["drag_area"],
        lift_f=0.5 * AIR_DENSITY * c["front_lift_area"],
        lift_r=0.5 * AIR_DENSITY * c["rear_lift_area"],
    )


def _toe_force(car: CarData, load: float, weight: float) -> float:
    """Force on the rack of the left wheel of the standing car, by its load and its weight beside the strut [N]."""
    lift = car.strut.straight.at_fixed_strut()
    return float(weight * lift.wheel_centre[2] - load * lift.contact[2])  # (S7), (S9)
