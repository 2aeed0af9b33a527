"""Time derivative of the two-track chassis, as the sequence of its steps."""

from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.numerics.simd import load, store, unpack
from steer_env.vehicle.chassis.two_track.body import accelerations, external_load, kinematics, less_gyroscopic
from steer_env.vehicle.chassis.two_track.contact import contact, slip_speeds
from steer_env.vehicle.chassis.two_track.layout import (
    COMPLIANCE,
    F_X,
    F_Y,
    GEAR,
    LOAD,
    M_Z,
    OMEGA,
    SHIFT_TIME,
    STEER_LEFT,
    STEER_RIGHT,
)
from steer_env.vehicle.chassis.two_track.rotation import motion, rotation
from steer_env.vehicle.chassis.two_track.suspension import carriers, per_axle
from steer_env.vehicle.chassis.two_track.tyres import slip_rates, tyre_forces
from steer_env.vehicle.chassis.two_track.wheels import (
    forces_on_body,
    rack_force,
    torques_of_axles,
    wheel_accelerations,
    wheel_torques,
)


@kernel
def derivative(p, strut, c, x, rack, rack_rate, u, dx, out):
    """Time derivative of the chassis and the rack force that it makes.

    Parameters
    ----------
    p : TwoTrack
    strut : kinematics_table.KinematicsTable
    c : tyre.MagicFormula
        The tyres; without left-right asymmetry, so that the car runs exactly straight.
    x : (S,) array
        States, as in ``STATES``.
    rack, rack_rate : float
        Rack coordinate, positive where it steers left [m], and its rate [m/s].
    u : (I,) array
        Inputs, as in ``steer_env.vehicle.chassis.common.interface.INPUTS``.
    dx : (S,) array
        Receives the derivative.
    out : (O,) array
        Receives the values of ``OUTPUTS``.

    Returns
    -------
    float
        Rack force, positive where it resists a left turn [N].
    """
    d = p.body[0]
    frame = rotation(x)
    body = motion(frame, x)
    axles = torques_of_axles(p, x, u, dx, out)

    wheels = carriers(d, strut, rack, rack_rate, body.W_z, x)
    ground = contact(p, frame, body, wheels, x)
    omega, steer = load(x, OMEGA), wheels.steer_angle
    slip = slip_speeds(d, ground, steer, omega)
    forces = tyre_forces(p, c, wheels, ground, slip, x, dx)
    if d.compliance_steer_r != 0.0:
        # (B11) needs the force first; the damping at standstill has used the slip without it.
        steer = steer + per_axle(0.0, d.compliance_steer_r) * forces.F_y
        slip = slip_speeds(d, ground, steer, omega)
    slip_rates(d, c, forces, ground.F_z, slip, x, dx)

    torques = wheel_torques(d, axles, forces, omega)
    F_up, lifting = forces_on_body(d, frame, x, wheels, ground, slip, forces, torques, out)
    left, right = rack_force(d, wheels, ground, forces, torques, F_up, lifting)
    engine = wheel_accelerations(p, x, torques, dx, out)

    total = external_load(d, frame, body, u, F_up, engine, out)
    accelerations(d, less_gyroscopic(d, x, total, omega), out, dx)
    kinematics(frame, body, x, dx)
    dx[COMPLIANCE] = (2.0 * (left - d.F_toe) / d.K_rack - x[COMPLIANCE]) / d.T_rack  # (P6)
    dx[COMPLIANCE + 1] = (2.0 * (right + d.F_toe) / d.K_rack - x[COMPLIANCE + 1]) / d.T_rack  # (P6)
    dx[GEAR] = dx[SHIFT_TIME] = 0.0  # the gear changes in the step, not in the derivative

    out[STEER_LEFT], out[STEER_RIGHT], _, _ = unpack(steer)
    store(out, LOAD, ground.F_z)
    store(out, F_X, forces.F_x)
    store(out, F_Y, forces.F_y)
    store(out, M_Z, forces.M_z)
    return left + right
