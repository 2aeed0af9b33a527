"""Machine code of a subsystem: functions without Python, the first of them by its address in this process.

    int32_t steer_advance(int32_t *finite, void **unused, const double *numbers, const double *tables, double *state,
                          const double *given, double *inputs, double *outputs, int64_t samples)
    int32_t steer_begin(int64_t *samples, void **unused, const double *numbers, const double *tables, double *state)

The kernels are those that Python runs, compiled by the same compiler for a function that takes addresses alone. The
shapes of all arrays are constants in it. ``finite`` receives 0 where a state has ceased to be finite. The result of
the function itself is 0; numba's calling convention gives other values to exceptions, of which the kernels have none.
"""

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.core import cgutils
from numpy.typing import NDArray

from steer_env.friction.numerics.kernel import COMPILED, kernel
from steer_env.friction.numerics.packing import Floats, at_addresses, numbers, of_row
from steer_env.vehicle.plant import linked
from steer_env.vehicle.subsystems.kinds import CLASSES, advance, begin, bound, register
from steer_env.vehicle.subsystems.subsystem import Subsystem

_intrinsic: Any = extending.intrinsic  # whose first argument no caller gives


@kernel
def entry(numbers, tables, state, given, inputs, outputs, samples):
    """Advance a subsystem by so many samples; every array is given by its address. Whether its state is finite.

    The numbers and tables are those of :func:`steer_env.friction.numerics.packing.pack`. The types of
    the addresses, from :func:`signature`, hold the subsystem's structure and the shapes of the arrays.
    """
    return advance(
        at_addresses(numbers, tables),
        at_addresses(state, state),
        at_addresses(given, given),
        at_addresses(inputs, inputs),
        at_addresses(outputs, outputs),
        samples,
    )


@kernel
def first(numbers, tables, state):
    """Write the state from which a subsystem settles, and in how many samples; first arguments of :func:`entry`."""
    return begin(at_addresses(numbers, tables), at_addresses(state, state))


def signature(subsystem: Subsystem) -> tuple:
    """Types of the arguments with which :func:`entry` is the function of a subsystem; :func:`first` takes the first."""
    shapes = subsystem.start.size, subsystem.given_size, (1, subsystem.inputs), (1, len(subsystem.outputs))
    own, arrays = (
        Floats(CLASSES[subsystem.name](linked(subsystem.parameters))),
        (Floats(np.zeros(shape)) for shape in shapes),
    )
    return (own, types.CPointer(types.float64), *arrays, types.int64)


def address(subsystem: Subsystem) -> int:
    """The address of :func:`entry`, compiled for a subsystem, as :func:`call` takes it; it stays valid.

    The code is kept on disk as that of every kernel.

    Raises
    ------
    ValueError
        Where kernels are not compiled (``NUMBA_DISABLE_JIT=1``).
    """
    require_compiled("an address")
    kinds = signature(subsystem)
    entry.compile(kinds)
    result = entry.overloads[kinds]
    return int(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))


@_intrinsic
def call(typing_context, code, numbers, tables, state, given, inputs, outputs, samples):
    """Call the function at an :func:`address`, with the addresses of its arrays; whether the state is finite."""
    word = ir.IntType(64)

    def generate(context, builder, signature, given):
        pointer, result = ir.DoubleType().as_pointer(), ir.IntType(32)
        unused = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(result, [result.as_pointer(), unused.as_pointer(), *[pointer] * 6, word])
        finite, exception = cgutils.alloca_once_value(builder, result(0)), cgutils.alloca_once(builder, unused)
        arrays = [builder.inttoptr(each, pointer) for each in given[1:7]]
        function = builder.inttoptr(given[0], kind.as_pointer())
        builder.call(function, [finite, exception, *arrays, given[7]])
        return builder.icmp_unsigned("!=", builder.load(finite), result(0))

    return types.boolean(*[types.int64] * 8), generate


class Tunable(NamedTuple):
    """A subsystem whose numbers may change while it runs."""

    kind: Any  # Car, Steering or Chassis, bound, whose numbers are those at the beginning
    numbers: NDArray[np.float64]  # (1, N) as :func:`steer_env.friction.numerics.packing.pack` orders them


@kernel
def _tunable(subsystem, state, given, inputs, outputs, samples):
    return advance(of_row(subsystem.kind, subsystem.numbers, 0), state, given, inputs, outputs, samples)


register(Tunable, _tunable)


def tunable(subsystem: Subsystem) -> Tunable:
    """A subsystem as :func:`advance` takes it, whose numbers may change."""
    kind = CLASSES[subsystem.name](subsystem.parameters)
    return Tunable(bound(kind), numbers(kind)[None])


def require_compiled(what: str) -> None:
    """ValueError where kernels are not compiled, of which ``what`` is made."""
    if not COMPILED:
        raise ValueError(f"{what} is made of compiled kernels; unset NUMBA_DISABLE_JIT")
