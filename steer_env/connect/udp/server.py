"""A server of a subsystem over UDP, in lockstep or free running: a compiled loop in a thread without the GIL."""

import socket
import struct
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from steer_env.connect.udp import session
from steer_env.connect.udp.packets import MODES, layout_of
from steer_env.connect.udp.session import (
    NOTHING,
    REFUSAL,
    SILENCE,
    UNSENT_COUNT,
    WELCOME,
    Link,
    end_where_silent,
    make_session_memory,
    report,
    respond,
)
from steer_env.friction.numerics.check import one_of
from steer_env.friction.numerics.kernel import kernel
from steer_env.live.real_time import loop as real_time
from steer_env.live.real_time.loop import NEVER, make_loop_memory, register
from steer_env.live.real_time.model import make_model
from steer_env.live.real_time.safety import TRIPS, Limits
from steer_env.live.real_time.system import WAKE, Worker, check, clock
from steer_env.vehicle.subsystems import Subsystem
from steer_env.vehicle.subsystems.machine_code import tunable

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


def bind(made: socket.socket, address: str, port: int) -> None:
    """Let a socket receive at an address of this machine.

    Raises
    ------
    ValueError
        An address or port that cannot be used; the socket is then closed.
    """
    try:
        made.bind((address, port))
    except (OSError, OverflowError) as error:
        made.close()
        told = error.strerror if isinstance(error, OSError) else "must be at most 65535"
        raise ValueError(
            f"cannot receive at address {address}, port {port}: {told}; give the address of an interface of this "
            "machine, and a port that no other program uses (0 takes a free one)"
        ) from None


LOOPBACK = "127.0.0.1"
MOST_PER_SAMPLE = 64  # datagrams that free running takes in a sample; the rest waits


class Port(NamedTuple):
    """The socket and what belongs to it."""

    descriptor: int  # of the socket
    sender: NDArray[np.uint64]  # (2,) address of the last datagram
    client: NDArray[np.uint64]  # (2,) address of the session's client
    length: NDArray[np.int32]  # (1,) of an address
    time: NDArray[np.int64]  # (2,) of the clock
    stop: NDArray[np.int64]  # (1,) not 0 where the loop is to end


class Udp(NamedTuple):
    """A client as the device of a loop in real time."""

    link: Link
    port: Port


@kernel
def _handle(model, link, port, size, now):
    """Answer a datagram of ``size`` bytes."""
    known = port.sender[0] == port.client[0]  # family, port and number; the rest of an address is not used
    action = respond(model, link, size, known, now)
    if action == WELCOME:
        port.client[0] = port.sender[0]
    if action != NOTHING and not send(port.descriptor, link.refused if action == REFUSAL else link.sent, port.sender):
        link.counts[UNSENT_COUNT] += 1


@kernel
def lockstep(model, link, port):
    """Answer requests until ``port.stop`` is set."""
    while port.stop[0] == 0:
        size = receive(port.descriptor, link.received, port.sender, port.length, 0)
        now = clock(port.time)
        end_where_silent(link, now)
        if size >= 0:
            _handle(model, link, port, size, now)


@kernel
def _read(device, model, now):
    link, port = device.link, device.port
    for _ in range(MOST_PER_SAMPLE):
        size = receive(port.descriptor, link.received, port.sender, port.length, NO_WAIT)
        if size < 0:
            break
        _handle(model, link, port, size, now)
    return link.state[0].asked if end_where_silent(link, now) else NEVER


@kernel
def _write(device, model, s, torque, now):
    link, port = device.link, device.port
    if report(model, link, s, torque, now) and not send(port.descriptor, link.sent, port.client):
        link.counts[UNSENT_COUNT] += 1
        return False
    return True


register(Udp, _read, _write)


class Server(Worker):
    """A subsystem behind a port, for one client at a time; it serves within a ``with`` block.

    It compiles before it takes its port: until then a client is told that nothing receives there.

    Parameters
    ----------
    subsystem : Subsystem
        From :func:`steer_env.vehicle.subsystems.make`.
    address : str
        Of an interface of this machine; by default only programs on this machine reach it.
    port : int
        Port, or 0 for a free one.
    silence : float
        Time without a packet of the client after which its session ends [s].
    mode : {"lockstep", "free-running"}
        Whether each request asks for a step, or samples of 1 ms follow the clock.
    limits : Limits
        Of the torque, and times of the watchdog, in free running.
    priority : int
        As of :class:`steer_env.live.real_time.system.Worker`.

    Raises
    ------
    ValueError
        An address or port that cannot be used, another mode, or another system than Linux; the message says what to do.
    """

    def __init__(
        self,
        subsystem: Subsystem,
        address: str = LOOPBACK,
        port: int = 0,
        silence: float = SILENCE,
        *,
        mode: str = "lockstep",
        limits: Limits | None = None,
        priority: int = 0,
    ) -> None:
        one_of("mode", mode, MODES)
        self.layout, self.mode = layout_of(subsystem), mode
        check()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", 0, int(1e6 * WAKE)))
        self.loop, made = make_loop_memory(limits or Limits()), tunable(subsystem)
        self._link = make_session_memory(self.layout, mode, made.numbers[0], silence)
        model = make_model(subsystem._replace(parameters=made))
        of_socket = Port(
            descriptor=self._socket.fileno(),
            sender=np.zeros(2, np.uint64),
            client=np.zeros(2, np.uint64),
            length=np.zeros(1, np.int32),
            time=np.zeros(2, np.int64),
            stop=self.loop.stop,
        )
        if mode == "lockstep":
            super().__init__(lockstep, (model, self._link, of_socket), self.loop.stop, priority)
        else:
            device = Udp(self._link, of_socket)
            super().__init__(real_time.run, (model, self.loop, device), self.loop.stop, priority)
        bind(self._socket, address, port)
        self.address: tuple[str, int] = self._socket.getsockname()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            super().__exit__(kind, error, trace)
        finally:
            self._socket.close()

    def counts(self) -> dict[str, int]:
        """What happened so far, by name."""
        found = dict(zip(session.COUNTS, self._link.counts.tolist()))
        return found if self.mode == "lockstep" else {**found, **real_time.counts(self.loop)}


MEANINGS = {**session.COUNTS, **real_time.COUNTS, **TRIPS}  # of the counts of a server
