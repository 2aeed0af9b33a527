"""Single-track chassis at constant speed, with the two front wheels that load the rack kept apart.

    m (v_y' + v_x r) - m_s h phi'' = sum F_y                                       (lateral)
    I_z r' = a F_yf - b F_yr + track/2 (F_xR - F_xL) + sum M_z + M_wind            (yaw)
    (I_x + m_s h^2) phi'' - m_s h (v_y' + v_x r) = m_s g h phi - K phi - C phi'    (roll)

ISO 8855 axes: x forward, y left, z up; left turns are positive. v_y and r belong to the point of the roll axis below
the centre of gravity. Roll phi is positive to the right, as a left turn makes it. Load transfer, front-wheel travel,
camber and steering compliance follow from roll and tyre forces. The tyres run at pure lateral slip: the drive force
that holds the speed, a few hundred newtons, acts at the front wheel centres; its share of the grip is left out.

Each lag is a state, so that the chassis is an ordinary differential equation without algebraic loops:
tyre relaxation  sigma (tan a)' = v_sy - |v_x| tan a;  geometric load transfer and steering compliance with short
lags; drive force, which integrates until the forces along the body hold the speed or the front axle has no more grip.

Source: equations derived here; parameters in the car's data file.
"""

import math
from typing import NamedTuple

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle import chassis, tyre
from steer_env.vehicle.chassis.common.interface import COMMON_CHANNELS, COMMON_OUTPUTS, WIND_FORCE, WIND_MOMENT
from steer_env.vehicle.constants import GRAVITY
from steer_env.vehicle.simd import broadcast, load, pack, unpack
from steer_env.vehicle.suspension import kinematics_table

# Where each state stands in the chassis' slice of the state array, with its unit.
STATES = (
    ("lateral_speed", "m/s"),
    ("yaw_rate", "rad/s"),
    ("roll_angle", "rad"),
    ("roll_rate", "rad/s"),
    ("slip_front_left", "1"),
    ("slip_front_right", "1"),
    ("slip_rear_left", "1"),
    ("slip_rear_right", "1"),
    ("compliance_travel", "m"),
    ("front_geometric_transfer", "N"),
    ("rear_geometric_transfer", "N"),
    ("drive_force", "N"),
    ("yaw_angle", "rad"),
    ("x", "m"),
    ("y", "m"),
)
(
    LATERAL_SPEED,
    YAW_RATE,
    ROLL,
    ROLL_RATE,
    SLIP_FL,
    SLIP_FR,
    SLIP_RL,
    SLIP_RR,
    COMPLIANCE,
    TRANSFER_F,
    TRANSFER_R,
    DRIVE_FORCE,
    YAW,
    X,
    Y,
) = range(len(STATES))

# Channels that the state supplies, in the order of COMMON_CHANNELS; the outputs follow.
_REPORTED = (LATERAL_SPEED, YAW_RATE, ROLL, YAW, X, Y, DRIVE_FORCE)


class SingleTrack(NamedTuple):
    """Parameters as the kernels take them; built and checked by :mod:`steer_env.vehicle.cars`."""

    v_x: float  # speed [m/s]
    mu: float  # road friction relative to the tyre's measurements [1]
    m: float  # mass [kg]
    m_s: float  # sprung mass [kg]
    m_uf: float  # unsprung mass of the front axle [kg]
    m_ur: float  # unsprung mass of the rear axle [kg]
    a: float  # centre of gravity to front axle [m]
    b: float  # centre of gravity to rear axle [m]
    I_xr: float  # roll inertia about the roll axis, I_x + m_s h^2 [kg m2]
    I_z: float  # yaw inertia [kg m2]
    h: float  # sprung centre of gravity above the roll axis [m]
    t_f: float  # front track [m]
    t_r: float  # rear track [m]
    K_f: float  # roll stiffness of the front axle [N m/rad]
    K_r: float  # of the rear axle [N m/rad]
    C_f: float  # roll damping of the front axle [N m s/rad]
    C_r: float  # of the rear axle [N m s/rad]
    h_f: float  # front roll-centre height [m]
    h_r: float  # rear roll-centre height [m]
    R_w: float  # loaded wheel radius, height of the unsprung masses [m]
    drag: float  # air drag at the speed [N]
    sigma_y: float  # lateral relaxation length [m]
    K_rack: float  # compliance between rack and both road wheels, seen at the rack [N/m]
    T_rack: float  # its time constant [s]
    T_load: float  # time constant of the geometric load transfer [s]
    T_drive: float  # time constant of the speed hold [s]


@kernel
def _slip_rate(p, v_x, v_y, c, s, slip):
    """Rate of the relaxed ``tan`` of a tyre's slip angle, from the velocity of its contact; c, s of the steer angle."""
    along = v_x * c + v_y * s
    across = v_y * c - v_x * s
    return (across - abs(along) * slip) / p.sigma_y


@kernel
def derivative(p, strut, c, x, rack, rack_rate, u, dx, out):
    """Time derivative of the chassis and the rack force that it makes.

    Parameters
    ----------
    p : SingleTrack
    strut : strut_map.StrutMap
    c : tyre.MagicFormula
        The tyres; without left-right asymmetry, so that straight running is straight to the last bit.
    x : (15,) array
        States, as in ``STATES``.
    rack, rack_rate : float
        Rack coordinate, positive where it steers left [m]; its rate has no effect here [m/s].
    u : (I,) array
        Inputs, as in ``steer_env.vehicle.chassis.common.interface.INPUTS``; the wind's force takes hold of the sprung centre of gravity.
    dx : (15,) array
        Receives the derivative.
    out : (9,) array
        Receives the values of ``COMMON_OUTPUTS``.

    Returns
    -------
    float
        Rack force, positive where it resists a left turn [N].
    """
    v_y, r, phi, phi_rate = x[LATERAL_SPEED], x[YAW_RATE], x[ROLL], x[ROLL_RATE]
    half_f, half_r = 0.5 * p.t_f, 0.5 * p.t_r
    wind_force, wind_moment = u[WIND_FORCE], u[WIND_MOMENT]

    # Wheel loads: static, plus the part through springs and dampers, plus the part through the roll centres.
    static_f = 0.5 * GRAVITY * p.m * p.b / (p.a + p.b)
    static_r = 0.5 * GRAVITY * p.m * p.a / (p.a + p.b)
    spring_f = (p.K_f * phi + p.C_f * phi_rate) / p.t_f
    spring_r = (p.K_r * phi + p.C_r * phi_rate) / p.t_r
    transfer_f = within(spring_f + x[TRANSFER_F], -static_f, static_f)  # no further than wheel lift
    transfer_r = within(spring_r + x[TRANSFER_R], -static_r, static_r)
    load_fl, load_fr = static_f - transfer_f, static_f + transfer_f
    load_rl, load_rr = static_r - transfer_r, static_r + transfer_r

    # Rolling to the right lets the left wheel drop in its arch.
    tie_rods = rack - x[COMPLIANCE]
    left = kinematics_table.left(strut, tie_rods, -half_f * phi)
    right = kinematics_table.right(strut, tie_rods, half_f * phi)

    slips = load(x, SLIP_FL)
    camber = pack(left.inclination + phi, right.inclination + phi, 0.0, 0.0)
    loads = pack(load_fl, load_fr, load_rl, load_rr)
    F_x, F_y, M_x, M_y, M_z = tyre.forces_of_four(c, None, slips, camber, loads, broadcast(p.v_x), broadcast(p.mu))
    Fx_fl, Fx_fr, Fx_rl, Fx_rr = unpack(F_x)
    Fy_fl, Fy_fr, Fy_rl, Fy_rr = unpack(F_y)
    Mx_fl, Mx_fr, _, _ = unpack(M_x)
    My_fl, My_fr, My_rl, My_rr = unpack(M_y)
    Mz_fl, Mz_fr, Mz_rl, Mz_rr = unpack(M_z)

    # An open differential halves the drive; its torque is reacted inboard, so it acts at the wheel centres, and so does
    # rolling resistance, which a free wheel's bearing cannot take as a torque.
    Fx_fl += 0.5 * x[DRIVE_FORCE] + My_fl / p.R_w
    Fx_fr += 0.5 * x[DRIVE_FORCE] + My_fr / p.R_w
    Fx_rl += My_rl / p.R_w
    Fx_rr += My_rr / p.R_w
    rack_force = kinematics_table.rack_force(
        left, 0.0, Fx_fl, Fy_fl, load_fl, Mx_fl, Mz_fl
    ) + kinematics_table.rack_force(right, 0.0, Fx_fr, Fy_fr, load_fr, Mx_fr, Mz_fr)

    c_l, s_l = math.cos(left.steer_angle), math.sin(left.steer_angle)
    c_r, s_r = math.cos(right.steer_angle), math.sin(right.steer_angle)
    X_fl, Y_fl = Fx_fl * c_l - Fy_fl * s_l, Fx_fl * s_l + Fy_fl * c_l
    X_fr, Y_fr = Fx_fr * c_r - Fy_fr * s_r, Fx_fr * s_r + Fy_fr * c_r
    # Sums over an axle first: left and right cancel to the bit when the car runs straight, and mirror to the bit.
    Y_f, Y_r = Y_fl + Y_fr, Fy_rl + Fy_rr
    side_force = Y_f + Y_r + wind_force
    yaw_moment = (
        p.a * Y_f
        - p.b * Y_r
        + half_f * (X_fr - X_fl)
        + half_r * (Fx_rr - Fx_rl)
        + (Mz_fl + Mz_fr)
        + (Mz_rl + Mz_rr)
        + wind_moment
    )
    along = (X_fl + X_fr) + (Fx_rl + Fx_rr) - p.drag

    # Lateral and roll motion share the sprung mass: [[m, -m_s h], [-m_s h, I_xr]] [A, phi''] = [side, roll].
    # Tyre forces pass through the roll axis; the wind takes hold of the body above it.
    roll_moment = (p.m_s * GRAVITY * p.h - p.K_f - p.K_r) * phi - (p.C_f + p.C_r) * phi_rate - p.h * wind_force
    coupling = p.m_s * p.h
    determinant = p.m * p.I_xr - coupling * coupling
    A = (p.I_xr * side_force + coupling * roll_moment) / determinant

    dx[LATERAL_SPEED] = A - p.v_x * r
    dx[YAW_RATE] = yaw_moment / p.I_z
    dx[ROLL] = phi_rate
    dx[ROLL_RATE] = (coupling * side_force + p.m * roll_moment) / determinant
    front_y, rear_y = v_y + p.a * r, v_y - p.b * r
    dx[SLIP_FL] = _slip_rate(p, p.v_x - half_f * r, front_y, c_l, s_l, x[SLIP_FL])
    dx[SLIP_FR] = _slip_rate(p, p.v_x + half_f * r, front_y, c_r, s_r, x[SLIP_FR])
    dx[SLIP_RL] = _slip_rate(p, p.v_x - half_r * r, rear_y, 1.0, 0.0, x[SLIP_RL])
    dx[SLIP_RR] = _slip_rate(p, p.v_x + half_r * r, rear_y, 1.0, 0.0, x[SLIP_RR])
    dx[COMPLIANCE] = (rack_force / p.K_rack - x[COMPLIANCE]) / p.T_rack
    # What reaches the body through the roll centre is the tyre force less what moves the axle itself.
    axle_f, axle_r = p.m_uf * A, p.m_ur * A
    dx[TRANSFER_F] = (((Y_f - axle_f) * p.h_f + axle_f * p.R_w) / p.t_f - x[TRANSFER_F]) / p.T_load
    dx[TRANSFER_R] = (((Y_r - axle_r) * p.h_r + axle_r * p.R_w) / p.t_r - x[TRANSFER_R]) / p.T_load
    # At constant speed the forces along the body sum to -m v_y r; the drive moves until they do. No further than the
    # front axle's grip: without a bound the drive of steered wheels feeds the yaw that it has to hold against.
    grip = 2.0 * p.mu * static_f
    held = within(x[DRIVE_FORCE] - along - p.m * v_y * r, -grip, grip)
    dx[DRIVE_FORCE] = (held - x[DRIVE_FORCE]) / p.T_drive
    c_yaw, s_yaw = math.cos(x[YAW]), math.sin(x[YAW])
    dx[YAW] = r
    dx[X] = p.v_x * c_yaw - v_y * s_yaw
    dx[Y] = p.v_x * s_yaw + v_y * c_yaw

    out[0] = side_force / p.m
    out[1] = left.steer_angle
    out[2] = right.steer_angle
    out[3] = load_fl
    out[4] = load_fr
    out[5] = load_rl
    out[6] = load_rr
    out[7] = Y_f
    out[8] = Y_r
    return rack_force


_SIZE = len(STATES)
_OUTPUTS = len(COMMON_OUTPUTS)
_LEAD = len(_REPORTED)


@kernel
def _advance(p, x, rate, before, out, out_before, s, h, u):
    chassis.extrapolated_step(x, rate, before, s, h)


@kernel
def _report(p, x, out, before, s, u, row):
    row[0] = x[LATERAL_SPEED]
    row[1] = x[YAW_RATE]
    row[2] = x[ROLL]
    row[3] = x[YAW]
    row[4] = x[X]
    row[5] = x[Y]
    row[6] = x[DRIVE_FORCE]
    for i in range(_OUTPUTS):
        row[_LEAD + i] = out[i] + s * (out[i] - before[i])


@kernel
def _speed(p, x):
    return p.v_x


@kernel
def _state_size(p):
    return _SIZE


@kernel
def _output_size(p):
    return _OUTPUTS


def _start(p: SingleTrack) -> list[float]:
    return [0.0] * _SIZE


chassis.register(
    "single_track",
    SingleTrack,
    states=STATES,
    outputs=COMMON_OUTPUTS,
    channels=COMMON_CHANNELS,
    start=_start,
    derivative=derivative,
    advance=_advance,
    report=_report,
    speed=_speed,
    state_size=_state_size,
    output_size=_output_size,
)
