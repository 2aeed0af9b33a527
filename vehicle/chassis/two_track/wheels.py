"""Torques of engine, brakes and road on the wheels, and the forces that the wheels transmit to body and rack."""

from typing import NamedTuple

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel, part
from steer_env.friction.numerics.simd import copysign, maximum, minimum, store, unpack, where
from steer_env.vehicle.chassis.common.interface import BRAKE, COAST, HAND_BRAKE, TARGET_SPEED
from steer_env.vehicle.chassis.common.interface import THROTTLE as THROTTLE_INPUT
from steer_env.vehicle.chassis.two_track.brakes import brake_torques
from steer_env.vehicle.chassis.two_track.drivetrain import axle_torques, reflected_inertia
from steer_env.vehicle.chassis.two_track.layout import (
    DRIVE,
    FORCE_X,
    FORCE_Y,
    GEAR,
    HOLD_PEDAL,
    HOLD_THROTTLE,
    INTEGRAL,
    MOMENT_X,
    MOMENT_Y,
    MOMENT_Z,
    OMEGA,
    PEDAL,
    ROAD_TORQUE,
    SHIFT_TIME,
    THROTTLE,
    TRAVEL_FORCE,
    P,
    Q,
    U,
    V,
)
from steer_env.vehicle.chassis.two_track.speed_hold import longitudinal_demand, pedals
from steer_env.vehicle.chassis.two_track.suspension import per_axle, sides
from steer_env.vehicle.suspension import kinematics_table


class AxleTorques(NamedTuple):
    """Drive torque of both wheels of an axle together, and the torque that the brake of each wheel can hold [N m]."""

    drive_f: float
    drive_r: float
    brake_f: float
    brake_r: float


class WheelTorques(NamedTuple):
    """Torques about the axles; each field is a vector of four wheels [N m]."""

    road: float  # of the road on the wheel
    drive: float
    brake: float


@kernel
def from_0_to_1(x):
    """``x``, limited to the range of a pedal."""
    return within(x, 0.0, 1.0)


@kernel
def pedals_at(out, out_before, s, u):
    """Throttle and brake pedal at a row ``u`` of inputs, ``s`` chassis steps after the last evaluation."""
    throttle = from_0_to_1(out[HOLD_THROTTLE] + s * (out[HOLD_THROTTLE] - out_before[HOLD_THROTTLE]))
    pedal = from_0_to_1(out[HOLD_PEDAL] + s * (out[HOLD_PEDAL] - out_before[HOLD_PEDAL]))
    return from_0_to_1(throttle + u[THROTTLE_INPUT]), from_0_to_1(pedal + u[BRAKE])


@kernel
def mean_angular_velocities(x):
    """Mean angular velocity of the wheels of the front and of the rear axle [rad/s]."""
    return 0.5 * (x[OMEGA] + x[OMEGA + 1]), 0.5 * (x[OMEGA + 2] + x[OMEGA + 3])


@kernel
def engine_inertias(p, x, omega_f, omega_r):
    """Inertia of the engine about the mean angular velocity of the front and of the rear axle [kg m2]."""
    J = reflected_inertia(p.drive, x[GEAR], x[SHIFT_TIME] <= 0.0, omega_f, omega_r)
    return p.drive.front_share * J, (1.0 - p.drive.front_share) * J


@part
def torques_of_axles(p, x, u, dx, out):
    """Torques of engine and brakes under the inputs ``u`` and the speed hold, whose integral rate goes to ``dx``."""
    d = p.body[0]
    omega_f, omega_r = mean_angular_velocities(x)
    gear, engaged = x[GEAR], x[SHIFT_TIME] <= 0.0
    throttle = pedal = 0.0
    dx[INTEGRAL] = 0.0
    if u[COAST] <= 0.0:
        demand, dx[INTEGRAL] = longitudinal_demand(p.hold, x[U], d.speed + u[TARGET_SPEED], x[INTEGRAL])
        mass = d.m + 4.0 * d.I_w / (d.R_e * d.R_e)
        throttle, pedal = pedals(p.drive, p.brakes, gear, engaged, demand, mass, d.R_e, omega_f, omega_r)
    out[HOLD_THROTTLE], out[HOLD_PEDAL] = throttle, pedal
    throttle, pedal = from_0_to_1(throttle + u[THROTTLE_INPUT]), from_0_to_1(pedal + u[BRAKE])
    drive_f, drive_r = axle_torques(p.drive, gear, engaged, throttle, omega_f, omega_r)
    brake_f, brake_r = brake_torques(p.brakes, pedal, from_0_to_1(u[HAND_BRAKE]))
    out[THROTTLE], out[PEDAL], out[DRIVE], out[DRIVE + 1] = throttle, pedal, drive_f, drive_r
    return AxleTorques(drive_f, drive_r, brake_f, brake_r)


@part
def wheel_torques(d, axles, forces, omega):
    """Torques about the axle of each wheel. A brake that slides gives its capacity; one that holds gives the torque
    that keeps the wheel at rest.
    """
    capacity = per_axle(axles.brake_f, axles.brake_r)
    drive = per_axle(0.5 * axles.drive_f, 0.5 * axles.drive_r)  # (D3)
    road_torque = forces.M_y - d.R_e * forces.F_x  # (B5)
    held = minimum(maximum(road_torque + drive, -capacity), capacity)
    return WheelTorques(road_torque, drive, where(omega == 0.0, held, copysign(capacity, omega)))


@part
def rack_force(d, carriers, contact, forces, torques, F_up, lifting):
    """Forces of the left and of the right front wheel on the rack, positive where they resist a left turn [N] (S7).

    ``F_up`` is the force of the road on each wheel upwards, ``lifting`` along its travel. The unsprung mass, anti-roll
    bar and bump stop take the part of it that passes the strut.
    """
    knuckle, side = carriers.knuckle, sides()
    past_strut = lifting - carriers.strut_force  # (S9)
    braked = -torques.brake * (1.0 / d.R_e)  # the part of F_x that the brake holds
    left, right, _, _ = unpack(
        kinematics_table.rack_force(
            knuckle,
            side * braked,
            side * (forces.F_x - braked - contact.F_z * contact.slope),
            forces.F_y,
            side * (F_up - past_strut),
            forces.M_x + side * kinematics_table.overturning(knuckle, d.R_l, past_strut),
            forces.M_z,
        )
    )
    return left, right


@part
def forces_on_body(d, frame, x, carriers, contact, slip, forces, torques, out):
    """Force and moment about O of each wheel on the body, and the force along its travel, to ``out`` (B8), (B9).

    Returns the upward force of the road on each wheel, and its part along the travel [N], vectors of four wheels.
    """
    c, s = slip.c, slip.s
    along = forces.F_x * c - forces.F_y * s
    # (B8), the road pushes normal to its surface and pulls along it
    X = along - contact.F_z * contact.slope
    F_up = contact.F_z + along * contact.slope
    Y = forces.F_x * s + forces.F_y * c  # (B8)
    arm = contact.y + contact.camber_offset
    # The load points at the wheel centre, where F_x acts too, as its moment about the axle is the wheel's own; F_y acts
    # on the ground.
    grounded = contact.height * forces.F_y * s  # B of (B8)
    store(out, FORCE_X, X)
    store(out, FORCE_Y, Y)
    store(out, MOMENT_X, arm * F_up - (contact.z - contact.height) * Y + forces.M_x * c)  # (B8)
    store(  # (B8)
        out,
        MOMENT_Y,
        contact.z * X + grounded - contact.x * F_up + forces.M_x * s + torques.brake - torques.drive,
    )
    store(out, MOMENT_Z, contact.x * Y - arm * X + forces.M_z)  # (B8)
    v_x, v_y, w_x, w_y = x[U], x[V], x[P], x[Q]
    # (B9)
    lifting = (
        frame.a33 * F_up
        + carriers.camber_gain * (contact.camber_offset * F_up + forces.M_x)
        + (frame.a13 + carriers.centre_x) * X
        + (frame.a23 + carriers.contact_y) * Y
        + carriers.pitch_gain * (torques.brake + grounded)
    )
    weight = per_axle(d.m_f, d.m_r) * (d.g_z + w_y * v_x - w_x * v_y)
    store(out, TRAVEL_FORCE, lifting - carriers.spring_force + weight)
    return F_up, lifting


@part
def wheel_accelerations(p, x, torques, dx, out):
    """Angular accelerations of the wheels to ``dx`` (B5), (D3).

    The engine speeds up with the wheels. The shafts therefore give the wheels, and the body the opposite, less than
    the engine torque. Returns that difference of both axles [N m].
    """
    d = p.body[0]
    store(out, ROAD_TORQUE, torques.road)
    store(dx, OMEGA, torques.road + torques.drive - torques.brake)  # (B5)
    engine = 0.0
    omega_f, omega_r = mean_angular_velocities(x)
    J_f, J_r = engine_inertias(p, x, omega_f, omega_r)
    for i, J in ((OMEGA, J_f), (OMEGA + 2, J_r)):
        # (D3)
        mean, half = 0.5 * (dx[i] + dx[i + 1]) / (d.I_w + 0.5 * J), 0.5 * (dx[i] - dx[i + 1]) / d.I_w
        engine += J * mean
        dx[i], dx[i + 1] = mean + half, mean - half
    return engine
