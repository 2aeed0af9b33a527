"""The plant: column, friction, assist, rack force and chassis coupled at one step of 1 ms.

Within a step the column runs by the implicit midpoint rule with the exact mean torque of the friction law. The chassis
is much slower. Its tyres and suspension are evaluated at every second step, and its states follow the two-step
Adams-Bashforth polynomial through these evaluations at every step. The rack force, which couples back, and the reported
channels are extrapolated linearly from the last two evaluations. All of this is of second order, in the inputs too.
The controller is sampled every millisecond, whatever the step.

    T_C = T_motor - r_p (F_rack + F_disturbance)                                                   (P2)
    friction scale by (F11), with L_0 = friction_torque_scale and F = F_rack + F_disturbance

The state is one flat array, which :mod:`steer_env.vehicle.layout` describes. The inputs are declared in
:mod:`steer_env.vehicle.chassis.common.interface`.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction import sites
from steer_env.friction.level import Level
from steer_env.friction.numerics import scratch
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.interpolation import hermite
from steer_env.friction.numerics.kernel import COMPILED, binds, dispatch, kernel, part, plain
from steer_env.friction.numerics.packing import common, of_row, of_rows
from steer_env.friction.numerics.simd import any_of, as_index, broadcast, deinterleave, interleave, pack, unpack, where
from steer_env.vehicle import chassis
from steer_env.vehicle.chassis.common.interface import (
    ASSIST_REQUEST,
    COMMON_CHANNELS,
    HAND,
    HAND_SPEED,
    INPUTS,
    RACK_DISTURBANCE,
    Names,
)
from steer_env.vehicle.layout import (
    layout_in_kernels,
    layout_to_motor,
    parts_of_chassis,
    plant_layout,
    state_names,
    state_size,
)
from steer_env.vehicle.steering import by_wire, column, eps, motor
from steer_env.vehicle.steering.assist import functions
from steer_env.vehicle.steering.assist.functions import Signals
from steer_env.vehicle.steering.eps import SAMPLE_TIME

_OWN_CHANNELS: Names = (
    ("handwheel_angle", "rad"),
    ("handwheel_speed", "rad/s"),
    ("handwheel_torque", "N m"),
    ("column_angle", "rad"),
    ("column_speed", "rad/s"),
    ("torsion_bar_torque", "N m"),
    ("motor_torque", "N m"),
    ("friction_torque", "N m"),
    ("rack_force", "N"),
)
_OWN_CHANNEL_COUNT = len(_OWN_CHANNELS)
# What these channels are and where they are positive.
_OWN_MEANINGS = {
    "handwheel_angle": "angle of the handwheel, positive to the left",
    "handwheel_speed": "angular velocity of the handwheel, positive to the left",
    "handwheel_torque": "torque of the hands on the handwheel, positive where it pushes to the left",
    "column_angle": "angle of the column below the torsion bar, positive to the left",
    "column_speed": "angular velocity of the column below the torsion bar, positive to the left",
    "torsion_bar_torque": "torque of the torsion bar, positive where the handwheel is ahead of the column to the left; "
    "by wire that with which the feedback motor resists a turn to the left",
    "motor_torque": "torque of the assist's motor at the column, positive where it pushes to the left",
    "friction_torque": "friction torque at the column, positive where it resists a motion to the left",
    "rack_force": "force of wheels and end stops on the rack, positive where it resists a left turn",
}
# The channels with which every plant begins; :func:`channels` returns all channels of a plant.
CHANNELS: Names = (*_OWN_CHANNELS, *COMMON_CHANNELS)
CHANNEL = {name: i for i, (name, _) in enumerate(CHANNELS)}

STEPS_PER_CHASSIS_STEP = 2  # column steps for each evaluation of the chassis
CHASSIS_STEP = STEPS_PER_CHASSIS_STEP * SAMPLE_TIME  # [s]
_INPUTS, SCALES = len(INPUTS), column.SCALES
SETTLING, RUN_IN = 2 * STEPS_PER_CHASSIS_STEP, 5000  # samples before a drive, from a balance and without one
_AT_ONCE = 20  # samples of four plants whose channels stay in the cache of the processor until they are told
STOP_STIFFNESS = 2e6  # of the end stops of the rack, assumed [N/m]


@common("robot")
class Plant(NamedTuple):
    """Everything that the kernels need; :func:`steer_env.vehicle.cars.Car.plant` builds it."""

    column: column.Column
    assist: eps.Assist
    friction: Any  # parameters of a friction law
    chassis: Any  # parameters of a chassis
    strut: Any  # kinematics_table.KinematicsTable
    tyre: Any  # tyre.MagicFormula, of all four wheels
    pinion_radius: float  # rack travel per column angle [m/rad]
    level: Level  # of the friction; its load is the rack force [N]
    rack_limit: float  # rack travel at the end stops [m]
    robot: float  # 1 where the handwheel angle is prescribed, 0 where the hand torque is
    friction_torque_scale: float = 1.0  # factor on the saturated friction, for example by wear or temperature [1]


class Rolling(NamedTuple):
    """What of a plant straight running in balance depends on."""

    chassis: Any
    strut: Any
    tyre: Any
    pinion_radius: float  # rack travel per column angle [m/rad]
    rack_limit: float  # rack travel at the end stops [m]


def linked(p: Plant) -> Plant:
    """A plant as compiled kernels take it in object code, which holds the functions of its friction too."""
    return p._replace(friction=sites.bound(p.friction, linked=True)) if COMPILED else p


def bound(p: Any, wide: bool = False) -> Any:
    """A plant as compiled kernels take it in this process, the same type for all friction and assists.

    With ``wide``, for four cars side by side (:func:`run_fours`). What is bound stays as it is.
    """
    if isinstance(p.friction, sites.Bound):
        return p._replace(friction=sites.bound(p.friction, wide))
    assist = p.assist
    if not wide:
        assist = assist._replace(
            functions=functions.bound(assist.functions),
            motor=motor.bound(assist.motor),
            wire=by_wire.bound(assist.wire),
        )
    return p._replace(friction=sites.bound(p.friction, wide), assist=assist)


@part
def evaluate(p, at, state, u, derivative):
    """Evaluate the chassis at the present state: derivative, outputs and rack force; the last values become the former.

    The extrapolation gives a change of an input between two evaluations the effect of a change midway between them.
    The chassis therefore receives the mean input since the last evaluation and half of the change since then, which
    gives a step its whole effect and a ramp no delay (N3). ``derivative`` is that of the chassis.
    """
    x = parts_of_chassis(at, state)
    for i in range(x.rate.size):
        x.rate_before[i] = x.rate[i]
    for i in range(x.outputs.size):
        x.outputs_before[i] = x.outputs[i]
    state[at.rack_force_before] = state[at.rack_force]
    received = x.mean_inputs
    for i in range(u.size):
        received[i] += 0.5 * (u[i] - x.last_inputs[i])  # (N3)
        x.last_inputs[i] = u[i]
    rack = p.pinion_radius * state[column.COLUMN_ANGLE]  # (P1)
    force = derivative(
        p.chassis,
        p.strut,
        p.tyre[0],
        x.state,
        rack,
        p.pinion_radius * state[column.COLUMN_SPEED],
        received,
        x.rate,
        x.outputs,
    )
    for i in range(received.size):
        received[i] = 0.0
    beyond = rack - within(rack, -p.rack_limit, p.rack_limit)
    state[at.rack_force] = force + STOP_STIFFNESS * beyond  # (P4)


@part
def sample(p, at, state, speed, request):
    """One sample of the assist at a vehicle speed [m/s]; the commands that act before and after its offset [N m]."""
    torsion_bar_torque = p.column.K_tb * (state[column.HANDWHEEL_ANGLE] - state[column.COLUMN_ANGLE])
    measured = Signals(
        state[column.HANDWHEEL_ANGLE],
        state[column.HANDWHEEL_SPEED],
        state[column.COLUMN_SPEED],
        torsion_bar_torque,
        speed,
    )
    return eps.sample(
        p.assist,
        state[at.assist : at.steps],
        torsion_bar_torque,
        measured.column_speed,
        measured.speed,
        by_wire.sampled(
            p.assist.wire,
            state[at.wire : at.functions],
            measured.handwheel_angle,
            measured.handwheel_speed,
            state[column.COLUMN_ANGLE],
            measured.column_speed,
            state[at.assist + eps.MOTOR_TORQUE],
            measured.speed,
            functions.requested(p.assist.functions, state[at.functions : at.memory], measured, request),
        ),
    )


@part
def steer(p, at, state, hand, hand_speed, before, after, elapsed, force, h):
    """Advance column and motor by one step ``h`` under a mean rack force ``force`` [N]."""
    x, heat, speed = state[at.assist : at.steps], state[at.motor : at.wire], state[column.COLUMN_SPEED]
    T_m = eps.motor_step(p.assist, x, heat, before, after, elapsed, speed, h)
    T_C = T_m - p.pinion_radius * force  # (P2)
    position = state[column.COLUMN_ANGLE] + 0.5 * h * state[column.COLUMN_SPEED]  # in the middle of the step
    state[at.hand_torque_before] = state[at.hand_torque]
    state[at.friction_torque_before] = state[at.friction_torque]
    scales = scratch.like(state, SCALES)
    sites.scales(p.friction, p.level, p.friction_torque_scale, force, position, T_m, scales)  # (F11), (F44)
    feedback = 0.0
    if by_wire.size(p.assist.wire) > 0:
        feedback = by_wire.fed(p.assist.wire, state[at.wire : at.functions], elapsed, h)
        if p.robot == 0.0:
            hand += feedback
    _, _, T_F, T1 = column.step(
        p.column,
        p.friction,
        scales,
        state[at.column : at.assist],
        state[at.memory :],
        p.robot > 0.0,
        hand,
        hand_speed,
        T_C,
        h,
    )
    state[at.hand_torque] = T1 - feedback if by_wire.size(p.assist.wire) > 0 else T1
    state[at.friction_torque] = T_F


@part
def roll(p, at, state, s, u, h):
    """Advance the chassis by one step ``h``, whose middle lies ``s`` chassis steps after the last evaluation."""
    x = parts_of_chassis(at, state)
    chassis.advance(p.chassis, x.state, x.rate, x.rate_before, x.outputs, x.outputs_before, s, h, u)
    for i in range(u.size):
        x.mean_inputs[i] += u[i] * (1.0 / STEPS_PER_CHASSIS_STEP)
    state[at.steps] += 1.0


@part
def _step(p, at, state, hand, hand_speed, before, after, elapsed, u, h):
    """Advance column, motor and chassis by one step ``h``; an evaluation of the chassis may follow."""
    s = (state[at.steps] + 0.5) / STEPS_PER_CHASSIS_STEP  # middle of the step, in chassis steps after the evaluation
    # (N1)
    force = state[at.rack_force] + s * (state[at.rack_force] - state[at.rack_force_before]) + u[RACK_DISTURBANCE]
    steer(p, at, state, hand, hand_speed, before, after, elapsed, force, h)
    roll(p, at, state, s, u, h)


@part
def report_column(p, at, state, row):
    """Fill the channels of column and assist, the first of a row."""
    row[0] = state[column.HANDWHEEL_ANGLE]
    row[1] = state[column.HANDWHEEL_SPEED]
    # Step means are extrapolated to the end of the last step (N4); a prescribed hand torque is reported itself.
    given = (p.robot == 0.0) & (p.column.K_arm == 0.0)
    torque, before = state[at.hand_torque], state[at.hand_torque_before]
    row[2] = where(given, torque, 1.5 * torque - 0.5 * before)
    row[3] = state[column.COLUMN_ANGLE]
    row[4] = state[column.COLUMN_SPEED]
    row[5] = p.column.K_tb * (state[column.HANDWHEEL_ANGLE] - state[column.COLUMN_ANGLE])
    if by_wire.size(p.assist.wire) > 0:
        row[5] = -state[at.wire + by_wire.FEEDBACK]
    row[6] = state[at.assist + eps.MOTOR_TORQUE]
    row[7] = 1.5 * state[at.friction_torque] - 0.5 * state[at.friction_torque_before]


@part
def report_chassis(p, at, state, u, row):
    """Fill the rack force and the channels of the chassis, the rest of a row."""
    s = state[at.steps] / STEPS_PER_CHASSIS_STEP
    row[0] = state[at.rack_force] + s * (state[at.rack_force] - state[at.rack_force_before])
    chassis.report(
        p.chassis,
        state[at.chassis : at.rate],
        state[at.outputs : at.outputs_before],
        state[at.outputs_before : at.motor],
        s,
        u,
        row[1:],
    )


def rolling(p):
    """What :func:`begin` takes of a plant, the same type for all steerings; in kernels too."""
    return p if isinstance(p, Rolling) else plain(_rolling)(p)


@kernel
def _rolling(p):
    return Rolling(p.chassis, p.strut, p.tyre, p.pinion_radius, p.rack_limit)


dispatch(rolling, lambda kind, _: _rolling)


@binds(0, rolling)
@kernel
def begin(p, state):
    """Write the state of straight running in balance; how many samples of it complete what is kept of the last steps.

    A car that does not run straight there, as on a road whose sides differ, or finds no balance is given five seconds.
    ``p`` is a Plant; in kernels, where this is compiled once for each chassis, a Rolling.
    """
    at = layout_to_motor(p)
    for i in range(state.size):
        state[i] = 0.0
    straight = chassis.begin(p.chassis, p.strut, p.tyre[0], state[at.chassis : at.rate])
    u = scratch.like(state, _INPUTS)
    for i in range(u.size):
        u[i] = 0.0
    for _ in range(2):  # the last evaluation and the one before
        evaluate(p, at, state, u, chassis.separate_derivative)
    return SETTLING if straight else RUN_IN


@binds(0, bound)
@kernel
def run(p, state, inputs, record, substeps):
    """Advance the plant by one sample of 1 ms per row of inputs.

    Parameters
    ----------
    p : Plant
        In kernels one that is bound (:func:`bound`).
    state : (S,) array
        Advanced in place; from :func:`initial_state`.
    inputs : (N, I) array
        As in ``INPUTS``.
    record : (M, C) array
        Receives the channels at the end of each sample. Where it has fewer rows than there are samples, its last row
        receives the channels of the last sample.
    substeps : int
        Steps per sample; other values than 1 serve studies of convergence.

    Returns
    -------
    bool
        Whether every state is finite.
    """
    h = SAMPLE_TIME / substeps
    at = layout_in_kernels(p)
    last = record.shape[0] - 1
    for i in range(inputs.shape[0]):
        u = inputs[i]
        row = record[i if i < last else last]
        before, after = sample(p, at, state, chassis.speed(p.chassis, state[at.chassis :]), u[ASSIST_REQUEST])
        start, start_speed = state[column.HANDWHEEL_ANGLE], state[column.HANDWHEEL_SPEED]
        for j in range(substeps):
            hand, hand_speed = u[HAND], u[HAND_SPEED]
            if p.robot > 0.0 and j + 1 < substeps:
                T = SAMPLE_TIME
                hand, slope = hermite((j + 1) / substeps, start, hand, start_speed * T, hand_speed * T)
                hand_speed = slope / T
            _step(p, at, state, hand, hand_speed, before, after, j * h, u, h)
            if any_of(state[at.steps] == STEPS_PER_CHASSIS_STEP):
                evaluate(p, at, state, u, chassis.derivative)
                state[at.steps] = 0.0
        if i <= last or i == inputs.shape[0] - 1:
            report_column(p, at, state, row)
            report_chassis(p, at, state, u, row[_OWN_CHANNEL_COUNT - 1 :])
    finite = True
    for value in state:
        finite = finite & (abs(value) < math.inf)
    return finite


@kernel
def run_rows(template, rows, states, inputs, channels, finite, low, high):
    """Advance many plants of one kind, the rows from ``low`` to ``high``, by one sample of 1 ms per row of inputs.

    Parameters
    ----------
    template : Plant
        A bound plant of the kind that all rows have, or its outline; they share its tables of strut and road.
    rows : (N, K) array
        Numbers of the plants, as :func:`steer_env.friction.numerics.packing.pack` gives them.
    states : (N, S) array
        Advanced in place.
    inputs : (N, T, I) array
        As in ``INPUTS``.
    channels : (N, C) array
        Receives the channels at the end.
    finite : (N,) array of bool
        Receives whether every state is finite.
    """
    for i in range(low, high):
        p = of_row(template, rows, i)
        finite[i] = run(p, states[i], inputs[i], channels[i : i + 1], 1)


@kernel
def run_fours(template, common, rows, states, inputs, channels, finite, low, high):
    """As :func:`run_rows`, to the bit, with four rows side by side that take one way wherever there are four.

    ``common`` is what :func:`steer_env.friction.numerics.packing.common_columns` makes of a plant of their kind.
    """
    samples, size, taken, told = inputs.shape[1], states.shape[1], inputs.shape[2], channels.shape[1]
    block, u, row = scratch.fours(1, size), scratch.fours(samples, taken), scratch.fours(1, told)
    waits, of_friction = scratch.fours(1, high - low)[0], scratch.fours(1, template.friction.numbers.size)[0]
    for i in range(low, high):
        waits[i - low] = 1.0
    lanes = pack(0.0, 1.0, 2.0, 3.0)
    for i in range(low, high):
        if any_of(waits[i - low] > 0.0):
            four, found, k = as_index(lanes), 0, i
            while k < high and found < 4:
                if any_of(waits[k - low] > 0.0) and _one_way(template, common, rows, states, i, k):
                    four = where(lanes >= found, k, four)  # lanes for which there is no row do what the last one does
                    found += 1
                    waits[k - low] = 0.0
                k += 1
            interleave(states, size, four * size, block)
            interleave(inputs, samples * taken, four * (samples * taken), u)
            sound = run(_side_by_side(of_rows(template, rows, four), of_friction), block[0], u, row, 1)
            deinterleave(block, size, four * size, states)
            deinterleave(row, told, four * told, channels)
            for k, each in zip(unpack(four), unpack(sound)):
                finite[k] = each


@kernel
def record_fours(template, rows, states, inputs, records):
    """:func:`run` of up to four plants of one kind side by side, with the channels of every sample, to the bit.

    Parameters
    ----------
    template, rows, states, inputs
        As of :func:`run_rows`; what :func:`steer_env.friction.numerics.packing.common_columns` tells of is equal.
    records : (N, T, C) array
        Receives the channels at the end of each sample.
    """
    n, size, samples, taken, told = states.shape[0], states.shape[1], inputs.shape[1], inputs.shape[2], records.shape[2]
    block, u, row = scratch.fours(1, size), scratch.fours(_AT_ONCE, taken), scratch.fours(_AT_ONCE, told)
    of_friction, lanes = scratch.fours(1, template.friction.numbers.size)[0], pack(0.0, 1.0, 2.0, 3.0)
    four = as_index(where(lanes >= n, n - 1.0, lanes))  # lanes for which there is no plant do what the last one does
    p = _side_by_side(of_rows(template, rows, four), of_friction)
    interleave(states, size, four * size, block)
    for i in range(0, samples, _AT_ONCE):
        k = min(_AT_ONCE, samples - i)
        interleave(inputs, k * taken, (four * samples + i) * taken, u)
        run(p, block[0], u[:k], row[:k], 1)
        deinterleave(row, k * told, (four * samples + i) * told, records)
    deinterleave(block, size, four * size, states)


@kernel
def _side_by_side(p, of_friction):
    """Four plants with the numbers of their friction side by side in ``of_friction``, as its laws take them."""
    for k in range(of_friction.size):
        of_friction[k] = p.friction.numbers[k]
    friction = sites.Bound(of_friction, p.friction.at)
    steering = p.column, p.assist, friction
    return Plant(
        *steering, p.chassis, p.strut, p.tyre, p.pinion_radius, p.level, p.rack_limit, p.robot, p.friction_torque_scale
    )


def side_by_side(p: Plant) -> bool:
    """Whether rows of plants of this kind run side by side: every part of theirs has kernels that take vectors."""
    a = p.assist
    plain_parts = zip((a.functions, a.motor, a.wire), (functions.NoFunctions, motor.NoMotor, by_wire.NoWire))
    return (
        COMPILED
        and all(isinstance(*each) for each in plain_parts)
        and sites.wide(p.friction)
        and chassis.chassis_of(p.chassis).wide
    )


@kernel
def _one_way(template, common, rows, states, i, k):
    """Whether two rows evaluate their chassis at the same steps and agree in the numbers on which branches depend."""
    steps = layout_in_kernels(template).steps
    same = states[i, steps] == states[k, steps]
    for j in range(common.shape[0]):
        for number in range(common[j, 0], common[j, 1]):
            same = same & (rows[i, number] == rows[k, number])
    return same


@kernel
def begin_rows(template, rows, states, samples, low, high):
    """As :func:`begin`, of the plants of :func:`run_rows`, with the results in ``samples`` (N,)."""
    for i in range(low, high):
        samples[i] = begin(_rolling(of_row(template, rows, i)), states[i])


@kernel
def begin_fours(template, rows, states, samples, low, high):
    """As :func:`begin_rows`, to the bit, with each row in all lanes.

    It takes the time of a few samples; where rows run side by side, the chassis is thus compiled for vectors alone.
    """
    block = scratch.fours(1, states.shape[1])
    for i in range(low, high):
        four = as_index(broadcast(i))
        samples[i] = begin(_rolling(of_rows(template, rows, four)), block[0])
        deinterleave(block, states.shape[1], four * states.shape[1], states)


def reported(p: Plant, state: NDArray[np.float64], u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Channels (C,) of a state (S,) at the end of a sample with a row ``u`` (I,) of inputs."""
    row, at = np.zeros(len(channels(p))), plant_layout(p)
    plain(report_column)(p, at, state, row)
    plain(report_chassis)(p, at, state, u, row[_OWN_CHANNEL_COUNT - 1 :])
    return row


def channels(p: Plant) -> Names:
    """Names and units of the channels of a plant; ``CHANNELS`` come first."""
    return (*_OWN_CHANNELS, *chassis.chassis_of(p.chassis).channels)


def meanings(p: Plant) -> dict[str, str]:
    """What the channels of a plant are and where they are positive; those of each wheel by their names without it."""
    return {**_OWN_MEANINGS, **chassis.COMMON_MEANINGS, **chassis.chassis_of(p.chassis).meanings}


def initial_state(p: Plant) -> NDArray[np.float64]:
    """State (S,) of the plant in straight running at its speed, hands at zero, friction at rest."""
    return settled(p)[0]


def initial_speed(p: Plant) -> float:
    """The speed at which a plant starts [m/s]."""
    state = np.zeros(state_size(p))
    begin(p, state)
    return float(plain(chassis.chassis_of(p.chassis).speed)(p.chassis, state[plant_layout(p).chassis :]))


def settled(p: Plant, run: Callable = run) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """State (S,) of straight running, as :func:`initial_state`, and its channels (C,).

    ``run`` has the effect of :func:`run`.
    """
    state, row = np.zeros(state_size(p)), np.zeros((1, len(channels(p))))
    run(p, state, np.zeros((begin(p, state), len(INPUTS))), row, 1)
    start_line(p, state[None], row)
    return state, row[0]


def start_line(p: Plant, states: NDArray[np.float64], rows: NDArray[np.float64]) -> None:
    """Set the position to zero in states (N, S) and channels (N, C) of plants of one kind."""
    kind, at = chassis.chassis_of(p.chassis), plant_layout(p)
    states[:, [at.chassis + i for i, (name, _) in enumerate(kind.states) if name in ("x", "y", "distance")]] = 0.0
    rows[:, [CHANNEL["x"], CHANNEL["y"]]] = 0.0


def state_name(p: Plant, index: int) -> str:
    """Name and unit of the state at a position of the array."""
    name, unit = state_names(p)[index]
    return f"{name} [{unit}]" if unit else name


def first_non_finite(
    p: Plant, state: NDArray[np.float64], inputs: NDArray[np.float64], substeps: int = 1
) -> str | None:
    """Which state becomes non-finite first when ``inputs`` are run from ``state`` (left unchanged); None if none."""
    trial, row = state.copy(), np.zeros((1, len(channels(p))))
    for i in range(len(inputs)):
        run(p, trial, inputs[i : i + 1], row, substeps)
        bad = np.flatnonzero(~np.isfinite(trial))
        if bad.size:
            return state_name(p, int(bad[0]))
    return None
