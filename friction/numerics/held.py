"""Arguments that kernels find in memory, and kernels that kernels call by address.

A call from Python hands a kernel the arrays of a batch one by one, which takes longer than a car takes through a
millisecond. A :class:`Holder` writes addresses and shapes into memory once; a kernel takes their place, and
:func:`held` makes the arguments of them. So kernels can call one another by address as well (:func:`call`), each with
arguments that the other does not know, and the one is not compiled for the types of the other.

What is held belongs to one process, and is held anew where an array is replaced.
"""

import hashlib
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.core import cgutils
from numba.extending import NativeValue, models, register_model, unbox
from numba.np.arrayobj import populate_array

from steer_env.friction.numerics.kernel import COMPILED, plain

_intrinsic: Any = extending.intrinsic  # whose first argument no caller gives
_WORD = ir.IntType(64)


class Called(NamedTuple):
    """A kernel as others call it: ``kernel(arguments, what, low, high)``, which returns nothing."""

    function: Any  # its address; 0 for none
    arguments: Any  # that it finds in memory


NOTHING = Called(0, 0)


class Held(int):
    """The address of what is held, which lives as long as this."""

    kind: Any  # numba type of the arguments
    kept: Any

    def __reduce__(self) -> Any:
        raise TypeError("an address belongs to its process: hold the arguments anew in another one")


class HeldType(types.CPointer):
    """The address of arguments: a type of compiled code for each of theirs, and the same to a machine."""

    def __init__(self, kind: Any) -> None:
        self.kind = kind
        self.parts = (kind,)  # which the cache of the kernels looks at
        super().__init__(types.uint8)
        self.name = f"Held({hashlib.sha256(repr(kind).encode()).hexdigest()})"  # short, as it becomes part of names

    @property
    def key(self) -> Any:
        """What two equal types have in common."""
        return self.kind


register_model(HeldType)(models.PointerModel)


@extending.typeof_impl.register(Held)
def _held_type(value: Held, context: Any) -> HeldType:
    return HeldType(value.kind)


@unbox(HeldType)
def _from_python(kind: Any, number: Any, c: Any) -> NativeValue:
    address = c.pyapi.long_as_longlong(number)
    return NativeValue(c.builder.inttoptr(address, c.context.get_value_type(kind)), is_error=c.pyapi.c_api_error())


class Holder:
    """Holds arguments of the types of an example; others are undefined behaviour, as with ``bind``."""

    def __init__(self, *example: Any) -> None:
        self._kind = numba.typeof(example) if COMPILED else None

    def __call__(self, *arguments: Any) -> Any:
        """Arguments as :func:`held` gives them to a kernel; in plain Python they are handed over as they are."""
        if not COMPILED:
            return arguments
        memory = np.array([*_words(arguments)], np.int64)
        found = Held(memory.ctypes.data)
        found.kind, found.kept = self._kind, (memory, arguments)
        return found


def _words(value: Any) -> Iterator[int]:
    """Words of 64 bits that :func:`held` makes a value of: address, shape and strides of an array, or a number."""
    if isinstance(value, tuple):
        for member in value:
            yield from _words(member)
    elif isinstance(value, np.ndarray):
        yield from (value.ctypes.data, *value.shape, *value.strides)
    elif isinstance(value, float):
        yield int(np.float64(value).view(np.int64))
    elif value is not None:
        yield int(value)


def called(function: Any, arguments: Any) -> Called:
    """A kernel and what a :class:`Holder` made of its arguments, for kernels that do not know it."""
    if not COMPILED:
        return Called(function, arguments)
    return Called(_address(function, arguments.kind), int(arguments))


@cache
def _address(function: Any, kind: Any) -> int:
    given = (HeldType(kind), types.int64, types.int64, types.int64)
    function.compile(given)
    found = function.overloads[given]
    address: int = found.library.get_pointer_to_function(found.fndesc.llvm_func_name)
    return address


@_intrinsic
def _read(typing_context, arguments):
    def generate(context, builder, signature, given):
        at = builder.bitcast(given[0], _WORD.as_pointer())

        def word() -> Any:
            nonlocal at
            found = builder.load(at)
            found.set_metadata("invariant.load", builder.module.add_metadata([]))  # no kernel writes what is held
            at = builder.gep(at, [_WORD(1)])
            return found

        def rebuilt(kind: Any) -> Any:
            if isinstance(kind, types.BaseTuple):
                return context.make_tuple(builder, kind, [rebuilt(member) for member in kind])  # type: ignore[attr-defined]
            if isinstance(kind, types.Array):
                return _array(context, builder, kind, word)
            if kind == types.none:
                return context.get_dummy_value()
            if kind == types.float64:
                return builder.bitcast(word(), context.get_value_type(kind))
            return context.cast(builder, word(), types.int64, kind)

        return rebuilt(signature.return_type)

    return arguments.kind(arguments), generate


def _array(context: Any, builder: Any, kind: Any, word: Callable[[], Any]) -> Any:
    """An array by its words."""
    made = context.make_array(kind)(context, builder)
    populate_array(
        made,
        data=builder.inttoptr(word(), made.data.type),
        shape=[word() for _ in range(kind.ndim)],
        strides=[word() for _ in range(kind.ndim)],
        itemsize=_WORD(context.get_abi_sizeof(context.get_data_type(kind.dtype))),
        meminfo=None,
    )
    return made._getvalue()


@_intrinsic
def _call(typing_context, function, arguments, what, low, high):
    kinds = [types.CPointer(types.uint8), types.int64, types.int64, types.int64]

    def generate(context, builder, signature, given):
        convention = context.call_conv
        kind = convention.get_function_type(types.none, kinds)
        returned = cgutils.alloca_once(builder, kind.args[0].pointee)
        exception = cgutils.alloca_once(builder, kind.args[1].pointee)
        at = builder.inttoptr(given[0], kind.as_pointer())
        address = builder.inttoptr(given[1], context.get_value_type(kinds[0]))
        status = builder.call(at, [returned, exception, address, *given[2:]])
        with cgutils.if_unlikely(builder, cgutils.is_not_null(builder, status)):
            builder.store(builder.load(exception), convention._get_excinfo_argument(builder.function))
            builder.ret(status)
        return context.get_dummy_value()

    return types.none(*[types.int64] * 5), generate


# For kernels: the arguments at an address, and a call of a kernel of :func:`called`.
held: Any = _read if COMPILED else lambda arguments: arguments
call: Any = _call if COMPILED else lambda function, *arguments: plain(function)(*arguments)
