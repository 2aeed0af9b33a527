"""Time derivative of the single-track chassis, as the sequence of its steps."""

import math
from typing import NamedTuple

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel, part
from steer_env.friction.numerics.simd import broadcast, load, pack, unpack
from steer_env.vehicle import tyre
from steer_env.vehicle.chassis.common.interface import WIND_FORCE, WIND_MOMENT
from steer_env.vehicle.chassis.single_track.layout import (
    COMPLIANCE,
    DRIVE_FORCE,
    LATERAL_SPEED,
    ROLL,
    ROLL_RATE,
    SLIP_FL,
    SLIP_FR,
    SLIP_RL,
    SLIP_RR,
    TRANSFER_F,
    TRANSFER_R,
    YAW,
    YAW_RATE,
    X,
    Y,
)
from steer_env.vehicle.constants import GRAVITY
from steer_env.vehicle.suspension import kinematics_table


class Loads(NamedTuple):
    """Wheel loads, and the static load of a front wheel [N]."""

    fl: float
    fr: float
    rl: float
    rr: float
    static_f: float


class Forces(NamedTuple):
    """Forces of the tyres on the car along x and y of the body [N], and their aligning torques [N m]."""

    X_fl: float
    X_fr: float
    X_rl: float
    X_rr: float
    Y_f: float  # of both front wheels
    Y_r: float
    M_zf: float  # of the front wheels
    M_zr: float
    steer_rl: float  # steer angles of the rear wheels [rad]
    steer_rr: float
    rack: float  # rack force


@part
def wheel_loads(p, x):
    """Static loads, plus the transfer by springs and dampers, plus that through the roll centres (V6), (V7)."""
    phi, phi_rate = x[ROLL], x[ROLL_RATE]
    static_f = 0.5 * GRAVITY * p.m * p.b / (p.a + p.b)  # (V6)
    static_r = 0.5 * GRAVITY * p.m * p.a / (p.a + p.b)  # (V6)
    spring_f = (p.K_f * phi + p.C_f * phi_rate) / p.t_f  # (V7)
    spring_r = (p.K_r * phi + p.C_r * phi_rate) / p.t_r  # (V7)
    transfer_f = within(spring_f + x[TRANSFER_F], -static_f, static_f)  # no further than wheel lift
    transfer_r = within(spring_r + x[TRANSFER_R], -static_r, static_r)
    return Loads(
        fl=static_f - transfer_f,
        fr=static_f + transfer_f,
        rl=static_r - transfer_r,
        rr=static_r + transfer_r,
        static_f=static_f,
    )


@part
def tyre_forces(p, c, left, right, loads, x):
    """Forces of the tyres on car and rack at pure lateral slip, and the rear steer angles that roll and forces make.

    An open differential halves the drive force. Its torque is reacted inboard, so that it acts at the wheel centres.
    So does the rolling resistance, because the bearing of a free wheel cannot transmit its torque.
    """
    phi = x[ROLL]
    lean_r = p.roll_camber_r * phi  # (V14)
    camber = pack(left.inclination + phi, right.inclination + phi, lean_r, lean_r)  # (V10)
    vertical = pack(loads.fl, loads.fr, loads.rl, loads.rr)
    F_x, F_y, M_x, M_y, M_z = tyre.forces_of_four(
        c,
        None,
        load(x, SLIP_FL),
        camber,
        vertical,
        broadcast(p.v_x),
        broadcast(p.mu),
        pack(p.stiffness_f, p.stiffness_f, p.stiffness_r, p.stiffness_r),
    )
    Fx_fl, Fx_fr, Fx_rl, Fx_rr = unpack(F_x)
    Fy_fl, Fy_fr, Fy_rl, Fy_rr = unpack(F_y)
    Mx_fl, Mx_fr, _, _ = unpack(M_x)
    My_fl, My_fr, My_rl, My_rr = unpack(M_y)
    Mz_fl, Mz_fr, Mz_rl, Mz_rr = unpack(M_z)
    Fx_fl += 0.5 * x[DRIVE_FORCE] + My_fl / p.R_w
    Fx_fr += 0.5 * x[DRIVE_FORCE] + My_fr / p.R_w
    Fx_rl += My_rl / p.R_w
    Fx_rr += My_rr / p.R_w
    # The unsprung mass and the anti-roll bar push on the wheels past the struts.
    weight, bar = 0.5 * GRAVITY * p.m_uf, p.B_f * phi
    past_l, past_r = weight - bar, weight + bar  # (S9)
    Mx_fl += kinematics_table.overturning(left, p.R_w, past_l)
    Mx_fr += kinematics_table.overturning(right, p.R_w, past_r)
    rack = kinematics_table.rack_force(left, 0.0, Fx_fl, Fy_fl, loads.fl - past_l, Mx_fl, Mz_fl)
    rack += kinematics_table.rack_force(right, 0.0, Fx_fr, Fy_fr, loads.fr - past_r, Mx_fr, Mz_fr)
    c_l, s_l = math.cos(left.steer_angle), math.sin(left.steer_angle)
    c_r, s_r = math.cos(right.steer_angle), math.sin(right.steer_angle)
    steer_rl = p.roll_steer_r * phi + p.compliance_steer_r * Fy_rl  # (V13)
    steer_rr = p.roll_steer_r * phi + p.compliance_steer_r * Fy_rr  # (V13)
    # The sums over an axle come first: left and right cancel exactly when the car runs straight, and mirror exactly.
    return Forces(
        X_fl=Fx_fl * c_l - Fy_fl * s_l,
        X_fr=Fx_fr * c_r - Fy_fr * s_r,
        X_rl=Fx_rl - Fy_rl * steer_rl,  # rear steer angles are so small that their cosine is 1
        X_rr=Fx_rr - Fy_rr * steer_rr,
        Y_f=(Fx_fl * s_l + Fy_fl * c_l) + (Fx_fr * s_r + Fy_fr * c_r),
        Y_r=(Fx_rl * steer_rl + Fy_rl) + (Fx_rr * steer_rr + Fy_rr),
        M_zf=Mz_fl + Mz_fr,
        M_zr=Mz_rl + Mz_rr,
        steer_rl=steer_rl,
        steer_rr=steer_rr,
        rack=rack,
    )


@kernel
def _slip_rate(p, v_x, v_y, c, s, slip):
    """Rate of the relaxed tan(alpha) from the velocity of the contact point; ``c``, ``s`` of the steer angle (V4)."""
    along = v_x * c + v_y * s
    across = v_y * c - v_x * s
    return (across - abs(along) * slip) / p.sigma_y  # (V4)


@part
def slip_rates(p, left, right, f, x, dx):
    """Rates of the slips of the four tyres to ``dx``."""
    v_y, r = x[LATERAL_SPEED], x[YAW_RATE]
    half_f, half_r = 0.5 * p.t_f, 0.5 * p.t_r
    c_l, s_l = math.cos(left.steer_angle), math.sin(left.steer_angle)
    c_r, s_r = math.cos(right.steer_angle), math.sin(right.steer_angle)
    front_y, rear_y = v_y + p.a * r, v_y - p.b * r
    dx[SLIP_FL] = _slip_rate(p, p.v_x - half_f * r, front_y, c_l, s_l, x[SLIP_FL])
    dx[SLIP_FR] = _slip_rate(p, p.v_x + half_f * r, front_y, c_r, s_r, x[SLIP_FR])
    dx[SLIP_RL] = _slip_rate(p, p.v_x - half_r * r, rear_y, 1.0, f.steer_rl, x[SLIP_RL])
    dx[SLIP_RR] = _slip_rate(p, p.v_x + half_r * r, rear_y, 1.0, f.steer_rr, x[SLIP_RR])


@part
def body_rates(p, f, u, x, dx):
    """Rates of the motion of the body to ``dx``; returns its acceleration A [m/s2] and the lateral force [N].

    Lateral and roll motion share the sprung mass: [[m, -m_s h], [-m_s h, I_xr]] [A, phi''] = [side, roll]. Tyre forces
    pass through the roll axis; the wind acts on the body above it.
    """
    v_y, r, phi, phi_rate = x[LATERAL_SPEED], x[YAW_RATE], x[ROLL], x[ROLL_RATE]
    wind_force = u[WIND_FORCE]
    side_force = f.Y_f + f.Y_r + wind_force
    yaw_moment = (
        p.a * f.Y_f
        - p.b * f.Y_r
        + 0.5 * p.t_f * (f.X_fr - f.X_fl)
        + 0.5 * p.t_r * (f.X_rr - f.X_rl)
        + f.M_zf
        + f.M_zr
        + u[WIND_MOMENT]
    )
    roll_moment = (p.m_s * GRAVITY * p.h - p.K_f - p.K_r) * phi - (p.C_f + p.C_r) * phi_rate - p.h * wind_force
    coupling = p.m_s * p.h
    determinant = p.m * p.I_xr - coupling * coupling
    A = (p.I_xr * side_force + coupling * roll_moment) / determinant  # (V1)
    dx[LATERAL_SPEED] = A - p.v_x * r
    dx[YAW_RATE] = yaw_moment / p.I_z  # (V3)
    dx[ROLL] = phi_rate
    dx[ROLL_RATE] = (coupling * side_force + p.m * roll_moment) / determinant  # (V2)
    c_yaw, s_yaw = math.cos(x[YAW]), math.sin(x[YAW])  # (V12)
    dx[YAW] = r
    dx[X] = p.v_x * c_yaw - v_y * s_yaw
    dx[Y] = p.v_x * s_yaw + v_y * c_yaw
    return A, side_force


@part
def lag_rates(p, f, A, static_f, x, dx):
    """Rates of steering compliance, geometric load transfer and drive force to ``dx``."""
    dx[COMPLIANCE] = (f.rack / p.K_rack - x[COMPLIANCE]) / p.T_rack  # (P3)
    # The roll centre transmits to the body the tyre force less the force that accelerates the axle itself (V8).
    axle_f, axle_r = p.m_uf * A, p.m_ur * A
    dx[TRANSFER_F] = (((f.Y_f - axle_f) * p.h_f + axle_f * p.R_w) / p.t_f - x[TRANSFER_F]) / p.T_load
    dx[TRANSFER_R] = (((f.Y_r - axle_r) * p.h_r + axle_r * p.R_w) / p.t_r - x[TRANSFER_R]) / p.T_load
    # At constant speed the forces along the body sum to -m v_y r; the drive force changes until they do (V5). The grip
    # of the front axle bounds it: without a bound, the drive force of steered wheels increases the yaw that it has to
    # work against.
    along = (f.X_fl + f.X_fr) + (f.X_rl + f.X_rr) - p.drag * p.v_x * p.v_x
    grip = 2.0 * p.mu * static_f
    held = within(x[DRIVE_FORCE] - along - p.m * x[LATERAL_SPEED] * x[YAW_RATE], -grip, grip)
    dx[DRIVE_FORCE] = (held - x[DRIVE_FORCE]) / p.T_drive


@kernel
def derivative(p, strut, c, x, rack, rack_rate, u, dx, out):
    """Time derivative of the chassis and the rack force that it makes.

    Parameters
    ----------
    p : SingleTrack
    strut : kinematics_table.KinematicsTable
    c : tyre.MagicFormula
        The tyres; without left-right asymmetry, so that the car runs exactly straight.
    x : (15,) array
        States, as in ``STATES``.
    rack, rack_rate : float
        Rack coordinate, positive where it steers left [m]; its rate has no effect here [m/s].
    u : (I,) array
        Inputs, as in ``steer_env.vehicle.chassis.common.interface.INPUTS``; the wind force acts at the sprung centre of
        gravity.
    dx : (15,) array
        Receives the derivative.
    out : (9,) array
        Receives the values of ``COMMON_OUTPUTS``.

    Returns
    -------
    float
        Rack force, positive where it resists a left turn [N].
    """
    loads = wheel_loads(p, x)
    # Rolling to the right lowers the left wheel in its arch (V9).
    tie_rods = rack - x[COMPLIANCE]
    left = kinematics_table.left_knuckle(strut, tie_rods, -0.5 * p.t_f * x[ROLL])
    right = kinematics_table.right_knuckle(strut, tie_rods, 0.5 * p.t_f * x[ROLL])
    forces = tyre_forces(p, c, left, right, loads, x)
    A, side_force = body_rates(p, forces, u, x, dx)
    slip_rates(p, left, right, forces, x, dx)
    lag_rates(p, forces, A, loads.static_f, x, dx)
    out[0] = side_force / p.m
    out[1], out[2] = left.steer_angle, right.steer_angle
    out[3], out[4], out[5], out[6] = loads.fl, loads.fr, loads.rl, loads.rr
    out[7], out[8] = forces.Y_f, forces.Y_r
    return forces.rack
