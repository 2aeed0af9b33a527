"""Many plants of one kind: their individual numbers are the rows of an array, and they share the tables.

The plant of a row is a template with its numbers replaced by those of the row. Compiled code assembles it in registers,
so that the kernels receive the same tuple as for a single plant. All rows share the tables of strut and road.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.imputils import impl_ret_borrowed
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

from steer_env.friction.numerics.kernel import COMPILED, kernel
from steer_env.vehicle import plant
from steer_env.vehicle.road import Road
from steer_env.vehicle.suspension.kinematics_table import KinematicsTable

Array = NDArray[np.float64]

SHARED = (KinematicsTable, Road)  # too large for a copy in each row


def numbers(p: Any) -> Array:
    """Numbers of a plant (K,) in the order of :func:`plant_of_row`, without the shared tables."""
    return np.concatenate([np.zeros(0), *(part for _, part in _parts("", p))])


def slices(p: Any) -> dict[str, slice]:
    """Slice of each parameter in the numbers, by its dotted name."""
    found, start = {}, 0
    for name, part in _parts("", p):
        found[name] = slice(start, start + part.size)
        start += part.size
    return found


def _parts(name: str, value: Any) -> list[tuple[str, Array]]:
    if isinstance(value, SHARED):
        return []
    if isinstance(value, tuple):
        fields: Any = value
        return [
            part for key in fields._fields for part in _parts(f"{name}.{key}" if name else key, getattr(value, key))
        ]
    return [
        (name, np.ascontiguousarray(value).view(np.float64).ravel() if np.ndim(value) else np.array([float(value)]))
    ]


def plant_of_row(template, rows, i):
    """The plant of row ``i``: the template with the numbers (K,) of ``rows[i]``."""
    return _filled(template, rows[i], 0)[0]


def _filled(value: Any, row: Array, start: int) -> tuple[Any, int]:
    if isinstance(value, SHARED):
        return value, start
    if isinstance(value, tuple):
        members = []
        for member in value:
            filled, start = _filled(member, row, start)
            members.append(filled)
        return type(value)(*members), start
    if np.ndim(value):
        end = start + value.nbytes // 8
        return row[start:end].view(value.dtype).reshape(value.shape).view(type(value)), end
    return type(value)(row[start]), start + 1


@intrinsic
def _plant_of_row(context, template, rows, i):
    def generate(context, builder, signature, arguments):
        array = context.make_array(signature.args[1])(context, builder, arguments[1])
        stride = builder.extract_value(array.strides, 0)  # in bytes
        start = builder.bitcast(array.data, ir.IntType(8).as_pointer())
        first = builder.gep(start, [builder.mul(stride, arguments[2])])
        at = builder.bitcast(first, ir.DoubleType().as_pointer())
        filled = fill(context, builder, signature.args[0], arguments[0], at)[0]
        return impl_ret_borrowed(context, builder, signature.return_type, filled)  # the arrays stay the template's

    def fill(context, builder, kind, value, at):
        """The value with its numbers replaced, and the address of the numbers that follow."""
        if isinstance(kind, types.BaseTuple):
            if getattr(kind, "instance_class", None) in SHARED:
                return value, at
            members: list[Any] = []
            for k, member in enumerate(kind):  # type: ignore[arg-type,var-annotated]  # numba declares no members
                filled, at = fill(context, builder, member, builder.extract_value(value, k), at)
                members.append(filled)
            return context.make_tuple(builder, kind, members), at
        if isinstance(kind, types.Array):
            array = context.make_array(kind)(context, builder, value)
            array.data = builder.bitcast(at, array.data.type)
            eighths = builder.udiv(builder.mul(array.nitems, array.itemsize), context.get_constant(types.intp, 8))
            return array._getvalue(), builder.gep(at, [eighths])
        number = context.cast(builder, builder.load(at), types.float64, kind)
        return number, builder.gep(at, [context.get_constant(types.intp, 1)])

    return template(template, rows, types.intp), generate


if COMPILED:

    @overload(plant_of_row, strict=False)
    def _chosen(template, rows, i):
        return lambda template, rows, i: _plant_of_row(template, rows, i)  # type: ignore[call-arg]  # numba gives the context


@kernel
def run(template, rows, states, inputs, channels, finite, low, high):
    """Advance the plants of the rows from ``low`` to ``high`` by one sample of 1 ms per row of inputs.

    Parameters
    ----------
    template : Plant
        A plant of the kind that all rows have.
    rows : (N, K) array
        Numbers of the plants.
    states : (N, S) array
        Advanced in place.
    inputs : (N, T, I) array
        As in ``steer_env.vehicle.plant.INPUTS``.
    channels : (N, C) array
        Receives the channels at the end.
    finite : (N,) array of bool
        Receives whether every state is finite.
    """
    for i in range(low, high):
        p = plant_of_row(template, rows, i)
        finite[i] = plant.run(p, states[i], inputs[i], channels[i : i + 1], 1)
