"""The numbers and names of a unit as C text, which the core reads as ``unit``."""

import json
import math
from collections.abc import Iterable

import numpy as np

from steer_env.connect.fmu.variables import Variable
from steer_env.vehicle.subsystems.packing import numbers_and_tables
from steer_env.vehicle.subsystems.processor import Processor
from steer_env.vehicle.subsystems.subsystem import Part


def c_data(part: Part, variables: list[Variable], processor: Processor, token: str) -> str:
    """C source that defines ``unit``."""
    numbers, tables = numbers_and_tables(part.parameters)
    needed = processor.masks().items()
    lines = [
        '#include "unit.h"',
        _array("struct requirement", "requirements", (f"{{{leaf}u, '{r}', {bits}u}}" for (leaf, r), bits in needed)),
        _array("struct variable", "variables", map(_variable, variables)),
        _array("char *const", "states", map(json.dumps, part.states)),
        *(
            _array("double", name, map(_float, values))
            for name, values in (
                ("numbers", numbers),
                ("tables", tables),
                ("begin", part.begin),
                ("start", part.start),
                ("shown", part.shown),
                ("given", [s.start for s in part.given] + [0.0] * (part.given_size - len(part.given))),
            )
        ),
        _array("unsigned", "places", map(str, part.zero_states)),
        _array("unsigned", "rows", map(str, part.zero_outputs)),
        "const struct unit unit = {",
        f"    .token = {json.dumps(token)},",
        f"    .processor = {json.dumps(processor.name)},",
        *(f"    .{name} = {name}," for name in ("requirements", "variables", "states", "numbers", "tables")),
        *(f"    .{name} = {name}," for name in ("begin", "start", "shown", "given", "places", "rows")),
        f"    .requirement_count = {len(needed)},",
        f"    .variable_count = {len(variables)},",
        f"    .number_count = {numbers.size},",
        f"    .state_count = {part.start.size},",
        f"    .given_count = {part.given_size},",
        f"    .input_count = {part.inputs},",
        f"    .output_count = {len(part.outputs)},",
        f"    .place_count = {len(part.zero_states)},",
        f"    .row_count = {len(part.zero_outputs)},",
        f"    .settling = {part.settling},",
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
