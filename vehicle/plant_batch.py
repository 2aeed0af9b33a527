"""Many plants of one kind side by side: what differs between them in the rows of an array, what they share in one.

A lane's plant is a template with its numbers replaced by those of the lane. Compiled code puts it together in
registers, so kernels meet the very tuple that a single plant has; the tables of strut and road are shared.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

from steer_env.friction.numerics.kernel import COMPILED, kernel
from steer_env.vehicle import plant
from steer_env.vehicle.road import Road
from steer_env.vehicle.suspension.kinematics_table import KinematicsTable

Array = NDArray[np.float64]

SHARED = (KinematicsTable, Road)  # tables too large for a copy in each lane


def numbers(p: Any) -> Array:
    """Numbers of a plant (K,) in the order in which :func:`lane` takes them; what lanes share is left out."""
    return np.concatenate([np.zeros(0), *(part for _, part in _parts("", p))])


def places(p: Any) -> dict[str, slice]:
    """Where each parameter stands among the numbers, by its dotted name."""
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


def lane(template, rows, i):
    """The plant of lane ``i``: the template with the numbers (K,) of ``rows[i]``."""
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
def _lane(context, template, rows, i):
    def generate(context, builder, signature, arguments):
        array = context.make_array(signature.args[1])(context, builder, arguments[1])
        (stride, _) = cgutils.unpack_tuple(builder, array.strides, 2)
        first = cgutils.pointer_add(builder, array.data, builder.mul(stride, arguments[2]))
        at = builder.bitcast(first, ir.DoubleType().as_pointer())
        filled = fill(context, builder, signature.args[0], arguments[0], at)[0]
        return impl_ret_borrowed(context, builder, signature.return_type, filled)  # the arrays stay the template's

    def fill(context, builder, kind, value, at):
        """The value with its numbers replaced, and where those that follow stand."""
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

    @overload(lane, strict=False)
    def _chosen(template, rows, i):
        return lambda template, rows, i: _lane(template, rows, i)  # type: ignore[call-arg]  # numba gives the context


@kernel
def run(template, rows, states, inputs, channels, finite, low, high):
    """Advance the lanes from ``low`` to ``high`` by one sample of 1 ms per row of inputs.

    Parameters
    ----------
    template : Plant
        Whose kind all lanes share.
    rows : (L, K) array
        Numbers of each lane's plant.
    states : (L, S) array
        Advanced in place.
    inputs : (L, N, I) array
        As in ``steer_env.vehicle.plant.INPUTS``.
    channels : (L, C) array
        Receives the channels at the end.
    finite : (L,) array of bool
        Receives whether every state is finite.
    """
    for i in range(low, high):
        p = lane(template, rows, i)
        finite[i] = plant.run(p, states[i], inputs[i], channels[i : i + 1], 1)
