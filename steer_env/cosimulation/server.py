"""A server of a part over UDP: a compiled loop in a thread that does not hold the GIL."""

import threading
from types import TracebackType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.cosimulation.model import model_of
from steer_env.cosimulation.packets import layout_of
from steer_env.cosimulation.session import (
    COUNTS,
    NOTHING,
    REFUSAL,
    UNSENT,
    WELCOME,
    end_where_silent,
    link_of,
    respond,
)
from steer_env.cosimulation.system import bound_socket, clock, receive, send
from steer_env.fmu.part import Part
from steer_env.friction.numerics.kernel import bind, kernel

LOOPBACK = "127.0.0.1"
SILENCE = 10.0  # of a client, after which its session ends [s]; assumed
_WAKE = 0.1  # time after which the loop looks whether it is to end [s]


class Port(NamedTuple):
    """What the loop has beside model and link."""

    descriptor: int  # of the socket
    sender: NDArray[np.uint64]  # (2,) address of the last datagram
    client: NDArray[np.uint64]  # (2,) address of the session's client
    length: NDArray[np.int32]  # (1,) of an address
    time: NDArray[np.int64]  # (2,) of the clock
    stop: NDArray[np.int64]  # (1,) not 0 where the loop is to end
    silence: int  # [ns]


@kernel
def lockstep(model, link, port):
    """Answer requests until ``port.stop`` is set."""
    while port.stop[0] == 0:
        size = receive(port.descriptor, link.received, port.sender, port.length)
        now = clock(port.time)
        end_where_silent(link, now, port.silence)
        if size < 0:
            continue
        known = port.sender[0] == port.client[0]  # family, port and number; the rest of an address is not used
        action = respond(model, link, size, known, now)
        if action == WELCOME:
            port.client[0] = port.sender[0]
        if action != NOTHING and not send(
            port.descriptor, link.refused if action == REFUSAL else link.sent, port.sender
        ):
            link.counts[UNSENT] += 1


class Server:
    """A part behind a port, for one client at a time.

    Parameters
    ----------
    part : Part
        From :func:`steer_env.fmu.parts.make_part`.
    address : str
        Of an interface of this machine; by default only programs on this machine reach it.
    port : int
        Port, or 0 for a free one.
    silence : float
        Time without a packet of the client after which its session ends [s].

    Raises
    ------
    ValueError
        An address or port that cannot be used, or another system than Linux; the message says what to do.

    Notes
    -----
    Used in a ``with`` block, within which it serves. The loop is compiled before the block begins.
    """

    def __init__(self, part: Part, address: str = LOOPBACK, port: int = 0, silence: float = SILENCE) -> None:
        self.layout = layout_of(part)
        self._socket = bound_socket(address, port, _WAKE)
        self.address: tuple[str, int] = self._socket.getsockname()
        self._link = link_of(self.layout)
        self._port = Port(
            descriptor=self._socket.fileno(),
            sender=np.zeros(2, np.uint64),
            client=np.zeros(2, np.uint64),
            length=np.zeros(1, np.int32),
            time=np.zeros(2, np.int64),
            stop=np.zeros(1, np.int64),
            silence=int(1e9 * silence),
        )
        arguments = model_of(part), self._link, self._port
        loop = bind(lockstep, *arguments)
        self._thread = threading.Thread(target=loop, args=arguments, daemon=True)

    def __enter__(self) -> "Server":
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._port.stop[0] = 1
        self._thread.join()
        self._socket.close()

    def wait(self) -> None:
        """Wait until the loop ends, which it does only if it fails, or until a signal raises an exception."""
        while self._thread.is_alive():
            self._thread.join(_WAKE)

    def counts(self) -> dict[str, int]:
        """What happened so far, by the names of :data:`steer_env.cosimulation.session.COUNTS`."""
        return dict(zip(COUNTS, self._link.counts.tolist()))
