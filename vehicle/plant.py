"""The plant: column, friction, assist, rack force and chassis coupled at one step of 1 ms.

Within a step the column runs by the implicit midpoint rule with the law's exact mean torque. The chassis is slower by
far: its tyres and struts are evaluated at every second step, its states follow the two-step Adams-Bashforth polynomial
through those nodes at every step, and what couples back (the rack force) and what is reported is extrapolated linearly
from the last two nodes. All of it is of second order. The controller is sampled every millisecond whatever the step.

    T_C = T_motor - r_p (F_rack + F_disturbance)         friction level = 1 + |F_rack| load gain

The state is one flat array. Names, units and places of states, inputs and channels are declared here and nowhere else.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from friction.kernel import kernel
from friction.law import law_of
from vehicle import assist, column, single_track
from vehicle.assist import SAMPLE_TIME

_COLUMN_STATES = (
    ("handwheel_angle", "rad"),
    ("handwheel_speed", "rad/s"),
    ("column_angle", "rad"),
    ("column_speed", "rad/s"),
)
_ASSIST_STATES = (
    ("lead_filter", "N m"),
    ("motor_torque", "N m"),
    *((f"command_{i}", "N m") for i in range(assist.MAX_DELAY + 1)),
)
# What the multi-step rules remember.
_BEFORE = (
    ("rack_force", "N"),
    ("rack_force_before", "N"),
    ("hand_torque_mean", "N m"),
    ("hand_torque_mean_before", "N m"),
    ("friction_torque_mean", "N m"),
    ("friction_torque_mean_before", "N m"),
)
STATES: tuple[tuple[str, str], ...] = (
    *_COLUMN_STATES,
    *_ASSIST_STATES,
    *single_track.STATES,
    *((f"{name}_derivative", f"{unit}/s") for name, unit in single_track.STATES),
    *((f"{name}_derivative_before", f"{unit}/s") for name, unit in single_track.STATES),
    *single_track.OUTPUTS,
    *((f"{name}_before", unit) for name, unit in single_track.OUTPUTS),
    ("steps_since_node", "1"),
    *_BEFORE,
)
_ASSIST = len(_COLUMN_STATES)
_CHASSIS = _ASSIST + len(_ASSIST_STATES)
_SIZE = len(single_track.STATES)
_RATE = _CHASSIS + _SIZE
_RATE_BEFORE = _RATE + _SIZE
_OUT = _RATE_BEFORE + _SIZE
_OUT_BEFORE = _OUT + len(single_track.OUTPUTS)
_PHASE = _OUT_BEFORE + len(single_track.OUTPUTS)
_RACK_FORCE = _PHASE + 1
_HAND_TORQUE = _RACK_FORCE + 2
_FRICTION_TORQUE = _RACK_FORCE + 4
_MEMORY = len(STATES)  # the friction law's memory is the tail

# One row of inputs holds for a sample of 1 ms.
INPUTS = (
    ("hand", "N m or rad"),  # hand torque, or handwheel angle at the end of the sample
    ("hand_speed", "rad/s"),  # handwheel speed at the end of the sample, if the angle is prescribed
    ("assist_request", "N m"),  # added to the controller's command
    ("wind_force", "N"),
    ("wind_moment", "N m"),
    ("rack_disturbance", "N"),  # from the road, positive where it resists a left turn
)
HAND, HAND_SPEED, ASSIST_REQUEST, WIND_FORCE, WIND_MOMENT, RACK_DISTURBANCE = range(len(INPUTS))

CHANNELS: tuple[tuple[str, str], ...] = (
    ("handwheel_angle", "rad"),
    ("handwheel_speed", "rad/s"),
    ("handwheel_torque", "N m"),
    ("column_angle", "rad"),
    ("column_speed", "rad/s"),
    ("torsion_bar_torque", "N m"),
    ("motor_torque", "N m"),
    ("friction_torque", "N m"),
    ("rack_force", "N"),
    ("lateral_speed", "m/s"),
    ("yaw_rate", "rad/s"),
    ("roll_angle", "rad"),
    ("yaw_angle", "rad"),
    ("x", "m"),
    ("y", "m"),
    ("drive_force", "N"),
    *single_track.OUTPUTS,
)
CHANNEL = {name: i for i, (name, _) in enumerate(CHANNELS)}
_OUTPUTS = len(single_track.OUTPUTS)
_OUTPUT = len(CHANNELS) - _OUTPUTS

STEPS_PER_NODE = 2  # column steps for each evaluation of the chassis
STOP_STIFFNESS = 2e6  # of the rack's end stops, assumed [N/m]


class Plant(NamedTuple):
    """Everything that the kernels need; built by :func:`vehicle.cars.Car.plant`."""

    column: column.Column
    assist: assist.Assist
    friction: Any  # parameters of a friction law
    chassis: single_track.SingleTrack
    strut: Any  # strut_map.StrutMap
    tyre: Any  # tyre.MagicFormula, of all four wheels
    pinion_radius: float  # rack travel per column angle [m/rad]
    friction_load: float  # rise of the friction level per rack force [1/N]
    rack_limit: float  # rack travel at the end stops [m]
    robot: float  # 1 where the handwheel angle is prescribed, 0 where the hand torque is


@kernel
def _evaluate(p, state, wind_force, wind_moment):
    """A new node: chassis derivative, outputs and rack force at the present state, the last ones kept beside them."""
    for i in range(_SIZE):
        state[_RATE_BEFORE + i] = state[_RATE + i]
    for i in range(_OUTPUTS):
        state[_OUT_BEFORE + i] = state[_OUT + i]
    state[_RACK_FORCE + 1] = state[_RACK_FORCE]
    rack = p.pinion_radius * state[column.COLUMN_ANGLE]
    force = single_track.derivative(
        p.chassis,
        p.strut,
        p.tyre[0],
        state[_CHASSIS:_RATE],
        rack,
        wind_force,
        wind_moment,
        state[_RATE:_RATE_BEFORE],
        state[_OUT:_OUT_BEFORE],
    )
    beyond = max(abs(rack) - p.rack_limit, 0.0)
    state[_RACK_FORCE] = force + math.copysign(STOP_STIFFNESS * beyond, rack)


@kernel
def _step(p, state, hand, hand_speed, before, after, elapsed, disturbance, h):
    """Column, motor and chassis over one step; a node's evaluation is still to come."""
    # The middle of this step, in node intervals after the last node.
    s = (state[_PHASE] + 0.5) / STEPS_PER_NODE
    force = state[_RACK_FORCE] + s * (state[_RACK_FORCE] - state[_RACK_FORCE + 1]) + disturbance
    motor = assist.motor_step(p.assist, state[_ASSIST:_CHASSIS], before, after, elapsed, h)
    T_C = motor - p.pinion_radius * force
    level = 1.0 + p.friction_load * abs(force)
    q, memory = state[:_ASSIST], state[_MEMORY:]
    state[_HAND_TORQUE + 1] = state[_HAND_TORQUE]
    state[_FRICTION_TORQUE + 1] = state[_FRICTION_TORQUE]
    _, _, T_F, T1 = column.step(p.column, p.friction, level, q, memory, p.robot > 0.0, hand, hand_speed, T_C, h)
    state[_HAND_TORQUE] = T1
    state[_FRICTION_TORQUE] = T_F
    for i in range(_SIZE):
        now = state[_RATE + i]
        state[_CHASSIS + i] += h * (now + s * (now - state[_RATE_BEFORE + i]))
    state[_PHASE] += 1.0


@kernel
def _report(p, state, row):
    """Fill a row of channels at the present moment."""
    chassis = state[_CHASSIS:_RATE]
    s = state[_PHASE] / STEPS_PER_NODE
    row[0] = state[column.HANDWHEEL_ANGLE]
    row[1] = state[column.HANDWHEEL_SPEED]
    # Means over the last two steps, extrapolated to their end; a hand torque is its own value.
    row[2] = 1.5 * state[_HAND_TORQUE] - 0.5 * state[_HAND_TORQUE + 1] if p.robot > 0.0 else state[_HAND_TORQUE]
    row[3] = state[column.COLUMN_ANGLE]
    row[4] = state[column.COLUMN_SPEED]
    row[5] = p.column.K_tb * (state[column.HANDWHEEL_ANGLE] - state[column.COLUMN_ANGLE])
    row[6] = state[_ASSIST + assist.MOTOR_TORQUE]
    row[7] = 1.5 * state[_FRICTION_TORQUE] - 0.5 * state[_FRICTION_TORQUE + 1]
    row[8] = state[_RACK_FORCE] + s * (state[_RACK_FORCE] - state[_RACK_FORCE + 1])
    row[9] = chassis[single_track.LATERAL_SPEED]
    row[10] = chassis[single_track.YAW_RATE]
    row[11] = chassis[single_track.ROLL]
    row[12] = chassis[single_track.YAW]
    row[13] = chassis[single_track.X]
    row[14] = chassis[single_track.Y]
    row[15] = chassis[single_track.DRIVE_FORCE]
    for i in range(_OUTPUTS):
        row[_OUTPUT + i] = state[_OUT + i] + s * (state[_OUT + i] - state[_OUT_BEFORE + i])


@kernel
def run(p, state, inputs, record, substeps):
    """Advance the plant by one sample of 1 ms per row of inputs.

    Parameters
    ----------
    p : Plant
    state : (S,) array
        Advanced in place; from :func:`initial_state`.
    inputs : (N, 6) array
        As in ``INPUTS``.
    record : (M, C) array
        Receives the channels at the end of each sample; where there are fewer rows than samples, the last row ends up
        with the channels of the last sample.
    substeps : int
        Steps per sample; 1 but in studies of convergence.

    Returns
    -------
    bool
        Whether every state is finite.
    """
    h = SAMPLE_TIME / substeps
    last = record.shape[0] - 1
    for i in range(inputs.shape[0]):
        u = inputs[i]
        row = record[min(i, last)]
        twist = p.column.K_tb * (state[column.HANDWHEEL_ANGLE] - state[column.COLUMN_ANGLE])
        before, after = assist.sample(
            p.assist,
            state[_ASSIST:_CHASSIS],
            twist,
            state[column.COLUMN_SPEED],
            p.chassis.v_x,
            u[ASSIST_REQUEST],
        )
        start, start_speed = state[column.HANDWHEEL_ANGLE], state[column.HANDWHEEL_SPEED]
        for j in range(substeps):
            hand, hand_speed = u[HAND], u[HAND_SPEED]
            if p.robot > 0.0 and j + 1 < substeps:
                hand, hand_speed = _hermite((j + 1) / substeps, start, start_speed, hand, hand_speed)
            _step(p, state, hand, hand_speed, before, after, j * h, u[RACK_DISTURBANCE], h)
            if state[_PHASE] == STEPS_PER_NODE:
                _evaluate(p, state, u[WIND_FORCE], u[WIND_MOMENT])
                state[_PHASE] = 0.0
        if i <= last or i == inputs.shape[0] - 1:
            _report(p, state, row)
    finite = True
    for value in state:
        if not abs(value) < math.inf:
            finite = False
    return finite


@kernel
def _hermite(s, x0, v0, x1, v1):
    """Position and speed within a sample, from both ends."""
    T = SAMPLE_TIME
    rise = x1 - x0
    a = v0 * T - rise
    b = rise - v1 * T
    x = x0 + s * rise + s * (1.0 - s) * ((1.0 - s) * a + s * b)
    v = (rise + (1.0 - 2.0 * s) * ((1.0 - s) * a + s * b) + s * (1.0 - s) * (b - a)) / T
    return x, v


def initial_state(p: Plant) -> NDArray[np.float64]:
    """State of the plant running straight at its speed, hands at zero, friction at rest.

    Five seconds of straight running, some fifty time constants of the speed hold, bring the drive to its balance.
    """
    state = np.zeros(_MEMORY + law_of(p.friction).memory_size(p.friction))
    straight = np.zeros((5000, len(INPUTS)))
    run(p, state, straight, np.zeros((1, len(CHANNELS))), 1)
    for place in (single_track.X, single_track.Y):
        state[_CHASSIS + place] = 0.0
    return state


def state_name(index: int) -> str:
    """Name and unit of a state by its place; the tail is the friction law's memory."""
    if index >= _MEMORY:
        return f"friction_memory_{index - _MEMORY}"
    name, unit = STATES[index]
    return f"{name} [{unit}]"


def first_non_finite(
    p: Plant, state: NDArray[np.float64], inputs: NDArray[np.float64], substeps: int = 1
) -> str | None:
    """Which state goes non-finite first when ``inputs`` are run from ``state`` (left unchanged); None if none does."""
    trial, row = state.copy(), np.zeros((1, len(CHANNELS)))
    for i in range(len(inputs)):
        run(p, trial, inputs[i : i + 1], row, substeps)
        bad = np.flatnonzero(~np.isfinite(trial))
        if bad.size:
            return state_name(int(bad[0]))
    return None
