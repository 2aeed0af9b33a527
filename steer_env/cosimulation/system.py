"""What the compiled loop asks of the operating system: the clock and datagrams.

The functions are those of the C library of Linux, which is part of every process. They are called without the GIL.
"""

import socket
import struct
import sys
from typing import Any

from numba import types

from steer_env.friction.numerics.kernel import COMPILED, kernel

_CLOCK_MONOTONIC = 1
_int: Any = types.int32
_long: Any = types.int64
_pointer = types.voidptr
_clock_gettime: Any = types.ExternalFunction("clock_gettime", _int(_int, _pointer))
_recvfrom: Any = types.ExternalFunction("recvfrom", _long(_int, _pointer, _long, _int, _pointer, _pointer))
_sendto: Any = types.ExternalFunction("sendto", _long(_int, _pointer, _long, _int, _pointer, _int))
ADDRESS_SIZE = 16  # of an address of IPv4 [byte]


@kernel
def clock(memory):
    """Monotonic clock [ns]; ``memory`` (2,) of int64 is for its use."""
    _clock_gettime(_CLOCK_MONOTONIC, memory.ctypes)
    return memory[0] * 1_000_000_000 + memory[1]


@kernel
def receive(descriptor, datagram, sender, length):
    """Wait for a datagram, as long as the socket is set to; its size, or a negative number where there is none.

    ``datagram`` (N,) of int64 receives it, longer ones cut; ``sender`` (2,) of uint64 receives the address that it
    comes from. ``length`` (1,) of int32 is for the use of the system.
    """
    length[0] = ADDRESS_SIZE
    return _recvfrom(descriptor, datagram.ctypes, 8 * datagram.size, 0, sender.ctypes, length.ctypes)


@kernel
def send(descriptor, datagram, receiver):
    """Send a datagram (N,) of int64 to an address; whether the system took it."""
    size = 8 * datagram.size
    return _sendto(descriptor, datagram.ctypes, size, 0, receiver.ctypes, ADDRESS_SIZE) == size


def bound_socket(address: str, port: int, wait: float) -> socket.socket:
    """A socket for datagrams at an address of this machine, whose :func:`receive` waits for so long [s].

    Raises
    ------
    ValueError
        Another operating system, kernels that are not compiled, or an address or port that cannot be used.
    """
    if sys.platform != "linux" or not COMPILED:
        reason = "unset NUMBA_DISABLE_JIT" if sys.platform == "linux" else f"this is {sys.platform}"
        raise ValueError(f"the server is a compiled loop that calls the C library of Linux: {reason}")
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        made.bind((address, port))
    except (OSError, OverflowError) as error:
        made.close()
        told = error.strerror if isinstance(error, OSError) else "must be at most 65535"
        raise ValueError(
            f"cannot receive at address {address}, port {port}: {told}; give the address of an interface of this "
            "machine, and a port that no other program uses (0 takes a free one)"
        ) from None
    seconds = int(wait)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", seconds, int(1e6 * (wait - seconds))))
    return made
