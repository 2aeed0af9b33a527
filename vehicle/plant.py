"""The plant: column, friction, assist, rack force and chassis coupled at one step of 1 ms.

Within a step the column runs by the implicit midpoint rule with the law's exact mean torque. The chassis is slower by
far: its tyres and struts are evaluated at every second step, its states follow the two-step Adams-Bashforth polynomial
through those nodes at every step, and what couples back (the rack force) and what is reported is extrapolated linearly
from the last two nodes. All of it is of second order, in the inputs too. The controller is sampled every millisecond
whatever the step.

    T_C = T_motor - r_p (F_rack + F_disturbance)         friction level = level at rest (1 + |F_rack| load gain)

The state is one flat array: the column, the assist and what the rules remember as declared here, then the chassis with
its own (:mod:`steer_env.vehicle.chassis.common.interface`, where the inputs are declared too), then the friction law's memory.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.law import law_of
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.interpolation import hermite
from steer_env.friction.numerics.kernel import kernel, part
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
from steer_env.vehicle.steering import column, eps
from steer_env.vehicle.steering.eps import SAMPLE_TIME

_COLUMN_STATES = (
    ("handwheel_angle", "rad"),
    ("handwheel_speed", "rad/s"),
    ("column_angle", "rad"),
    ("column_speed", "rad/s"),
)
_ASSIST_STATES = (
    ("lead_filter", "N m"),
    ("motor_torque", "N m"),
    *((f"command_{i}", "N m") for i in range(eps.MAX_DELAY + 1)),
)
# What the multi-step rules remember.
_BEFORE = (
    ("steps_since_node", "1"),
    ("rack_force", "N"),
    ("rack_force_before", "N"),
    ("hand_torque_mean", "N m"),
    ("hand_torque_mean_before", "N m"),
    ("friction_torque_mean", "N m"),
    ("friction_torque_mean_before", "N m"),
    *((f"{name}_since_node", unit) for name, unit in INPUTS),  # mean, as far as the steps since the last node have come
    *((f"{name}_at_node", unit) for name, unit in INPUTS),
)
_HEAD = (*_COLUMN_STATES, *_ASSIST_STATES, *_BEFORE)
_ASSIST = len(_COLUMN_STATES)
_PHASE = _ASSIST + len(_ASSIST_STATES)
_RACK_FORCE = _PHASE + 1
_HAND_TORQUE = _RACK_FORCE + 2
_FRICTION_TORQUE = _RACK_FORCE + 4
_SINCE = _FRICTION_TORQUE + 2
_AT_NODE = _SINCE + len(INPUTS)
# Then come the chassis' states x, their derivatives at the last node and at the one before, the outputs of both nodes,
# and the friction law's memory.
_CHASSIS = len(_HEAD)

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
_OWN = len(_OWN_CHANNELS)
# The channels that every plant begins with; :func:`channels` tells all of a plant's.
CHANNELS: Names = (*_OWN_CHANNELS, *COMMON_CHANNELS)
CHANNEL = {name: i for i, (name, _) in enumerate(CHANNELS)}

STEPS_PER_NODE = 2  # column steps for each evaluation of the chassis
STOP_STIFFNESS = 2e6  # of the rack's end stops, assumed [N/m]


class Plant(NamedTuple):
    """Everything that the kernels need; built by :func:`steer_env.vehicle.cars.Car.plant`."""

    column: column.Column
    assist: eps.Assist
    friction: Any  # parameters of a friction law
    chassis: Any  # parameters of a chassis
    strut: Any  # strut_map.StrutMap
    tyre: Any  # tyre.MagicFormula, of all four wheels
    pinion_radius: float  # rack travel per column angle [m/rad]
    friction_load: float  # rise of the friction level per rack force [1/N]
    rack_limit: float  # rack travel at the end stops [m]
    robot: float  # 1 where the handwheel angle is prescribed, 0 where the hand torque is
    friction_level: float = 1.0  # factor on the law's saturated friction, as wear or temperature change it [1]


@kernel
def _places(p):
    """Where the chassis' derivatives, its outputs and the friction law's memory begin, each before its forerunner."""
    n, m = chassis.state_size(p.chassis), chassis.output_size(p.chassis)
    rate = _CHASSIS + n
    out = rate + 2 * n
    return rate, rate + n, out, out + m, out + 2 * m


@part
def _evaluate(p, state, u):
    """A new node: chassis derivative, outputs and rack force at the present state, the last ones kept beside them."""
    rate, rate_before, out, out_before, _ = _places(p)
    for i in range(rate_before - rate):
        state[rate_before + i] = state[rate + i]
    for i in range(out_before - out):
        state[out_before + i] = state[out + i]
    state[_RACK_FORCE + 1] = state[_RACK_FORCE]
    # The rule gives a change of an input between nodes the effect of one midway. Taken instead of the present value,
    # the mean since the last node and half of the change since then give it the whole effect, and a ramp no delay.
    seen = state[_SINCE:_AT_NODE]
    for i in range(u.size):
        seen[i] += 0.5 * (u[i] - state[_AT_NODE + i])
        state[_AT_NODE + i] = u[i]
    rack = p.pinion_radius * state[column.COLUMN_ANGLE]
    force = chassis.derivative(
        p.chassis,
        p.strut,
        p.tyre[0],
        state[_CHASSIS:rate],
        rack,
        p.pinion_radius * state[column.COLUMN_SPEED],
        seen,
        state[rate:rate_before],
        state[out:out_before],
    )
    for i in range(seen.size):
        seen[i] = 0.0
    beyond = rack - within(rack, -p.rack_limit, p.rack_limit)
    state[_RACK_FORCE] = force + STOP_STIFFNESS * beyond


@part
def _step(p, state, hand, hand_speed, before, after, elapsed, u, h):
    """Column, motor and chassis over one step; a node's evaluation is still to come."""
    rate, rate_before, out, out_before, memory = _places(p)
    # The middle of this step, in node intervals after the last node.
    s = (state[_PHASE] + 0.5) / STEPS_PER_NODE
    force = state[_RACK_FORCE] + s * (state[_RACK_FORCE] - state[_RACK_FORCE + 1]) + u[RACK_DISTURBANCE]
    motor = eps.motor_step(p.assist, state[_ASSIST:_PHASE], before, after, elapsed, h)
    T_C = motor - p.pinion_radius * force
    level = p.friction_level * (1.0 + p.friction_load * abs(force))
    state[_HAND_TORQUE + 1] = state[_HAND_TORQUE]
    state[_FRICTION_TORQUE + 1] = state[_FRICTION_TORQUE]
    _, _, T_F, T1 = column.step(
        p.column, p.friction, level, state[:_ASSIST], state[memory:], p.robot > 0.0, hand, hand_speed, T_C, h
    )
    state[_HAND_TORQUE] = T1
    state[_FRICTION_TORQUE] = T_F
    chassis.advance(
        p.chassis,
        state[_CHASSIS:rate],
        state[rate:rate_before],
        state[rate_before:out],
        state[out:out_before],
        state[out_before:memory],
        s,
        h,
        u,
    )
    for i in range(u.size):
        state[_SINCE + i] += u[i] * (1.0 / STEPS_PER_NODE)
    state[_PHASE] += 1.0


@part
def _report(p, state, u, row):
    """Fill a row of channels at the present moment."""
    rate, _, out, out_before, memory = _places(p)
    s = state[_PHASE] / STEPS_PER_NODE
    row[0] = state[column.HANDWHEEL_ANGLE]
    row[1] = state[column.HANDWHEEL_SPEED]
    # Means over the last two steps, extrapolated to their end; a hand torque that is given is its own value.
    given = p.robot == 0.0 and p.column.K_arm == 0.0
    row[2] = state[_HAND_TORQUE] if given else 1.5 * state[_HAND_TORQUE] - 0.5 * state[_HAND_TORQUE + 1]
    row[3] = state[column.COLUMN_ANGLE]
    row[4] = state[column.COLUMN_SPEED]
    row[5] = p.column.K_tb * (state[column.HANDWHEEL_ANGLE] - state[column.COLUMN_ANGLE])
    row[6] = state[_ASSIST + eps.MOTOR_TORQUE]
    row[7] = 1.5 * state[_FRICTION_TORQUE] - 0.5 * state[_FRICTION_TORQUE + 1]
    row[8] = state[_RACK_FORCE] + s * (state[_RACK_FORCE] - state[_RACK_FORCE + 1])
    chassis.report(p.chassis, state[_CHASSIS:rate], state[out:out_before], state[out_before:memory], s, u, row[_OWN:])


@kernel
def run(p, state, inputs, record, substeps):
    """Advance the plant by one sample of 1 ms per row of inputs.

    Parameters
    ----------
    p : Plant
    state : (S,) array
        Advanced in place; from :func:`initial_state`.
    inputs : (N, I) array
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
        row = record[i if i < last else last]
        twist = p.column.K_tb * (state[column.HANDWHEEL_ANGLE] - state[column.COLUMN_ANGLE])
        before, after = eps.sample(
            p.assist,
            state[_ASSIST:_PHASE],
            twist,
            state[column.COLUMN_SPEED],
            chassis.speed(p.chassis, state[_CHASSIS:]),
            u[ASSIST_REQUEST],
        )
        start, start_speed = state[column.HANDWHEEL_ANGLE], state[column.HANDWHEEL_SPEED]
        for j in range(substeps):
            hand, hand_speed = u[HAND], u[HAND_SPEED]
            if p.robot > 0.0 and j + 1 < substeps:
                T = SAMPLE_TIME
                hand, slope = hermite((j + 1) / substeps, start, hand, start_speed * T, hand_speed * T)
                hand_speed = slope / T
            _step(p, state, hand, hand_speed, before, after, j * h, u, h)
            if state[_PHASE] == STEPS_PER_NODE:
                _evaluate(p, state, u)
                state[_PHASE] = 0.0
        if i <= last or i == inputs.shape[0] - 1:
            _report(p, state, u, row)
    finite = True
    for value in state:
        if not abs(value) < math.inf:
            finite = False
    return finite


def channels(p: Plant) -> Names:
    """Names and units of a plant's channels; ``CHANNELS`` come first."""
    return (*_OWN_CHANNELS, *chassis.chassis_of(p.chassis).channels)


def initial_state(p: Plant) -> NDArray[np.float64]:
    """State of the plant running straight at its speed, hands at zero, friction at rest."""
    return settled(p)[0]


def settled(p: Plant, run: Callable = run) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """State (S,) of running straight, as :func:`initial_state`, and its channels (C,).

    Five seconds of straight running, some fifty time constants of the speed hold, bring the drive to its balance;
    ``run`` does what :func:`run` does.
    """
    kind = chassis.chassis_of(p.chassis)
    start = kind.start(p.chassis)
    memory = _CHASSIS + 3 * len(kind.states) + 2 * len(kind.outputs)
    state = np.zeros(memory + law_of(p.friction).memory_size(p.friction))
    state[_CHASSIS : _CHASSIS + len(start)] = start
    row = np.zeros((1, len(channels(p))))
    run(p, state, np.zeros((5000, len(INPUTS))), row, 1)
    for place, (name, _) in enumerate(kind.states):
        if name in ("x", "y", "distance"):
            state[_CHASSIS + place] = 0.0
    row[0, [CHANNEL["x"], CHANNEL["y"]]] = 0.0
    return state, row[0]


def states(p: Plant) -> Names:
    """Names and units of a plant's states, in their places."""
    kind = chassis.chassis_of(p.chassis)
    return (
        *_HEAD,
        *kind.states,
        *((f"{name}_derivative", f"{unit}/s") for name, unit in kind.states),
        *((f"{name}_derivative_before", f"{unit}/s") for name, unit in kind.states),
        *kind.outputs,
        *((f"{name}_before", unit) for name, unit in kind.outputs),
        *((f"friction_memory_{i}", "") for i in range(law_of(p.friction).memory_size(p.friction))),
    )


def state_name(p: Plant, index: int) -> str:
    """Name and unit of a state by its place."""
    name, unit = states(p)[index]
    return f"{name} [{unit}]" if unit else name


def first_non_finite(
    p: Plant, state: NDArray[np.float64], inputs: NDArray[np.float64], substeps: int = 1
) -> str | None:
    """Which state goes non-finite first when ``inputs`` are run from ``state`` (left unchanged); None if none does."""
    trial, row = state.copy(), np.zeros((1, len(channels(p))))
    for i in range(len(inputs)):
        run(p, trial, inputs[i : i + 1], row, substeps)
        bad = np.flatnonzero(~np.isfinite(trial))
        if bad.size:
            return state_name(p, int(bad[0]))
    return None
