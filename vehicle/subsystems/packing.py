"""Parameters as flat numbers, and compiled code that puts the parameters together again at an address.

A ``NamedTuple`` of parameters, with tuples and arrays within it, becomes two arrays of floats: the numbers, of which
each instance of a unit has its own, and the tables (kinematics, road), which all instances share. The order is that of
the fields. Nothing here knows a law, a car or a chassis: a new one is packed as it is.
"""

import hashlib
from collections.abc import Iterator
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.extending import models, register_model
from numba.np.arrayobj import populate_array
from numpy.typing import NDArray

from steer_env.vehicle.plant_batch import SHARED

Array = NDArray[np.float64]
_intrinsic: Any = extending.intrinsic  # whose first argument no caller gives


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


class _Place(NamedTuple):
    """Where compiled code finds a leaf; the shapes are constants of the code."""

    table: bool
    start: int
    shape: tuple[int, ...]
    strides: tuple[int, ...]
    itemsize: int


class Floats(types.CPointer):
    """The address of floats that make a value like a template: a type of compiled code, and the same to a machine.

    Functions that take such addresses are therefore compiled for each structure of parameters, and called alike.
    """

    def __init__(self, template: Any) -> None:
        self.value_type = numba.typeof(template)  # of the value, which the cache of the kernels looks at
        self.places = tuple(
            _Place(leaf.table, leaf.start, value.shape, value.strides, value.itemsize)
            for leaf in leaves(template)
            for value in (np.asarray(leaf.value),)
        )
        super().__init__(types.float64)
        content = repr((self.value_type, self.places)).encode()
        self.name = f"Floats({hashlib.sha256(content).hexdigest()})"  # short, as it becomes part of names

    @property
    def key(self) -> Any:
        """What two equal types have in common."""
        return self.value_type, self.places


register_model(Floats)(models.PointerModel)


@_intrinsic
def at_addresses(typing_context, numbers, tables):  # numba's form of a function that makes its own code
    """A value like the template of the address ``numbers``, of type ``Floats``, from there and from ``tables``.

    The arrays within the value are views.
    """
    kind = numbers.value_type

    def generate(context, builder, signature, addresses):
        return _value(context, builder, kind, iter(numbers.places), addresses)

    return kind(numbers, tables), generate


def _value(context: Any, builder: Any, kind: Any, rest: Iterator[_Place], addresses: Any) -> Any:
    """The value of a numba type from the places that come next."""
    if isinstance(kind, types.BaseTuple):
        members = [_value(context, builder, member, rest, addresses) for member in kind]  # type: ignore[attr-defined]
        return context.make_tuple(builder, kind, members)
    place = next(rest)
    at = builder.gep(addresses[place.table], [_index(place.start)])
    if not isinstance(kind, types.Array):
        number = builder.load(at)
        # No kernel writes to parameters: the compiler may load one where it is used, and need not keep all of them.
        number.set_metadata("invariant.load", builder.module.add_metadata([]))
        return context.cast(builder, number, types.float64, kind)
    array = context.make_array(kind)(context, builder)
    populate_array(
        array,
        data=builder.bitcast(at, array.data.type),
        shape=[_index(n) for n in place.shape],
        strides=[_index(n) for n in place.strides],
        itemsize=_index(place.itemsize),
        meminfo=None,
    )
    return array._getvalue()


def _index(i: int) -> ir.Constant:
    return ir.Constant(ir.IntType(64), i)
