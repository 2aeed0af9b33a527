"""What the compiled loop asks of the operating system: a clock that never jumps, and to sleep until a time.

The functions are those of the C library of Linux, which is part of every process. They are called without the GIL.
"""

import sys
from typing import Any

from numba import extending, types

from steer_env.friction.numerics.kernel import COMPILED, kernel

_CLOCK_MONOTONIC, _ABSOLUTE = 1, 1  # TIMER_ABSTIME
_int: Any = types.int32
_intrinsic: Any = extending.intrinsic  # whose first argument no caller gives
_pointer = types.voidptr
_clock_gettime: Any = types.ExternalFunction("clock_gettime", _int(_int, _pointer))
_clock_nanosleep: Any = types.ExternalFunction("clock_nanosleep", _int(_int, _int, _pointer, _pointer))
_SECOND = 1_000_000_000  # [ns]


def check() -> None:
    """Refuse another operating system than Linux, and kernels that are not compiled.

    Raises
    ------
    ValueError
        With the reason.
    """
    if sys.platform != "linux" or not COMPILED:
        reason = "unset NUMBA_DISABLE_JIT" if sys.platform == "linux" else f"this is {sys.platform}"
        raise ValueError(f"the compiled loop calls the C library of Linux: {reason}")


@_intrinsic
def _ordered(typing_context):
    def generate(context, builder, signature, arguments):
        builder.fence("acq_rel")
        return context.get_dummy_value()

    return types.void(), generate


@kernel
def fence():
    """Keep the compiler from moving what is written or read before behind what follows; x86-64 keeps it so itself."""
    if COMPILED:
        _ordered()


@kernel
def clock(memory):
    """Monotonic clock [ns]; ``memory`` (2,) of int64 is for its use."""
    _clock_gettime(_CLOCK_MONOTONIC, memory.ctypes)
    return memory[0] * _SECOND + memory[1]


@kernel
def sleep_until(time, memory):
    """Sleep until the monotonic clock shows a time [ns]; a signal in between does not shorten it."""
    memory[0], memory[1] = time // _SECOND, time % _SECOND
    while _clock_nanosleep(_CLOCK_MONOTONIC, _ABSOLUTE, memory.ctypes, memory.ctypes) != 0:
        memory[0], memory[1] = time // _SECOND, time % _SECOND
