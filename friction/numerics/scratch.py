"""Memory of a kernel for as long as it runs, on the stack: kernels own no arrays."""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.core import cgutils
from numba.np.arrayobj import populate_array

from steer_env.friction.numerics import simd
from steer_env.friction.numerics.kernel import COMPILED

_intrinsic: Any = extending.intrinsic
_FLOATS = types.Array(types.float64, 1, "C")


def _reserved(kind: types.Array, n: int) -> Any:
    """What makes the code of an array of ``n`` undefined elements on the stack."""

    def generate(context, builder, signature, arguments):
        element = context.get_data_type(kind.dtype)
        memory = cgutils.alloca_once(builder, ir.ArrayType(element, n))
        array = context.make_array(kind)(context, builder)
        length, itemsize = (ir.Constant(ir.IntType(64), k) for k in (n, context.get_abi_sizeof(element)))
        populate_array(
            array,
            data=builder.bitcast(memory, array.data.type),
            shape=[length],
            strides=[itemsize],
            itemsize=itemsize,
            meminfo=None,
        )
        return array._getvalue()

    return generate


@_intrinsic(prefer_literal=True)
def _on_stack(typing_context, size):  # numba's form of a function that makes its own code
    if not isinstance(size, types.IntegerLiteral):
        return None
    return _FLOATS(size), _reserved(_FLOATS, size.literal_value)


@_intrinsic(prefer_literal=True)
def _on_stack_like(typing_context, x, size):
    if not (isinstance(x, types.Array) and isinstance(size, types.IntegerLiteral)):
        return None
    kind = x.copy(ndim=1, layout="C")
    return kind(x, size), _reserved(kind, size.literal_value)


@_intrinsic
def fours(typing_context, rows, columns):
    """For kernels: an array (rows, columns) of undefined numbers of four cars, whose sizes may be computed.

    Not within a loop, in which the stack would grow.
    """
    block = types.Array(simd.FOUR, 2, "C", aligned=False)

    def generate(context, builder, signature, arguments):
        memory = builder.alloca(context.get_value_type(simd.FOUR), size=builder.mul(*arguments))
        array = context.make_array(block)(context, builder)
        itemsize = ir.Constant(ir.IntType(64), 8 * simd.FOUR.lanes)
        populate_array(
            array,
            data=memory,
            shape=arguments,
            strides=[builder.mul(arguments[1], itemsize), itemsize],
            itemsize=itemsize,
            meminfo=None,
        )
        return array._getvalue()

    return block(types.intp, types.intp), generate


# For kernels: an array (size,) of undefined floats, ``size`` being a constant. No caller of a kernel may keep it.
floats: Any = _on_stack if COMPILED else np.empty
# As ``floats``, (x, size), of numbers that are as wide as those of the array ``x``.
like: Any = _on_stack_like if COMPILED else lambda x, size: np.empty(size)
