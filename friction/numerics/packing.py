"""Packed parameters: a tuple of parameters as flat numbers, and compiled code that puts it together again.

A ``NamedTuple`` of parameters, with tuples and arrays within it, becomes two arrays of floats in the order of the
fields: the numbers, which each row of a batch and each instance of an FMU has of its own, and the tables, which all of
them share, as they are too large for a copy each. A class whose values are tables is marked by
:func:`mark_as_tables`. Nothing here knows a law, a car or a chassis: a new one is packed as it is.
"""

import hashlib
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, TypeVar

import numba
import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.core.imputils import impl_ret_borrowed
from numba.extending import models, register_model
from numba.np.arrayobj import populate_array
from numpy.typing import NDArray

from steer_env.friction.numerics import simd
from steer_env.friction.numerics.kernel import dispatch

Array = NDArray[np.float64]
Class = TypeVar("Class", bound=type)
_intrinsic: Any = extending.intrinsic  # whose first argument no caller gives
_shared: set[type] = set()
_common: dict[type, tuple[str, ...]] = {}


def mark_as_tables(kind: Class) -> Class:
    """Mark a class of parameters as tables."""
    _shared.add(kind)
    return kind


def common(*fields: str) -> Callable[[Class], Class]:
    """Mark numbers of a class that must be equal in rows side by side (:func:`of_rows`): branches depend on them."""

    def marked(kind: Class) -> Class:
        _common[kind] = fields
        return kind

    return marked


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
        table = table or type(value) in _shared
        names = getattr(value, "_fields", range(len(value)))
        for name, member in zip(names, value):
            yield from _walk((*path, str(name)), member, type(value), table)
    else:
        yield path, value, owner, table


class Packed(NamedTuple):
    """Parameters as floats."""

    numbers: Array  # (N,)
    tables: Array  # (T,)


def pack(parameters: Any) -> Packed:
    """All numbers and all tables of the parameters, in the order of :func:`leaves`."""
    found: tuple[list[float], list[float]] = [], []
    _collect(parameters, *found)
    return Packed(*map(np.array, found))


def numbers(parameters: Any) -> Array:
    """The numbers alone (N,), as a reset needs them."""
    found: list[float] = []
    _collect(parameters, found, None)
    return np.array(found)


def _collect(value: Any, numbers: list[float], tables: list[float] | None) -> None:
    """As :func:`leaves`, without the paths, which take most of its time."""
    if isinstance(value, tuple):
        if type(value) in _shared:
            if tables is None:
                return
            numbers = tables
        for member in value:
            _collect(member, numbers, tables)
    elif isinstance(value, np.ndarray):
        numbers += np.ascontiguousarray(value).view(np.float64).ravel().tolist()
    else:
        numbers.append(float(value))


def slices(parameters: Any) -> dict[str, slice]:
    """Slice of each parameter in the numbers, by its dotted name."""
    numbers = (leaf for leaf in leaves(parameters) if not leaf.table)
    return {".".join(leaf.path): slice(leaf.start, leaf.start + leaf.size) for leaf in numbers}


def common_columns(parameters: Any) -> NDArray[np.int64]:
    """Where the numbers (N,) stand that must be equal in rows side by side: (R, 2) first and last + 1 of each run.

    They are the whole numbers, the records, and what :func:`common` marks.
    """
    found: list[list[int]] = [[0, 0]]
    for leaf in leaves(parameters):
        structured = np.ndim(leaf.value) and np.asarray(leaf.value).dtype != np.float64
        marked = leaf.path[-1] in _common.get(leaf.owner or object, ())
        if not leaf.table and (structured or marked or isinstance(leaf.value, int)):
            if found[-1][1] != leaf.start:
                found.append([leaf.start, leaf.start])
            found[-1][1] = leaf.start + leaf.size
    return np.array(found)


def kind(parameters: Any) -> Any:
    """What parameters have in common that kernels take as one type, with numbers at the same places and one table."""
    if isinstance(parameters, tuple):
        inner = id if type(parameters) in _shared else kind
        return type(parameters), *map(inner, parameters)
    if isinstance(parameters, np.ndarray):
        return type(parameters), parameters.dtype, parameters.shape, parameters.flags.writeable
    return type(parameters)


def structure(parameters: Any) -> Any:
    """The parameters with None for every float among the numbers: a template for :func:`of_row`.

    A call from Python hands over a tuple leaf by leaf; floats that :func:`of_row` replaces would take most of its time.
    """
    if isinstance(parameters, tuple) and type(parameters) not in _shared:
        members = [structure(member) for member in parameters]
        return type(parameters)(*members) if hasattr(parameters, "_fields") else tuple(members)
    return None if isinstance(parameters, float) else parameters


def of_row(template, rows, i):
    """The parameters of row ``i``: a template with the numbers (N,) of ``rows[i]``, and its own tables.

    The template may be an :func:`structure`. Compiled code assembles the parameters in registers, so that the kernels
    receive the same tuple as of parameters alone.
    """
    return _filled(template, iter(leaves(template)), rows[i])


def _filled(value: Any, rest: Iterator[Leaf], row: Array) -> Any:
    if isinstance(value, tuple) and type(value) in _shared:
        for _ in _walk((), value, None, True):
            next(rest)
        return value
    if isinstance(value, tuple):
        return type(value)(*[_filled(member, rest, row) for member in value])
    leaf = next(rest)
    numbers = row[leaf.start : leaf.start + leaf.size]
    if np.ndim(value):
        return numbers.view(value.dtype).reshape(value.shape).view(type(value))
    return float(numbers[0]) if value is None else type(value)(numbers[0])


def of_rows(template, rows, four):
    """The parameters of four rows side by side, at the places ``four``; in compiled code alone.

    A float has a lane for each row, an array of floats becomes ``Rows``. What must be equal in all four
    (:func:`common_columns`) is that of the first.
    """
    raise NotImplementedError


# Compiled code.


def _rebuilt(context: Any, builder: Any, kind: Any, leaf: Callable[[Any, Any], Any], template: Any = None) -> Any:
    """The value of a numba type from its leaves, each by its type and by what a template, if there is one, has there.

    The tables are those of the template.
    """
    if hasattr(kind, "generate"):  # what object code holds itself: steer_env.friction.numerics.units.LinkedType
        return kind.generate(context, builder)
    if not isinstance(kind, types.BaseTuple):
        return leaf(kind, template)
    if template is not None and getattr(kind, "instance_class", None) in _shared:
        return template
    members = []
    for k, member in enumerate(kind):  # type: ignore[arg-type,var-annotated]  # numba declares no members
        inner = None if template is None else builder.extract_value(template, k)
        members.append(_rebuilt(context, builder, member, leaf, inner))
    return context.make_tuple(builder, _unlinked(kind), members)


def _filled_type(kind: Any) -> Any:
    """The numba type of what :func:`of_row` makes of a template."""
    if isinstance(kind, types.BaseTuple) and getattr(kind, "instance_class", None) not in _shared:
        members = [_filled_type(member) for member in kind]  # type: ignore[attr-defined]  # numba declares no members
        return types.BaseTuple.from_types(members, getattr(kind, "instance_class", None))
    return types.float64 if kind == types.none else kind


@_intrinsic
def _of_row(typing_context, template, rows, i):  # numba's form of a function that makes its own code
    def generate(context, builder, signature, arguments):
        array = context.make_array(signature.args[1])(context, builder, arguments[1])
        stride = builder.extract_value(array.strides, 0)  # in bytes
        start = builder.bitcast(array.data, ir.IntType(8).as_pointer())
        first = builder.gep(start, [builder.mul(stride, arguments[2])])
        next_number = builder.bitcast(first, ir.DoubleType().as_pointer())

        def leaf(kind, value):
            nonlocal next_number
            at = next_number
            if not isinstance(kind, types.Array):
                next_number = builder.gep(at, [_index(1)])
                return context.cast(builder, builder.load(at), types.float64, kind)
            array = context.make_array(kind)(context, builder, value)
            array.data = builder.bitcast(at, array.data.type)
            next_number = builder.gep(at, [builder.udiv(builder.mul(array.nitems, array.itemsize), _index(8))])
            return array._getvalue()

        filled = _rebuilt(context, builder, signature.return_type, leaf, arguments[0])
        return impl_ret_borrowed(context, builder, signature.return_type, filled)  # the arrays stay the template's

    return _filled_type(template)(template, rows, types.intp), generate


def _four_rows_type(kind: Any, same: bool = False) -> Any:
    """The numba type of what :func:`of_rows` makes of a template; ``same`` where all rows have one value."""
    if isinstance(kind, types.BaseTuple):
        made_of = getattr(kind, "instance_class", None)
        if made_of in _shared:
            return kind
        names, marked = getattr(kind, "fields", range(len(kind))), _common.get(made_of or object, ())
        members = [_four_rows_type(member, name in marked) for name, member in zip(names, kind)]  # type: ignore[call-overload]
        return types.BaseTuple.from_types(members, made_of)
    number = types.float64 if kind == types.none else kind
    if same:
        return number
    if isinstance(number, types.Array) and number.dtype == types.float64:
        return simd.Rows(number)
    return simd.FOUR if isinstance(number, types.Float) else number


@_intrinsic
def _of_rows(typing_context, template, rows, four):
    """As :func:`_of_row`, with the numbers of four rows."""

    def generate(context, builder, signature, arguments):
        array = context.make_array(signature.args[1])(context, builder, arguments[1])
        stride = builder.extract_value(array.strides, 0)  # in bytes
        start = builder.bitcast(array.data, ir.IntType(8).as_pointer())
        row = [builder.mul(stride, builder.extract_element(arguments[2], _index(k))) for k in range(4)]
        next_number = [builder.bitcast(builder.gep(start, [at]), ir.DoubleType().as_pointer()) for at in row]
        offsets = simd.gathered(builder, [builder.sub(at, row[0]) for at in row])

        def rebuilt(kind, value):
            nonlocal next_number
            if isinstance(kind, types.BaseTuple):
                if getattr(kind, "instance_class", None) in _shared:
                    return value
                kinds: Any = kind  # numba declares no members
                members = [rebuilt(member, builder.extract_value(value, k)) for k, member in enumerate(kinds)]
                return context.make_tuple(builder, kind, members)
            at, size = next_number, _index(1)
            one = kind.array if isinstance(kind, simd.Rows) else kind
            if isinstance(one, types.Array):
                array = context.make_array(one)(context, builder, value)
                array.data = builder.bitcast(at[0], array.data.type)
                size = builder.udiv(builder.mul(array.nitems, array.itemsize), _index(8))
                found = array._getvalue()
                if isinstance(kind, simd.Rows):
                    found = simd.rows_from(context, builder, kind, found, offsets)
            elif kind == simd.FOUR:
                found = simd.gathered(builder, [builder.load(each) for each in at])
            else:
                found = context.cast(builder, builder.load(at[0]), types.float64, kind)
            next_number = [builder.gep(each, [size]) for each in at]
            return found

        filled = rebuilt(signature.return_type, arguments[0])
        return impl_ret_borrowed(context, builder, signature.return_type, filled)

    return _four_rows_type(template)(template, rows, four), generate


def _row(template, rows, i):
    return _of_row(template, rows, i)


def _four_rows(template, rows, four):
    return _of_rows(template, rows, four)


dispatch(of_row, lambda kind, _: _row)
dispatch(of_rows, lambda kind, _: _four_rows)


class _LeafAddress(NamedTuple):
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
        self.value_type = numba.typeof(template)
        self.parts = (self.value_type,)  # which the cache of the kernels looks at
        self.places = tuple(
            _LeafAddress(leaf.table, leaf.start, value.shape, value.strides, value.itemsize)
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
def at_addresses(typing_context, numbers, tables):
    """A value like the template of the address ``numbers``, of type ``Floats``, from there and from ``tables``.

    The arrays within the value are views.
    """
    kind = numbers.value_type

    def generate(context, builder, signature, addresses):
        rest = iter(numbers.places)

        def leaf(kind, _):
            place = next(rest)
            at = builder.gep(addresses[place.table], [_index(place.start)])
            if not isinstance(kind, types.Array):
                number = builder.load(at)
                # No kernel writes to parameters: the compiler may load one where it is used, and need not keep them.
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

        return _rebuilt(context, builder, kind, leaf)

    return _unlinked(kind)(numbers, tables), generate


def _unlinked(kind: Any) -> Any:
    """The numba type of what :func:`_rebuilt` makes of another one."""
    if isinstance(kind, types.BaseTuple):
        members = [_unlinked(member) for member in kind]  # type: ignore[attr-defined]  # numba declares no members
        return types.BaseTuple.from_types(members, getattr(kind, "instance_class", None))
    return getattr(kind, "made", kind)


def _index(i: int) -> ir.Constant:
    return ir.Constant(ir.IntType(64), i)
