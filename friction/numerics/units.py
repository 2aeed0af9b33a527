"""Units: functions that are compiled by themselves and called by address, so that no caller is compiled for them.

A plant has exchangeable parts, such as a friction law. The class of such a part, in the type of the plant, would make a
plant of its own of every combination. Instead, the functions of a part are compiled for its class alone. A caller knows
the part as a :class:`Unit`, the same type whatever the part is: its numbers, which stand in the row of the plant, and
the addresses of its functions. All of them begin with the same two arguments:

    f(numbers, sizes, ...)

the address of the numbers, as :func:`steer_env.friction.numerics.packing.pack` orders them, and that of ``sizes``: how
many floats the part remembers, then the lengths of the arrays among the numbers. :func:`values` makes the parameters of
these, and the numbers are those of direct calls to the bit. A function that raises passes its exception
on to the caller.

An address belongs to the process that compiled it. :func:`code` gives it to what is bound there, and nothing that
holds one is pickled or copied.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.core import cgutils
from numba.core.errors import NumbaTypeError
from numba.extending import models, register_model
from numba.np.arrayobj import populate_array
from numpy.typing import NDArray

from steer_env.friction.numerics import packing, simd
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.kernel import COMPILED, kernel

_intrinsic: Any = extending.intrinsic  # whose first argument no caller gives
ADDRESS_TYPE = ir.IntType(64)


def of_process(kind: Any) -> Any:
    """A class of what holds addresses, which stays in its process."""

    def refused(self: Any) -> Any:
        raise TypeError(f"{kind.__name__} holds addresses of this process: bind its parameters anew in another one")

    kind.__reduce__ = refused
    return packing.mark_as_tables(kind)


@of_process
class Code(NamedTuple):
    """What is common to all units of one class of parameters."""

    addresses: NDArray[np.int64]  # (F,) of its functions
    sizes: NDArray[np.int64]  # (1 + D,) floats that it remembers, lengths of the arrays among its numbers


class Unit(NamedTuple):
    """A part as its callers take it."""

    numbers: NDArray[np.float64]  # (K,)
    code: Code


class Part(NamedTuple):
    """A unit in kernels, by the addresses of what it consists of."""

    addresses: int
    numbers: int
    sizes: int


class Numbers(types.CPointer):
    """The address of the numbers of a part: a type of compiled code for each class, and the same to a machine.

    ``number`` is the type of each of them: a float, or a vector of four cars.
    """

    def __init__(self, parameters: Any, wide: bool = False) -> None:
        self.value_type = numba.typeof(parameters)
        self.parts = (self.value_type,)  # which the cache of the kernels looks at
        self.number = simd.FOUR if wide else types.float64
        super().__init__(self.number)
        self.name = f"Numbers({self.value_type}, {self.number})"

    @property
    def key(self) -> Any:
        """What two equal types have in common."""
        return self.value_type, self.number


register_model(Numbers)(models.PointerModel)


@_intrinsic
def values(typing_context, numbers, sizes):
    """The parameters of a part from its numbers and sizes, by address; their arrays are views."""
    if not isinstance(numbers, Numbers):
        return None

    def filled(kind: Any) -> Any:
        if isinstance(kind, types.BaseTuple):
            members = [filled(member) for member in kind]  # type: ignore[attr-defined]  # numba declares no members
            return types.BaseTuple.from_types(members, getattr(kind, "instance_class", None))
        if isinstance(kind, types.Array):
            dtype = numbers.number if isinstance(kind.dtype, types.Float) else kind.dtype
            if dtype != numbers.number and isinstance(numbers.number, simd.Wide):
                raise TypeError(f"a unit for four cars side by side has arrays of floats alone, got {kind}")
            return types.Array(dtype, kind.ndim, "C", readonly=True, aligned=False)
        return numbers.number if isinstance(kind, types.Float) else kind

    def generate(context, builder, signature, arguments):
        at, dimensions = arguments
        dimensions = builder.gep(dimensions, [ADDRESS_TYPE(1)])

        def rebuilt(kind: Any) -> Any:
            nonlocal at, dimensions
            if isinstance(kind, types.BaseTuple):
                return context.make_tuple(builder, kind, [rebuilt(member) for member in kind])  # type: ignore[attr-defined]
            here = at
            if not isinstance(kind, types.Array):
                at = builder.gep(here, [ADDRESS_TYPE(1)])
                number = builder.load(here, align=8)
                # No function writes to its numbers: the compiler may load one where it is used.
                number.set_metadata("invariant.load", builder.module.add_metadata([]))
                if kind != numbers.number and isinstance(numbers.number, simd.Wide):
                    number = builder.extract_element(number, ADDRESS_TYPE(0))  # of all four, which have it in common
                return number if kind == numbers.number else context.cast(builder, number, types.float64, kind)
            shape = [builder.load(builder.gep(dimensions, [ADDRESS_TYPE(k)])) for k in range(kind.ndim)]
            dimensions = builder.gep(dimensions, [ADDRESS_TYPE(kind.ndim)])
            found, size = _array(context, builder, kind, here, shape)
            at = builder.gep(here, [size])
            return found

        return rebuilt(signature.return_type)

    return filled(numbers.value_type)(numbers, sizes), generate


@_intrinsic
def array(typing_context, first, sizes):
    """The memory of a part, of ``sizes[0]`` numbers from the address ``first`` on."""
    if not isinstance(first, types.CPointer):
        return None
    kind = types.Array(first.dtype, 1, "C", aligned=False)

    def generate(context, builder, signature, arguments):
        return _array(context, builder, kind, arguments[0], [builder.load(arguments[1])])[0]

    return kind(first, sizes), generate


@_intrinsic
def number(typing_context, x, like):
    """A number as wide as another one."""
    if not isinstance(x, types.Number | simd.Wide):
        return None
    return like(x, like), lambda context, builder, signature, given: context.cast(builder, given[0], x, like)


def _array(context: Any, builder: Any, kind: Any, data: Any, shape: Sequence[Any]) -> tuple[Any, Any]:
    """A contiguous array at an address, and how many elements it has."""
    itemsize = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    strides: list[Any] = []
    size: Any = ADDRESS_TYPE(1)
    for length in reversed(shape):
        strides.insert(0, builder.mul(size, ADDRESS_TYPE(itemsize)))
        size = builder.mul(size, length)
    made = context.make_array(kind)(context, builder)
    populate_array(
        made,
        data=builder.bitcast(data, made.data.type),
        shape=shape,
        strides=strides,
        itemsize=ADDRESS_TYPE(itemsize),
        meminfo=None,
    )
    return made._getvalue(), size


@_intrinsic
def address_of(typing_context, array, i):
    """The address of an element of a contiguous array, or of a row of it."""

    def generate(context, builder, signature, arguments):
        found = context.make_array(array)(context, builder, arguments[0])
        stride = builder.extract_value(found.strides, 0)  # in bytes
        return builder.add(builder.ptrtoint(found.data, ADDRESS_TYPE), builder.mul(stride, arguments[1]))

    return types.int64(array, types.int64), generate


def _loaded(context: Any, builder: Any, kind: Any, array: Any, i: Any, k: Any) -> Any:
    """A whole number of a table, without numba's thought of indices below zero."""
    found = context.make_array(kind)(context, builder, array)
    columns = builder.extract_value(found.shape, 1)
    number = builder.load(builder.gep(found.data, [builder.add(builder.mul(i, columns), k)]))
    number.set_metadata("invariant.load", builder.module.add_metadata([]))  # no kernel changes it
    return number


@_intrinsic
def _read_table_cell(typing_context, table, i, k):
    def generate(context, builder, signature, arguments):
        return _loaded(context, builder, signature.args[0], *arguments)

    return types.int64(table, types.int64, types.int64), generate


@_intrinsic
def _read_table_slice(typing_context, array, table, i, k):
    if array.layout != "C":
        raise NumbaTypeError(f"the memory of sites is a contiguous array of float64, got {array}")

    def generate(context, builder, signature, arguments):
        values, ends, i, k = arguments
        first, end = (
            _loaded(context, builder, signature.args[1], ends, i, builder.add(k, ADDRESS_TYPE(n))) for n in (0, 1)
        )
        data = context.make_array(array)(context, builder, values).data
        return _array(context, builder, array, builder.gep(data, [first]), [builder.sub(end, first)])[0]

    return array(array, table, types.int64, types.int64), generate


# For kernels: ``table[i, k]``, and the part of a contiguous array from there to ``table[i, k + 1]``, which no kernel
# can return.
table_cell: Any = _read_table_cell if COMPILED else lambda table, i, k: table[i, k]
table_slice: Any = _read_table_slice if COMPILED else lambda array, table, i, k: array[table[i, k] : table[i, k + 1]]


@kernel
def memory_size(unit):
    """How many floats a unit remembers."""
    return unit.code.sizes[0]


@kernel
def part(unit):
    """A unit as what calls its functions takes it."""
    return Part(address_of(unit.code.addresses, 0), address_of(unit.numbers, 0), address_of(unit.code.sizes, 0))


def caller(returns: Any) -> Any:
    """What calls a function of a part in kernels: ``(part, k, (...))``, whose arrays go by address.

    ``returns`` makes the type of the result from that of a number, which is a vector where the arrays hold vectors.
    """

    @_intrinsic
    def call(typing_context, part, k, rest):
        arrays = [kind for kind in rest if isinstance(kind, types.Array)]
        if any(kind.layout != "C" or kind.dtype not in (types.float64, simd.FOUR) for kind in arrays):
            raise NumbaTypeError(f"a unit takes contiguous arrays of float64, got {arrays}")
        number = arrays[0].dtype
        taken = [types.CPointer(number) if isinstance(kind, types.Array) else number for kind in rest]
        given = [types.CPointer(number), types.CPointer(types.int64), *taken]
        result = returns(number)

        def generate(context, builder, signature, arguments):
            convention = context.call_conv

            pointers = [context.get_value_type(types.CPointer(each)) for each in (types.int64, number, types.int64)]
            given_part = cgutils.unpack_tuple(builder, arguments[0])
            table, *packed = [builder.inttoptr(at, pointer) for at, pointer in zip(given_part, pointers)]
            for kind, wanted, value in zip(rest, taken, cgutils.unpack_tuple(builder, arguments[2])):
                if isinstance(kind, types.Array):
                    packed.append(context.make_array(kind)(context, builder, value).data)
                else:
                    packed.append(context.cast(builder, value, kind, wanted))
            function = convention.get_function_type(result, given)
            returned = cgutils.alloca_once(builder, function.args[0].pointee)
            exception = cgutils.alloca_once(builder, function.args[1].pointee)
            at = builder.inttoptr(builder.load(builder.gep(table, [arguments[1]])), function.as_pointer())
            status = builder.call(at, [returned, exception, *packed])
            with cgutils.if_unlikely(builder, cgutils.is_not_null(builder, status)):
                builder.store(builder.load(exception), convention._get_excinfo_argument(builder.function))
                builder.ret(status)
            return context.get_returned_value(builder, result, builder.load(returned))

        return result(part, types.int64, rest), generate

    return call


def structure(parameters: Any) -> Any:
    """What two parts have in common that share their functions: the classes of their numbers, and shapes of arrays."""
    if isinstance(parameters, tuple):
        return type(parameters), *map(structure, parameters)
    return parameters.shape if isinstance(parameters, np.ndarray) else type(parameters)


def RETURNS_NUMBER(number: Any) -> Any:
    """Result of a function: a number."""
    return number


def RETURNS_TWO_NUMBERS(number: Any) -> Any:
    """Result of a function: two numbers."""
    return types.UniTuple(number, 2)


def RETURNS_NOTHING(number: Any) -> Any:
    """Result of a function that changes what it is given."""
    return types.none


class Function(NamedTuple):
    """A function of a unit."""

    kernel: Any  # whose first arguments are numbers and sizes
    arguments: str  # the further ones: n for a number, p for an address of numbers
    returns: Any  # type of a number -> type of the result

    def types(self, parameters: Any, wide: bool) -> tuple:
        """Types of the arguments for a class of parameters."""
        numbers = Numbers(frozen(parameters), wide)
        kinds = {"n": numbers.number, "p": types.CPointer(numbers.number)}
        return (numbers, types.CPointer(types.int64), *(kinds[each] for each in self.arguments))

    def compiled(self, parameters: Any, wide: bool) -> Any:
        """What the compiler made of it for a class of parameters.

        Raises
        ------
        TypeError
            The function returns something else.
        """
        given = self.types(parameters, wide)
        self.kernel.compile(given)
        found = self.kernel.overloads[given]
        expected = self.returns(given[0].number)
        if found.signature.return_type != expected:
            raise TypeError(f"{self.kernel.__name__} must return {expected}, got {found.signature.return_type}")
        return found


@kernel
def _absent(numbers, sizes):
    raise NotImplementedError("the law has no such function, or none for four cars side by side")


ABSENT = Function(_absent, "", RETURNS_NOTHING)  # in place of one that a part does not have


class Linked(tuple):
    """In place of a tuple of whole numbers and tables of them: what object code makes it of, which holds it itself.

    It has no members, so that nothing of it is packed. A table of addresses is given by its functions, row by row.
    """

    given: Any

    @classmethod
    def of(cls, given: Any) -> "Linked":
        """Of a ``NamedTuple`` whose tables are arrays (n, k) or rows of ``(Function, parameters)``."""
        made = cls()
        made.given = given
        return made


class LinkedType(types.Type):
    """The type of :class:`Linked`; ``made`` is that of what kernels receive."""

    def __init__(self, linked: Linked) -> None:
        self.given = linked.given
        of_each = [types.int64 if isinstance(each, int) else types.Array(types.int64, 2, "C") for each in self.given]
        self.made = types.NamedTuple(of_each, type(self.given))
        cells = [cell for each in self.given if isinstance(each, tuple) for row in each for cell in row]
        self.parts = [kind for function, parameters in cells for kind in function.types(parameters, False)]
        super().__init__(f"Linked({[_common_description(each) for each in self.given]})")

    @property
    def key(self) -> Any:
        """What two equal types have in common: names, and the classes that two of one name may have."""
        return self.name, tuple(self.parts)

    def generate(self, context: Any, builder: Any) -> Any:
        """The code of it; its tables live as long as the function that begins with them."""
        members = [
            ADDRESS_TYPE(each) if isinstance(each, int) else self._table(context, builder, kind, each)
            for each, kind in zip(self.given, self.made)
        ]
        return context.make_tuple(builder, self.made, members)

    def _table(self, context: Any, builder: Any, kind: Any, rows: Any) -> Any:
        columns = max(map(len, rows), default=1)
        if isinstance(rows, np.ndarray):  # a constant, as what is loaded from it must not have been stored before
            numbers = ir.Constant(ir.ArrayType(ADDRESS_TYPE, rows.size), rows.ravel().tolist())
            memory = builder.bitcast(cgutils.global_constant(builder, "table", numbers), ADDRESS_TYPE.as_pointer())
        else:
            memory = cgutils.alloca_once(builder, ADDRESS_TYPE, size=max(len(rows) * columns, 1))
            for i, row in enumerate(rows):
                for k, (function, parameters) in enumerate(row):
                    made = function.compiled(parameters, False)
                    context.active_code_library.add_linking_library(made.library)
                    address = builder.ptrtoint(context.declare_function(builder.module, made.fndesc), ADDRESS_TYPE)
                    builder.store(address, builder.gep(memory, [ADDRESS_TYPE(i * columns + k)]))
        return _array(context, builder, kind, memory, [ADDRESS_TYPE(len(rows)), ADDRESS_TYPE(columns)])[0]


def _common_description(each: Any) -> Any:
    """What two linked tables of one type have in common."""
    if isinstance(each, int):
        return each
    if isinstance(each, np.ndarray):
        return each.tolist()
    return [[function.types(parameters, False) for function, parameters in row] for row in each]


@extending.typeof_impl.register(Linked)
def _linked_type(value: Linked, context: Any) -> LinkedType:
    return LinkedType(value)


_codes: dict[Any, Code] = {}  # of this process


def code(parameters: Any, functions: tuple[Function | None, ...], remembered: int, wide: bool = False) -> Code:
    """The code of a part that remembers so many floats, in this process; what stands for None raises."""
    key = structure(parameters), functions, remembered, wide
    if key not in _codes:
        if any(leaf.table for leaf in packing.leaves(parameters)):
            raise TypeError("its parameters hold tables that plants share, which a unit does not take")
        made = [(function or ABSENT).compiled(parameters, wide) for function in functions]
        addresses = [each.library.get_pointer_to_function(each.fndesc.llvm_func_name) for each in made]
        lengths = [n for leaf in packing.leaves(parameters) for n in np.shape(leaf.value)]
        _codes[key] = Code(np.array(addresses, np.int64), np.array([remembered, *lengths], np.int64))
    return _codes[key]


def bound(parameters: Any, functions: tuple[Function, ...], remembered: int, wide: bool = False) -> Unit:
    """The unit of a part that remembers so many floats, in this process."""
    return Unit(packing.numbers(parameters), code(parameters, functions, remembered, wide))
