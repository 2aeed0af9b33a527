"""The variables of a unit: inputs, outputs and parameters, each with its unit, description and start value.

The parameters are the numbers of the subsystem's parameters. Unit and description come from the comment beside the
field, which the style of the project asks for, and of a friction law's field from the units that the law registers.
"""

import inspect
import re
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from steer_env.friction.law import LAWS
from steer_env.friction.numerics.packing import Leaf, leaves
from steer_env.vehicle.chassis.two_track.parameters import Body
from steer_env.vehicle.subsystems import Subsystem
from steer_env.vehicle.tyre.coefficients import MagicFormula

# Sections whose parameters may change while the unit runs; those of the others belong to the settled start.
TUNABLE = ("column", "assist", "friction", "level", "friction_load", "friction_torque_scale", "robot")
AXES = ("speeds", "torques")  # of tables: their values have to ascend, which a single value cannot keep
BOOLEAN = ("robot",)
_RECORDS: tuple[Any, ...] = (Body, MagicFormula)  # classes that the kernels take as records


class Variable(NamedTuple):
    """A variable of a unit."""

    name: str
    unit: str  # "" where none is known, or for a boolean
    description: str
    array: str  # of the unit: NUMBERS, GIVEN, OUTPUTS or TIME
    place: int  # position there
    use: str  # INPUT, OUTPUT, FIXED, TUNABLE or INDEPENDENT
    boolean: bool
    start: float  # in the unit of the variable
    not_negative: bool  # whether values below zero are refused


@cache
def _comments(owner: type) -> dict[str, tuple[str, str]]:
    """Description and unit of each field of a class, from the comments beside them; none without source text."""
    try:
        source = inspect.getsource(owner)
    except (OSError, TypeError):
        return {}
    found = {}
    for name, comment in re.findall(r"^\s+(\w+)\s*:[^#\n]*#\s*(.*?)\s*$", source, re.MULTILINE):
        *_, unit = (None, *re.finditer(r" ?\[([^\[\]]+)\]", comment))  # the last in brackets
        text = comment[: unit.start()] + comment[unit.end() :] if unit else comment
        found[name] = text, ("1" if unit[1] == "-" else unit[1]) if unit else ""
    return found


def _described(leaf: Leaf, field: str, owner: type | None) -> tuple[str, str]:
    text, unit = _comments(owner).get(field, ("", "")) if owner else ("", "")
    law = LAWS.of(owner)
    return text or field.replace("_", " "), law.units.get(field, unit) if law else unit


def _elements(leaf: Leaf) -> Iterator[tuple[str, str, type | None, int, float]]:
    """Name, field, class of the field, position and value of each float of a leaf."""
    name, field = ".".join(leaf.path), leaf.path[-1]
    names = getattr(getattr(leaf.value, "dtype", None), "names", None)
    if names:
        owner = next((kind for kind in _RECORDS if kind._fields == names), None)
        for i, key in enumerate(names):
            yield f"{name}.{key}", key, owner, leaf.start + i, float(leaf.value[key][0])
    elif np.ndim(leaf.value):
        for i, place in enumerate(np.ndindex(leaf.value.shape)):
            index = ",".join(str(k + 1) for k in place)
            yield f"{name}[{index}]", field, leaf.owner, leaf.start + i, float(leaf.value[place])
    else:
        yield name, field, leaf.owner, leaf.start, float(leaf.value)


def _settable(leaf: Leaf) -> bool:
    """Whether a leaf becomes parameters: floats, no tables, and arrays only where they may be tuned."""
    if leaf.table or isinstance(leaf.value, bool | int | np.integer):
        return False
    named = getattr(getattr(leaf.value, "dtype", None), "names", None)
    if np.ndim(leaf.value) and not named:
        return leaf.path[0] in TUNABLE and leaf.path[-1] not in AXES and leaf.value.dtype == np.float64
    return True


def _parameters(subsystem: Subsystem) -> Iterator[Variable]:
    for leaf in leaves(subsystem.parameters):
        if leaf.path[0] not in subsystem.sections or not _settable(leaf):
            continue
        for name, field, owner, place, value in _elements(leaf):
            text, unit = _described(leaf, field, owner)
            boolean = name in BOOLEAN
            use = "TUNABLE" if leaf.path[0] in TUNABLE else "FIXED"
            yield Variable(
                name, "" if boolean else unit, text, "NUMBERS", place, use, boolean, value, value > 0.0 and not boolean
            )


TIME = Variable("time", "s", "simulation time", "TIME", 0, "INDEPENDENT", False, 0.0, False)


def variables(subsystem: Subsystem, version: int) -> list[Variable]:
    """Every variable of a subsystem in a version of FMI; the position in the list is the value reference."""
    inputs = [
        Variable(s.name, s.unit, s.description, "GIVEN", i, "INPUT", False, s.start, False)
        for i, s in enumerate(subsystem.given)
    ]
    outputs = [
        Variable(s.name, s.unit, s.description, "OUTPUTS", i, "OUTPUT", False, float(subsystem.shown[i]), False)
        for i, s in enumerate(subsystem.outputs)
    ]
    return [*inputs, *outputs, *_parameters(subsystem), *((TIME,) if version == 3 else ())]
