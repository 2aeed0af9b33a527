"""Memory of a kernel for as long as it runs, on the stack: kernels own no arrays, and firmware has no heap."""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.core import cgutils
from numba.np.arrayobj import populate_array
from numpy.typing import NDArray

from steer_env.friction.numerics.kernel import COMPILED

_intrinsic: Any = extending.intrinsic(prefer_literal=True)
_FLOATS = types.Array(types.float64, 1, "C")


def floats(size: int) -> NDArray[np.float64]:
    """An array (size,) of undefined floats; in compiled code ``size`` is a constant, and no caller may keep it."""
    return np.empty(size)


@_intrinsic
def _on_stack(typing_context, size):  # numba's form of a function that makes its own code
    if not isinstance(size, types.IntegerLiteral):
        return None
    n = size.literal_value

    def generate(context, builder, signature, arguments):
        memory = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), n))
        array = context.make_array(_FLOATS)(context, builder)
        length, itemsize = (ir.Constant(ir.IntType(64), k) for k in (n, 8))
        populate_array(
            array,
            data=builder.bitcast(memory, array.data.type),
            shape=[length],
            strides=[itemsize],
            itemsize=itemsize,
            meminfo=None,
        )
        return array._getvalue()

    return _FLOATS(size), generate


if COMPILED:

    @extending.overload(floats, prefer_literal=True, strict=False)
    def _floats(size):
        return lambda size: _on_stack(size)
