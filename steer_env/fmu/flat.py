"""Parameters as flat numbers, and compiled code that puts the parameters together again at an address.

A ``NamedTuple`` of parameters, with tuples and arrays within it, becomes two arrays of floats: the numbers, of which
each instance of a unit has its own, and the tables (kinematics, road), which all instances share. The order is that of
the fields. Nothing here knows a law, a car or a chassis: a new one is packed as it is.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array
from numpy.typing import NDArray

from steer_env.vehicle.plant_batch import SHARED

Array = NDArray[np.float64]


class Leaf(NamedTuple):
    """A number, an array or a record of the parameters, and where its numbers stand."""

    path: tuple[str, ...]  # names of the fields that lead to it
    value: Any
    owner: type | None  # the class that declares the last field; None for a value that is no field
    table: bool  # whether it stands in the tables, not in the numbers
    start: int  # position there

    @property
    def size(self) -> int:
        """How many floats it takes."""
        return self.value.nbytes // 8 if np.ndim(self.value) else 1


def leaves(parameters: Any) -> list[Leaf]:
    """Every leaf of the parameters in the order of their fields.

    Raises
    ------
    TypeError
        An array whose elements do not fill whole floats.
    """
    ends = [0, 0]
    found = []
    for path, value, owner, table in _walk((), parameters, None, False):
        if np.ndim(value) and (value.itemsize % 8 or not value.flags.c_contiguous):
            raise TypeError(f"{'.'.join(path)} must be a contiguous array of floats, got {value.dtype}")
        leaf = Leaf(path, value, owner, table, ends[table])
        ends[table] += leaf.size
        found.append(leaf)
    return found


def _walk(path: tuple[str, ...], value: Any, owner: type | None, table: bool) -> Iterator[tuple]:
    if isinstance(value, tuple):
        table = table or isinstance(value, SHARED)
        names = getattr(value, "_fields", range(len(value)))
        for name, member in zip(names, value):
            yield from _walk((*path, str(name)), member, type(value), table)
    else:
        yield path, value, owner, table


def _floats(leaf: Leaf) -> Array:
    if np.ndim(leaf.value):
        return np.ascontiguousarray(leaf.value).view(np.float64).ravel()
    return np.array([float(leaf.value)])


def numbers_and_tables(parameters: Any) -> tuple[Array, Array]:
    """All numbers (N,) and all tables (T,) of the parameters."""
    found = leaves(parameters)
    numbers, tables = ([_floats(leaf) for leaf in found if leaf.table == table] for table in (False, True))
    return np.concatenate([np.zeros(0), *numbers]), np.concatenate([np.zeros(0), *tables])


def at_addresses(template: Any) -> Any:
    """A function ``(numbers, tables)`` for compiled code: parameters like the template, from two ``float*``.

    The shapes of the arrays are constants of the compiled code. The arrays within the result are views.
    """
    kind = numba.typeof(template)
    pointer = types.CPointer(types.float64)

    @intrinsic
    def parameters(typing_context, numbers, tables):  # numba's form of a function that makes its own code
        def generate(context, builder, signature, addresses):
            return _value(context, builder, kind, iter(leaves(template)), addresses)

        return kind(pointer, pointer), generate

    return parameters


def _value(context: Any, builder: Any, kind: Any, rest: Iterator[Leaf], addresses: Any) -> Any:
    """The value of a numba type from the leaves that come next."""
    if isinstance(kind, types.BaseTuple):
        members = [_value(context, builder, member, rest, addresses) for member in kind]  # type: ignore[attr-defined]
        return context.make_tuple(builder, kind, members)
    leaf = next(rest)
    at = builder.gep(addresses[leaf.table], [_index(leaf.start)])
    if not isinstance(kind, types.Array):
        number = builder.load(at)
        # No kernel writes to parameters: the compiler may load one where it is used, and need not keep all of them.
        number.set_metadata("invariant.load", builder.module.add_metadata([]))
        return context.cast(builder, number, types.float64, kind)
    array = context.make_array(kind)(context, builder)
    populate_array(
        array,
        data=builder.bitcast(at, array.data.type),
        shape=[_index(n) for n in leaf.value.shape],
        strides=[_index(n) for n in leaf.value.strides],
        itemsize=_index(leaf.value.itemsize),
        meminfo=None,
    )
    return array._getvalue()


def _index(i: int) -> ir.Constant:
    return ir.Constant(ir.IntType(64), i)
