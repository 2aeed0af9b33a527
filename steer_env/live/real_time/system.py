"""What the compiled loop has of the operating system: a clock that never jumps, sleep until a time, and a thread.

The functions are those of the C library of Linux, which is part of every process. They are called without the GIL.
"""

import ctypes
import os
import sys
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Any, TypeVar

from numba import extending, types
from numpy.typing import NDArray

from steer_env.friction.numerics.kernel import COMPILED, bind, kernel

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
def _order(typing_context):
    def generate(context, builder, signature, arguments):
        builder.fence("acq_rel")
        return context.get_dummy_value()

    return types.void(), generate


@kernel
def fence():
    """Keep the compiler from moving what is written or read before behind what follows; x86-64 keeps it so itself."""
    if COMPILED:
        _order()


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


_SET_TIMER_SLACK = 29  # PR_SET_TIMERSLACK
WAKE = 0.1  # time after which a thread that waits looks whether it is to end [s]


W = TypeVar("W", bound="Worker")


class Worker:
    """Runs a kernel within a ``with`` block, before which it is compiled.

    Parameters
    ----------
    loop : kernel
        Runs until ``stop`` is set.
    arguments : tuple
        Of the kernel.
    stop : (1,) array of int64
        Is set to 1 at the end of the block.
    priority : int
        Of the scheduler SCHED_FIFO, 1 to 99; 0 leaves the thread as every other.

    Raises
    ------
    ValueError
        Another system than Linux, or kernels that are not compiled.
    PermissionError
        The priority is not allowed, and what to do; raised where the block begins.
    """

    def __init__(self, loop: Callable, arguments: tuple, stop: NDArray[Any], priority: int = 0) -> None:
        check()
        self._loop, self._arguments = bind(loop, *arguments), arguments
        self._stop, self._priority = stop, priority
        self._error: BaseException | None = None
        self._begun = threading.Event()
        self._thread = threading.Thread(target=self._work, daemon=True)

    def _work(self) -> None:
        try:
            # Otherwise Linux may wake the thread 50 us late, to serve several at once.
            ctypes.CDLL(None).prctl(_SET_TIMER_SLACK, ctypes.c_ulong(1), 0, 0, 0)
            if self._priority:
                self._rise()
            self._begun.set()
            self._loop(*self._arguments)
        except BaseException as error:
            self._error = error
        finally:
            self._begun.set()

    def _rise(self) -> None:
        """Take the priority, for this thread alone."""
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(self._priority))
        except PermissionError:
            raise PermissionError(
                f"the priority {self._priority} of SCHED_FIFO is not allowed: start it as root, or give the user the "
                "right 'rtprio' in /etc/security/limits.conf"
            ) from None

    def __enter__(self: W) -> W:
        self._thread.start()
        try:
            self._begun.wait()
            if self._error:
                raise self._error
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()
        if self._error and kind is None:
            raise self._error

    def _end(self) -> None:
        self._stop[0] = 1
        self._thread.join()

    def runs(self) -> bool:
        """Whether the loop runs: not before the block, and no longer where it has failed or ended by itself."""
        return self._thread.is_alive()

    def wait(self) -> None:
        """Wait until the loop has ended by itself, or until a signal raises an exception."""
        while self._thread.is_alive():
            self._thread.join(WAKE)
