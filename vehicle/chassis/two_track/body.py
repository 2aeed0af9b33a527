"""Equations of motion of the body and of the unsprung masses.

The equations are Lagrange's in quasi-velocities. Inertia is taken to first order in the travel: the term -v x G of a
frozen inertia cancels with the velocities of the moving masses, and the energy balance closes exactly.
"""

import math
from typing import NamedTuple

from steer_env.friction.numerics.kernel import kernel, part
from steer_env.friction.numerics.simd import load, unpack
from steer_env.vehicle.chassis.common.interface import WIND_FORCE, WIND_MOMENT
from steer_env.vehicle.chassis.two_track.layout import (
    DISTANCE,
    FORCE_X,
    FORCE_Y,
    FRONT_FORCE,
    LATERAL_ACCELERATION,
    LATERAL_SPEED,
    LONGITUDINAL_ACCELERATION,
    LONGITUDINAL_SPEED,
    MOMENT_X,
    MOMENT_Y,
    MOMENT_Z,
    PITCH,
    REAR_FORCE,
    ROLL,
    TRAVEL,
    TRAVEL_FORCE,
    TRAVEL_RATE,
    YAW,
    YAW_RATE,
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
from steer_env.vehicle.chassis.two_track.rotation import to_body


class Load(NamedTuple):
    """Force on the car [N] and moment about O [N m], in the body frame."""

    F_x: float
    F_y: float
    F_z: float
    N_x: float
    N_y: float
    N_z: float


@kernel
def symmetric_sum(x):
    """Sum over the wheels that is the same to the last bit for the mirrored car."""
    fl, fr, rl, rr = unpack(x)
    return (fl + fr) + (rl + rr)


@part
def external_load(d, frame, body, u, upwards, engine, out):
    """Load of wheels, air, wind and gravity on the whole car.

    Parameters
    ----------
    d : Body
    frame : Rotation
    body : Motion
    u : (I,) array
        Inputs.
    upwards : vector of four
        Force of the road on each wheel upwards [N].
    engine : float
        Torque that accelerates the engine [N m].
    out : (O,) array
        Outputs; the accelerations go there.
    """
    speed_2 = body.V_x * body.V_x
    side_force = symmetric_sum(load(out, FORCE_Y)) + u[WIND_FORCE]
    along = symmetric_sum(load(out, FORCE_X)) - math.copysign(d.drag * speed_2, body.V_x)
    F_x = along + d.m * (d.g_x * frame.c_y + d.g_y * frame.s_y)
    F_y = side_force + d.m * (d.g_y * frame.c_y - d.g_x * frame.s_y)
    F_up = symmetric_sum(upwards) + (d.lift_f + d.lift_r) * speed_2 + d.m * d.g_z
    N_x = symmetric_sum(load(out, MOMENT_X))
    N_y = symmetric_sum(load(out, MOMENT_Y)) + engine + (d.b * d.lift_r - d.a * d.lift_f) * speed_2
    N_z = symmetric_sum(load(out, MOMENT_Z)) + u[WIND_MOMENT]
    out[LATERAL_ACCELERATION], out[LONGITUDINAL_ACCELERATION] = side_force / d.m, along / d.m
    out[FRONT_FORCE], out[REAR_FORCE] = out[FORCE_Y] + out[FORCE_Y + 1], out[FORCE_Y + 2] + out[FORCE_Y + 3]
    out[LONGITUDINAL_SPEED], out[LATERAL_SPEED], out[YAW_RATE] = body.V_x, body.V_y, body.W_z
    f_x, f_y, f_z = to_body(frame, F_x, F_y, F_up)
    n_x, n_y, n_z = to_body(frame, N_x, N_y, N_z)
    return Load(f_x, f_y, f_z, n_x, n_y, n_z)


@part
def less_gyroscopic(d, x, load_, omega):
    """The load less the rates of the momenta that turn with the body, F - w x G and N - w x H of (B3)."""
    v_x, v_y, v_z, w_x, w_y, w_z = x[U], x[V], x[W], x[P], x[Q], x[R]
    half_f, half_r = 0.5 * d.t_f, 0.5 * d.t_r
    # Sum and difference of the travel rates of each axle.
    up_f, up_r = x[TRAVEL_RATE] + x[TRAVEL_RATE + 1], x[TRAVEL_RATE + 2] + x[TRAVEL_RATE + 3]
    tilt_f, tilt_r = x[TRAVEL_RATE] - x[TRAVEL_RATE + 1], x[TRAVEL_RATE + 2] - x[TRAVEL_RATE + 3]
    rising = d.m_f * up_f + d.m_r * up_r
    # The momenta are the derivatives of the kinetic energy (B1) by v and w (B2).
    G_x, G_y, G_z = d.m * v_x, d.m * v_y, d.m * v_z + rising
    I_xx = d.I_x + 2.0 * (d.m_f * half_f * half_f + d.m_r * half_r * half_r)
    I_yy = d.I_y + 2.0 * (d.m_f * d.a * d.a + d.m_r * d.b * d.b)
    H_x = I_xx * w_x - d.I_xz * w_z + (d.m_f * half_f * tilt_f + d.m_r * half_r * tilt_r)
    H_y = I_yy * w_y - (d.m_f * d.a * up_f - d.m_r * d.b * up_r) + d.I_w * symmetric_sum(omega)
    H_z = d.I_z * w_z - d.I_xz * w_x
    # (B3)
    return Load(
        load_.F_x - (w_y * G_z - w_z * G_y),
        load_.F_y - (w_z * G_x - w_x * G_z),
        load_.F_z - (w_x * G_y - w_y * G_x),
        load_.N_x - (w_y * H_z - w_z * H_y),
        load_.N_y - (w_z * H_x - w_x * H_z),
        load_.N_z - (w_x * H_y - w_y * H_x),
    )


@part
def accelerations(d, n, out, dx):
    """Accelerations of the body and of the travels to ``dx``, from the load ``n`` and the forces along the travels.

    The travels are eliminated by (B4), which makes the heave and pitch motion and the roll and yaw motion two systems
    of two equations.
    """
    k, half_f, half_r = TRAVEL_FORCE, 0.5 * d.t_f, 0.5 * d.t_r
    Q_f, Q_r = out[k] + out[k + 1], out[k + 2] + out[k + 3]
    heave, pitch = n.F_z - (Q_f + Q_r), n.N_y + (d.a * Q_f - d.b * Q_r)
    roll = n.N_x - (half_f * (out[k] - out[k + 1]) + half_r * (out[k + 2] - out[k + 3]))
    m_s, offset = d.m - 2.0 * (d.m_f + d.m_r), 2.0 * (d.m_f * d.a - d.m_r * d.b)
    per_pitch = 1.0 / (m_s * d.I_y - offset * offset)
    per_roll = 1.0 / (d.I_x * d.I_z - d.I_xz * d.I_xz)
    heave_acceleration = (d.I_y * heave - offset * pitch) * per_pitch
    pitch_acceleration = (m_s * pitch - offset * heave) * per_pitch
    roll_acceleration = (d.I_z * roll + d.I_xz * n.N_z) * per_roll
    dx[U], dx[V], dx[W] = n.F_x / d.m, n.F_y / d.m, heave_acceleration
    dx[P], dx[Q], dx[R] = roll_acceleration, pitch_acceleration, (d.I_x * n.N_z + d.I_xz * roll) * per_roll
    # (B4)
    front = heave_acceleration - d.a * pitch_acceleration
    rear = heave_acceleration + d.b * pitch_acceleration
    dx[TRAVEL_RATE] = out[k] / d.m_f - front - half_f * roll_acceleration
    dx[TRAVEL_RATE + 1] = out[k + 1] / d.m_f - front + half_f * roll_acceleration
    dx[TRAVEL_RATE + 2] = out[k + 2] / d.m_r - rear - half_r * roll_acceleration
    dx[TRAVEL_RATE + 3] = out[k + 3] / d.m_r - rear + half_r * roll_acceleration


@part
def kinematics(frame, body, x, dx):
    """Rates of position, orientation and travel to ``dx`` (B18)."""
    w_x, w_y, w_z = x[P], x[Q], x[R]
    turn = w_y * frame.s_r + w_z * frame.c_r
    # (B18)
    dx[ROLL], dx[PITCH], dx[YAW] = (
        w_x + turn * frame.s_p / frame.c_p,
        w_y * frame.c_r - w_z * frame.s_r,
        turn / frame.c_p,
    )
    dx[X], dx[Y], dx[Z] = (
        body.V_x * frame.c_y - body.V_y * frame.s_y,
        body.V_x * frame.s_y + body.V_y * frame.c_y,
        body.V_z,
    )
    for i in range(4):
        dx[TRAVEL + i] = x[TRAVEL_RATE + i]
    dx[DISTANCE] = body.V_x
