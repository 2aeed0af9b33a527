"""The numbers and names of a unit as C text, which the core reads as ``unit``."""

import json
import math
from collections.abc import Iterable

import numpy as np

from steer_env.connect.fmu.object_code import Processor
from steer_env.connect.fmu.variables import Variable
from steer_env.friction.numerics.packing import pack
from steer_env.vehicle.subsystems import Subsystem


def c_data(subsystem: Subsystem, variables: list[Variable], processor: Processor, token: str) -> str:
    """C source that defines ``unit``."""
    numbers, tables = pack(subsystem.parameters)
    needed = processor.masks().items()
    lines = [
        '#include "unit.h"',
        _array("struct requirement", "requirements", (f"{{{leaf}u, '{r}', {bits}u}}" for (leaf, r), bits in needed)),
        _array("struct variable", "variables", map(_variable, variables)),
        _array("char *const", "states", map(json.dumps, subsystem.states)),
        *(
            _array("double", name, map(_float, values))
            for name, values in (
                ("numbers", numbers),
                ("tables", tables),
                ("begin", subsystem.begin),
                ("start", subsystem.start),
                ("shown", subsystem.shown),
                ("given", [s.start for s in subsystem.given] + [0.0] * (subsystem.given_size - len(subsystem.given))),
            )
        ),
        _array("unsigned", "places", map(str, subsystem.zero_states)),
        _array("unsigned", "rows", map(str, subsystem.zero_outputs)),
        "const struct unit unit = {",
        f"    .token = {json.dumps(token)},",
        f"    .processor = {json.dumps(processor.name)},",
        *(f"    .{name} = {name}," for name in ("requirements", "variables", "states", "numbers", "tables")),
        *(f"    .{name} = {name}," for name in ("begin", "start", "shown", "given", "places", "rows")),
        f"    .requirement_count = {len(needed)},",
        f"    .variable_count = {len(variables)},",
        f"    .number_count = {numbers.size},",
        f"    .state_count = {subsystem.start.size},",
        f"    .given_count = {subsystem.given_size},",
        f"    .input_count = {subsystem.inputs},",
        f"    .output_count = {len(subsystem.outputs)},",
        f"    .place_count = {len(subsystem.zero_states)},",
        f"    .row_count = {len(subsystem.zero_outputs)},",
        f"    .settling = {subsystem.settling},",
        "};",
    ]
    return "\n".join(lines) + "\n"


def _array(kind: str, name: str, values: Iterable[str]) -> str:
    """An array; C has none of length zero, so that an empty one gets an element that nothing reads."""
    return f"static const {kind} {name}[] = {{{', '.join(values) or '0'}}};"


def _float(value: float) -> str:
    """A float without loss; hexadecimal, as C knows it."""
    if not math.isfinite(value):
        raise ValueError(f"a unit holds finite numbers only, got {value}")
    return float(np.float64(value)).hex()


def _variable(v: Variable) -> str:
    kind = "BOOLEAN" if v.boolean else "REAL"
    return f"{{{json.dumps(v.name)}, {v.array}, {v.place}, {v.use}, {kind}, {int(v.not_negative)}}}"
