"""Datagrams, as the compiled loop receives and sends them: functions of the C library, called without the GIL."""

import socket
import struct
from typing import Any

from numba import types

from steer_env.friction.numerics.kernel import kernel
from steer_env.live.real_time.system import check

_int: Any = types.int32
_long: Any = types.int64
_pointer = types.voidptr
_recvfrom: Any = types.ExternalFunction("recvfrom", _long(_int, _pointer, _long, _int, _pointer, _pointer))
_sendto: Any = types.ExternalFunction("sendto", _long(_int, _pointer, _long, _int, _pointer, _int))
NO_WAIT = 0x40  # MSG_DONTWAIT of Linux
ADDRESS_SIZE = 16  # of an address of IPv4 [byte]


@kernel
def receive(descriptor, datagram, sender, length, flags):
    """The size of the next datagram, or a negative number where there is none.

    It waits as long as the socket is set to, or not at all with ``NO_WAIT`` as ``flags``.

    ``datagram`` (N,) of int64 receives it, longer ones cut; ``sender`` (2,) of uint64 receives the address that it
    comes from. ``length`` (1,) of int32 is for the use of the system.
    """
    length[0] = ADDRESS_SIZE
    return _recvfrom(descriptor, datagram.ctypes, 8 * datagram.size, flags, sender.ctypes, length.ctypes)


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
    check()
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
