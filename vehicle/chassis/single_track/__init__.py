"""Single-track chassis at constant speed, with four wheels that have a load and a slip each.

    m (v_y' + v_x r) - m_s h phi'' = sum F_y                                       (V1)
    (I_x + m_s h^2) phi'' - m_s h (v_y' + v_x r) = m_s g h phi - K phi - C phi'    (V2)
    I_z r' = a F_yf - b F_yr + track/2 (F_xR - F_xL) + sum M_z + M_wind            (V3)

ISO 8855 axes: x forward, y left, z up; left turns are positive. v_y and r belong to the point of the roll axis below
the centre of gravity. The roll angle phi is positive to the right, as in a left turn. Load transfer, front-wheel
travel, camber and steering compliance follow from roll and tyre forces. The tyres run at pure lateral slip: the drive
force that holds the speed, a few hundred newtons, acts at the front wheel centres, and its share of the grip is left
out.

Each lag is a state, so that the chassis is an ordinary differential equation without algebraic loops: the relaxation of
the tyres (V4), the geometric load transfer and the steering compliance with short time constants, and the drive force,
which integrates until the forces along the body hold the speed or the front axle has no more grip (V5).

docs/model.md numbers the equations. Source: derived here; the parameters are in the data file of the car.
"""

from steer_env.friction.numerics import scratch
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.chassis.common.interface import (
    COMMON_CHANNELS,
    COMMON_OUTPUTS,
    INPUTS,
    SPEED_MAX,
    SPEED_MIN,
    extrapolated_step,
    register,
    separate_derivative,
)
from steer_env.vehicle.chassis.single_track.derivative import derivative
from steer_env.vehicle.chassis.single_track.from_car import LOAD_TIME, from_car
from steer_env.vehicle.chassis.single_track.layout import DRIVE_FORCE, REPORTED_STATES, SLIP_FL, STATES, SingleTrack

__all__ = ["LOAD_TIME", "STATES", "SingleTrack", "derivative"]

_STATE_SIZE, _OUTPUT_SIZE, _INPUT_SIZE = len(STATES), len(COMMON_OUTPUTS), len(INPUTS)
_PASSES = 8  # of `begin`; after four of them no bit changes any more with the packaged cars
_FIRST_OUTPUT = len(REPORTED_STATES)


@kernel
def advance(p, x, rate, rate_before, out, out_before, s, h, u):
    """Advance every state by the Adams-Bashforth rule."""
    extrapolated_step(x, rate, rate_before, s, h)


@kernel
def report(p, x, out, out_before, s, u, row):
    """Fill the channels ``s`` chassis steps after the last evaluation."""
    for k, i in enumerate(REPORTED_STATES):
        row[k] = x[i]
    for i in range(_OUTPUT_SIZE):
        row[_FIRST_OUTPUT + i] = out[i] + s * (out[i] - out_before[i])


@kernel
def speed(p, x):
    """Forward speed that the assist receives [m/s]."""
    return p.v_x


@kernel
def state_size(p):
    """Number of states."""
    return _STATE_SIZE


@kernel
def output_size(p):
    """Number of outputs."""
    return _OUTPUT_SIZE


@kernel
def begin(p, strut, tyre, x):
    """Write the states of straight running in balance: what holds the speed, and the slips that toe makes.

    Each pass solves the lags of slips and drive force exactly for the forces of the pass before, which hardly depend on
    the drive force.
    """
    dx, out, u = scratch.like(x, _STATE_SIZE), scratch.like(x, _OUTPUT_SIZE), scratch.like(x, _INPUT_SIZE)
    for i in range(_STATE_SIZE):
        x[i] = 0.0
    for i in range(_INPUT_SIZE):
        u[i] = 0.0
    for _ in range(_PASSES):
        separate_derivative(p, strut, tyre, x, u[0], u[0], u, dx, out)  # zeros as wide as ``x``
        for i in range(4):
            x[SLIP_FL + i] += dx[SLIP_FL + i] * p.sigma_y / p.v_x
        x[DRIVE_FORCE] += dx[DRIVE_FORCE] * p.T_drive
    return True


register(
    "single_track",
    SingleTrack,
    states=STATES,
    outputs=COMMON_OUTPUTS,
    channels=COMMON_CHANNELS,
    speeds=(SPEED_MIN, SPEED_MAX),
    from_car=from_car,
    begin=begin,
    derivative=derivative,
    advance=advance,
    report=report,
    speed=speed,
    state_size=state_size,
    output_size=output_size,
    wide=True,
)
