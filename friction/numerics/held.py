"""Arguments that kernels find in memory, and kernels that kernels call by address.

A call from Python hands a kernel the arrays of a batch one by one, which takes longer than a car takes through a
millisecond. A :class:`Holder` writes them into memory once, as compiled code holds them; a kernel takes the address and
reads them by :func:`held`. So kernels can call one another by address as well (:func:`call`), each with arguments that
the other does not know, and the one is not compiled for the types of the other.

What is held belongs to one process, and is held anew where an array is replaced.
"""

import hashlib
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.core import cgutils
from numba.core.registry import cpu_target
from numba.extending import NativeValue, models, register_model, unbox

from steer_env.friction.numerics.kernel import COMPILED, bind, kernel, plain

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
        if COMPILED:
            self.kind, context = numba.typeof(example), cpu_target.target_context
            self._size = context.get_abi_sizeof(context.get_value_type(self.kind)) // 8 + 1
            self._write = bind(_hold, np.zeros(0, np.int64), example)

    def __call__(self, *arguments: Any) -> Any:
        """Arguments as :func:`held` gives them to a kernel; in plain Python they are handed over as they are."""
        if not COMPILED:
            return arguments
        memory = np.zeros(self._size, np.int64)
        self._write(memory, arguments)
        found = Held(memory.ctypes.data)
        found.kind, found.kept = self.kind, (memory, arguments)
        return found


def called(function: Any, arguments: Any) -> Called:
    """A kernel and what a :class:`Holder` made of its arguments, for kernels that do not know it."""
    if not COMPILED:
        return Called(function, arguments)
    given = (numba.typeof(arguments), types.int64, types.int64, types.int64)
    function.compile(given)
    found = function.overloads[given]
    return Called(found.library.get_pointer_to_function(found.fndesc.llvm_func_name), int(arguments))


def _members(builder: Any, at: Any) -> Any:
    """Addresses of the members of what stands at an address; none of a number."""
    kind, first = at.type.pointee, ir.Constant(ir.IntType(32), 0)
    if isinstance(kind, ir.Aggregate):
        return [builder.gep(at, [first, ir.Constant(ir.IntType(32), k)]) for k in range(len(kind))]
    return None


def _store(builder: Any, value: Any, at: Any) -> None:
    members = _members(builder, at)
    if members is None:
        builder.store(value, at)
    for k, member in enumerate(members or ()):
        _store(builder, builder.extract_value(value, k), member)


def _load(builder: Any, at: Any) -> Any:
    members = _members(builder, at)
    if members is None:
        number = builder.load(at)
        number.set_metadata("invariant.load", builder.module.add_metadata([]))  # no kernel writes what is held
        return number
    value = ir.Constant(at.type.pointee, ir.Undefined)
    for k, member in enumerate(members):
        value = builder.insert_value(value, _load(builder, member), k)
    return value


@_intrinsic
def _write(typing_context, memory, arguments):
    def generate(context, builder, signature, given):
        data = context.make_array(signature.args[0])(context, builder, given[0]).data
        _store(builder, given[1], builder.bitcast(data, given[1].type.as_pointer()))
        return context.get_dummy_value()

    return types.none(memory, arguments), generate


@kernel
def _hold(memory, arguments):
    _write(memory, arguments)


@_intrinsic
def _read(typing_context, arguments):
    def generate(context, builder, signature, given):
        kind = context.get_value_type(signature.return_type)
        return _load(builder, builder.bitcast(given[0], kind.as_pointer()))

    return arguments.kind(arguments), generate


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
