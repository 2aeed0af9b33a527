"""Where each part of a plant stands in its state array.

The array holds, in this order, the column, the assist, the memory of the multi-step rules, the states of the chassis,
their derivatives and the outputs at the last two evaluations of the chassis, the states of the motor's limits, of the
controllers of a wire and of the assist's functions, and the memory of the friction law.
"""

from typing import Any, NamedTuple

from steer_env.friction.law import law_of
from steer_env.friction.numerics.kernel import kernel, part, plain
from steer_env.vehicle import chassis
from steer_env.vehicle.chassis.common.interface import INPUTS, Names
from steer_env.vehicle.steering import by_wire, column, eps, motor
from steer_env.vehicle.steering.assist import functions

# What the multi-step rules keep between the steps.
_STEP_MEMORY: Names = (
    ("steps_since_evaluation", "1"),
    ("rack_force", "N"),  # at the last evaluation of the chassis
    ("rack_force_before", "N"),  # at the one before
    ("hand_torque_mean", "N m"),  # over the last step
    ("hand_torque_mean_before", "N m"),
    ("friction_torque_mean", "N m"),
    ("friction_torque_mean_before", "N m"),
)
# Means of the inputs since the last evaluation, each step divided by the number of steps in a chassis step.
_MEAN_INPUTS: Names = tuple((f"{name}_mean", unit) for name, unit in INPUTS)
_LAST_INPUTS: Names = tuple((f"{name}_at_evaluation", unit) for name, unit in INPUTS)


class Layout(NamedTuple):
    """First position of each part."""

    column: int
    assist: int
    steps: int  # steps since the last evaluation of the chassis
    rack_force: int  # at the last evaluation of the chassis
    rack_force_before: int
    hand_torque: int  # mean over the last step
    hand_torque_before: int
    friction_torque: int  # mean over the last step
    friction_torque_before: int
    mean_inputs: int
    last_inputs: int
    chassis: int
    rate: int  # derivative of the chassis states at the last evaluation
    rate_before: int
    outputs: int
    outputs_before: int
    motor: int  # its limits
    wire: int  # controllers of a steer-by-wire
    functions: int  # of the assist
    memory: int  # of the friction law, to the end of the array


class Parts(NamedTuple):
    """What belongs to the chassis, as views of the state array of a plant."""

    mean_inputs: Any  # (I,) since the last evaluation
    last_inputs: Any  # (I,) at the last evaluation
    state: Any  # (n,)
    rate: Any  # (n,) derivative of the state at the last evaluation
    rate_before: Any  # (n,) at the one before
    outputs: Any  # (m,) at the last evaluation
    outputs_before: Any  # (m,)


_ASSIST = len(column.STATES)
_STEP_MEMORY_POSITION = _ASSIST + len(eps.STATES)
_MEAN = _STEP_MEMORY_POSITION + len(_STEP_MEMORY)
_LAST = _MEAN + len(INPUTS)
_CHASSIS = _LAST + len(INPUTS)


@kernel
def _arrange(n, m, j, w, k):
    """The layout for ``n`` states and ``m`` outputs of the chassis, ``j`` of motor, ``w`` of wire, ``k`` of rest."""
    rate, outputs = _CHASSIS + n, _CHASSIS + 3 * n
    return Layout(
        column=0,
        assist=_ASSIST,
        steps=_STEP_MEMORY_POSITION,
        rack_force=_STEP_MEMORY_POSITION + 1,
        rack_force_before=_STEP_MEMORY_POSITION + 2,
        hand_torque=_STEP_MEMORY_POSITION + 3,
        hand_torque_before=_STEP_MEMORY_POSITION + 4,
        friction_torque=_STEP_MEMORY_POSITION + 5,
        friction_torque_before=_STEP_MEMORY_POSITION + 6,
        mean_inputs=_MEAN,
        last_inputs=_LAST,
        chassis=_CHASSIS,
        rate=rate,
        rate_before=rate + n,
        outputs=outputs,
        outputs_before=outputs + m,
        motor=outputs + 2 * m,
        wire=outputs + 2 * m + j,
        functions=outputs + 2 * m + j + w,
        memory=outputs + 2 * m + j + w + k,
    )


@part
def layout_in_kernels(p):
    """The layout of a plant, in kernels; up to the motor compiled code knows its numbers as constants."""
    n, m, a = chassis.state_size(p.chassis), chassis.output_size(p.chassis), p.assist
    return _arrange(n, m, motor.size(a.motor), by_wire.size(a.wire), functions.size(a.functions))


@part
def layout_to_motor(p):
    """As :func:`layout_in_kernels`, of a plant of which the steering is left out: right up to the motor."""
    return _arrange(chassis.state_size(p.chassis), chassis.output_size(p.chassis), 0, 0, 0)


@part
def parts_of_chassis(at, state):
    """The :class:`Parts` of a state array with a layout, in kernels."""
    return Parts(
        state[at.mean_inputs : at.last_inputs],
        state[at.last_inputs : at.chassis],
        state[at.chassis : at.rate],
        state[at.rate : at.rate_before],
        state[at.rate_before : at.outputs],
        state[at.outputs : at.outputs_before],
        state[at.outputs_before : at.motor],
    )


def plant_layout(p: Any) -> Layout:
    """The layout of a plant, in Python."""
    kind = chassis.chassis_of(p.chassis)
    n, m, a = len(kind.states), len(kind.outputs), p.assist
    own = (motor.states(a.motor), by_wire.states(a.wire), functions.states(a.functions))
    return plain(_arrange)(n, m, *map(len, own))


def state_size(p: Any) -> int:
    """Length of the state array of a plant."""
    return plant_layout(p).memory + law_of(p.friction).memory_size(p.friction)


def state_names(p: Any) -> Names:
    """Names and units of the states of a plant, in the order of the array."""
    kind = chassis.chassis_of(p.chassis)
    return (
        *column.STATES,
        *eps.STATES,
        *_STEP_MEMORY,
        *_MEAN_INPUTS,
        *_LAST_INPUTS,
        *kind.states,
        *((f"{name}_derivative", f"{unit}/s") for name, unit in kind.states),
        *((f"{name}_derivative_before", f"{unit}/s") for name, unit in kind.states),
        *kind.outputs,
        *((f"{name}_before", unit) for name, unit in kind.outputs),
        *motor.states(p.assist.motor),
        *by_wire.states(p.assist.wire),
        *functions.states(p.assist.functions),
        *((f"friction_memory_{i}", "") for i in range(law_of(p.friction).memory_size(p.friction))),
    )
