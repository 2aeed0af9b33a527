"""One step of the two-track states, the channels that the chassis reports, and the states from which it starts."""

from steer_env.friction.numerics import scratch
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.chassis.common.equilibrium import Unknowns, balance
from steer_env.vehicle.chassis.common.interface import COMMON_OUTPUTS, HAND_BRAKE, extrapolated_step
from steer_env.vehicle.chassis.two_track.brakes import axle_step, brake_torques
from steer_env.vehicle.chassis.two_track.drivetrain import shift
from steer_env.vehicle.chassis.two_track.layout import (
    COMMON_SIZE,
    COMPLIANCE,
    DRIVE,
    GEAR,
    INTEGRAL,
    KAPPA,
    LATERAL_SPEED,
    OMEGA,
    OUTPUT_SIZE,
    PITCH,
    REPORTED_OUTPUTS,
    REPORTED_STATES,
    ROAD_TORQUE,
    ROLL,
    SHIFT_TIME,
    STATE_SIZE,
    TAN_ALPHA,
    THROTTLE,
    THROTTLE_CHANNEL,
    TRAVEL,
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
from steer_env.vehicle.chassis.two_track.wheels import engine_inertias, mean_angular_velocities, pedals_at

_COMMON_OUTPUTS = len(COMMON_OUTPUTS)
_FIRST_OUTPUT = COMMON_SIZE - _COMMON_OUTPUTS  # position of the common outputs among the channels


@kernel
def advance(p, x, rate, rate_before, out, out_before, s, h, u):
    """Advance every state by the Adams-Bashforth rule, except gear and angular velocities.

    A brake may hold a wheel at rest, so each axle takes a set-valued step; the gear changes at the end of the step.
    """
    d = p.body[0]
    omega = x[OMEGA], x[OMEGA + 1], x[OMEGA + 2], x[OMEGA + 3]
    omega_f, omega_r = mean_angular_velocities(x)
    extrapolated_step(x, rate, rate_before, s, h)
    J_f, J_r = engine_inertias(p, x, omega_f, omega_r)
    _, pedal = pedals_at(out, out_before, s, u)
    hold_f, hold_r = brake_torques(p.brakes, pedal, u[HAND_BRAKE])
    for i, drive, J, hold in ((0, DRIVE, J_f, hold_f), (2, DRIVE + 1, J_r, hold_r)):
        half = 0.5 * (out[drive] + s * (out[drive] - out_before[drive]))
        k = ROAD_TORQUE + i
        left = out[k] + s * (out[k] - out_before[k]) + half
        right = out[k + 1] + s * (out[k + 1] - out_before[k + 1]) + half
        x[OMEGA + i], x[OMEGA + i + 1], _, _ = axle_step(d.I_w, J, omega[i], omega[i + 1], left, right, hold, hold, h)
    x[GEAR], x[SHIFT_TIME] = shift(p.drive, x[GEAR], x[SHIFT_TIME], out[THROTTLE], omega_f, omega_r, h)


@kernel
def report(p, x, out, out_before, s, u, row):
    """Fill the channels ``s`` chassis steps after the last evaluation."""
    row[0] = out[LATERAL_SPEED] + s * (out[LATERAL_SPEED] - out_before[LATERAL_SPEED])
    row[1] = out[YAW_RATE] + s * (out[YAW_RATE] - out_before[YAW_RATE])
    row[2] = x[ROLL]
    row[3] = x[YAW]
    row[4] = x[X]
    row[5] = x[Y]
    now, then = out[DRIVE] + out[DRIVE + 1], out_before[DRIVE] + out_before[DRIVE + 1]
    row[6] = (now + s * (now - then)) / p.body[0].R_e
    for i in range(_COMMON_OUTPUTS):
        row[_FIRST_OUTPUT + i] = out[i] + s * (out[i] - out_before[i])
    k = COMMON_SIZE
    for i in REPORTED_STATES:
        row[k] = x[i]
        k += 1
    for i in REPORTED_OUTPUTS:
        row[k] = out[i] + s * (out[i] - out_before[i])
        k += 1
    row[THROTTLE_CHANNEL], row[THROTTLE_CHANNEL + 1] = pedals_at(out, out_before, s, u)


@kernel
def speed(p, x):
    """Forward speed that the assist receives [m/s]."""
    return abs(x[U])


@kernel
def state_size(p):
    """Number of states."""
    return STATE_SIZE


@kernel
def output_size(p):
    """Number of outputs."""
    return OUTPUT_SIZE


@kernel
def _design(p, x):
    """Write the states of straight running at the held speed in the design position."""
    d = p.body[0]
    for i in range(STATE_SIZE):
        x[i] = 0.0
    x[U], x[Z], x[GEAR] = d.speed, d.h, 1.0
    omega = d.speed / d.R_e
    for i in range(4):
        x[OMEGA + i] = omega
    for _ in range(p.drive.ratios.size):
        x[GEAR], _ = shift(p.drive, x[GEAR], 0.0, 0.2, omega, omega, 1.0)


# Vertical balance and toe, which are all that a standing car has; then that of a rolling one, the speed hold last.
_UNKNOWNS = Unknowns(
    at=(
        *(PITCH, Z, TRAVEL, TRAVEL + 2, COMPLIANCE, W, OMEGA, OMEGA + 2),
        *(KAPPA, KAPPA + 2, TAN_ALPHA, TAN_ALPHA + 2, INTEGRAL),
    ),
    mirrored=(
        PITCH,
        Z,
        TRAVEL + 1,
        TRAVEL + 3,
        COMPLIANCE + 1,
        W,
        OMEGA + 1,
        OMEGA + 3,
        KAPPA + 1,
        KAPPA + 3,
        TAN_ALPHA + 1,
        TAN_ALPHA + 3,
        INTEGRAL,
    ),
    signs=(1.0,) * 4 + (-1.0,) + (1.0,) * 5 + (-1.0, -1.0, 1.0),
    rates=(
        *(Q, W, TRAVEL_RATE, TRAVEL_RATE + 2, COMPLIANCE, Z, OMEGA, OMEGA + 2),
        *(KAPPA, KAPPA + 2, TAN_ALPHA, TAN_ALPHA + 2, U),
    ),
    mirrored_rates=(
        *(Q, W, TRAVEL_RATE + 1, TRAVEL_RATE + 3, COMPLIANCE + 1, Z, OMEGA + 1, OMEGA + 3),
        *(KAPPA + 1, KAPPA + 3, TAN_ALPHA + 1, TAN_ALPHA + 3, U),
    ),
    steps=(1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-5, 1e-5, 1e-7, 1e-7, 1e-7, 1e-7, 1e-6),
)
_STANDING, _HOLDING = 5, 13
STRAIGHT = 1e-9  # most sideward and angular acceleration of a car that runs straight [m/s2, rad/s2]


@kernel
def begin(p, strut, tyre, x):
    """Write the states of straight running at the held speed, in balance; whether the car runs straight from there.

    It does not where its sides, or those of the road, differ, as the balance is that of their mean. Nor where there is
    none, as at a speed that the car cannot hold: there it begins in the design position.
    """
    dx, out = scratch.floats(STATE_SIZE), scratch.floats(OUTPUT_SIZE)
    if _straighten(p, strut, tyre, x, dx, out):
        # The rates are those of a state beside the balance, in which left and right are as there.
        return max(abs(dx[V]), abs(dx[P]), abs(dx[R])) < STRAIGHT
    _design(p, x)
    return False


@kernel
def _straighten(p, strut, tyre, x, dx, out):
    """Whether a balance was found, in a gear that stays."""
    _design(p, x)
    if p.body[0].speed == 0.0:
        return balance(p, strut, tyre, x, _UNKNOWNS, _STANDING, dx, out)
    for _ in range(2 * p.drive.ratios.size):
        if balance(p, strut, tyre, x, _UNKNOWNS, _HOLDING, dx, out):
            omega_f, omega_r = mean_angular_velocities(x)
            gear, _ = shift(p.drive, x[GEAR], 0.0, out[THROTTLE], omega_f, omega_r, 1.0)
            if gear == x[GEAR]:
                return True
        else:  # a lower gear may hold the speed
            gear = x[GEAR] - 1.0
            if gear < 1.0:
                return False
            _design(p, x)
        x[GEAR] = gear
    return False
