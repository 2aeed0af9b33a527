"""A client of a server of a subsystem: it asks for steps, and asks again where an answer is lost."""

import math
import secrets
import socket
import time
from types import TracebackType
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.connect.udp.packets import (
    CLOSE,
    HEADER_SIZE,
    LARGEST,
    OPEN,
    REASONS,
    REFUSED,
    STEP,
    STEPPED,
    TUNE,
    VERSION,
    Layout,
    packed,
    unpacked,
)
from steer_env.friction.numerics.check import one_of
from steer_env.live.real_time.safety import PHASES

_CYCLE = 2**32
C = TypeVar("C", bound="Client")


class Client:
    """A session with a server in lockstep; used in a ``with`` block, which closes the session.

    Parameters
    ----------
    layout : Layout
        Of the subsystem that is served.
    address : tuple of str and int
        Where the server receives.
    patience : float
        Time after which a request is sent again [s].
    tries : int
        How often, before it is given up.

    Raises
    ------
    ValueError
        The server refuses, with the reason; or its answer is of another subsystem or version.
    TimeoutError
        No answer, or nothing receives there, as where a server still compiles.
    """

    period = 0  # asked for between answers, in free running [ms]

    def __init__(self, layout: Layout, address: tuple[str, int], patience: float = 0.2, tries: int = 25) -> None:
        self.layout, self.address, self.tries = layout, address, tries
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.patience = patience
        self._pause(patience)
        self._socket.connect(address)
        self.session = secrets.randbits(64)
        self.sequence = 0
        self.repeats = 0  # requests that were sent again
        self._unreached = False  # whether the last request found nothing at the port
        self.time = 0.0  # of the simulation, at the last answer [s]
        try:
            self.outputs = self.exchange(OPEN, samples=self.period)  # at the begin, in the order of the layout
        except BaseException:
            self._socket.close()
            raise

    def __enter__(self: C) -> C:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self.exchange(CLOSE)
        finally:
            self._socket.close()

    def step(self, inputs: ArrayLike, samples: int = 1) -> NDArray[np.float64]:
        """Outputs (C,) at the end of a step of so many milliseconds with inputs (I,), both as the layout lists them."""
        if np.shape(inputs) != (len(self.layout.inputs),):
            names = ", ".join(signal.name for signal in self.layout.inputs)
            raise ValueError(f"a step takes {len(self.layout.inputs)} inputs ({names}), got {np.shape(inputs)}")
        return self.exchange(STEP, inputs, samples)

    def tune(self, name: str, value: float) -> None:
        """Give a parameter of the layout, by its name in the FMU, a value from the next step on, for this session.

        Raises
        ------
        ValueError
            The server refuses, with parameter, value and bounds; or there is no such parameter.
        """
        names = [parameter.name for parameter in self.layout.parameters]
        one_of("parameter", name, names)
        inputs = np.zeros(len(self.layout.inputs))
        inputs[0] = value
        self.exchange(TUNE, inputs, names.index(name))

    def exchange(self, kind: int, inputs: ArrayLike | None = None, samples: int = 0) -> NDArray[np.float64]:
        """Send a request of a kind until it is answered; the outputs (C,) of the answer."""
        packet = self.request(kind, inputs, samples)
        for _ in range(self.tries):
            self._send(packet)
            answer = self._awaited(packet)
            if answer is not None:
                self.sequence = (self.sequence + 1) % _CYCLE
                return answer
            self.repeats += 1
        host, port = self.address
        if self._unreached:
            raise TimeoutError(
                f"nothing receives at {host}, port {port}: start 'steer-env serve --port {port}' and wait for its line "
                "'ready', which comes once it has compiled"
            )
        raise TimeoutError(f"no answer from {host}, port {port}, to {self.tries} requests: is 'steer-env serve' there?")

    def request(self, kind: int, inputs: ArrayLike | None = None, samples: int = 0) -> bytes:
        """The bytes of the next request."""
        return packed(
            np.zeros(len(self.layout.inputs)) if inputs is None else inputs,
            kind=kind,
            layout=self.layout.fingerprint,
            session=self.session,
            sequence=self.sequence,
            samples=samples,
            sent=time.monotonic_ns(),
        )

    def _pause(self, time: float) -> None:
        """How long to wait for a packet from now on [s]."""
        self._socket.settimeout(time)

    def _send(self, packet: bytes) -> None:
        self._socket.send(packet)

    def _receive(self) -> bytes:
        return self._socket.recv(LARGEST)

    def _awaited(self, request: bytes) -> NDArray[np.float64] | None:
        """Outputs of the answer to a request; None after a time without it."""
        while True:
            try:
                packet = self._receive()
            except TimeoutError:
                return None
            except ConnectionRefusedError:  # nothing receives at the port, yet
                self._unreached = True
                time.sleep(self.patience)
                return None
            self._unreached = False
            header = unpacked(packet)
            if header is None or (header["session"], header["sequence"]) != (self.session, self.sequence):
                continue  # another's, or the answer to a request that was repeated
            if header["kind"] == REFUSED:
                raise ValueError(f"the server refused the request: {self._reason(header, request)}")
            outputs = self._values(header, packet)
            self.time = header["time"]
            return outputs

    def _values(self, header: dict[str, int], packet: bytes) -> NDArray[np.float64]:
        """Outputs (C,) of an answer, which has to be of this subsystem."""
        found = header["version"], header["layout"], len(packet)
        expected = VERSION, self.layout.fingerprint, self.layout.answer_size
        if found != expected:
            has, needs = (f"version {v}, layout 0x{of:08x} and {size} bytes" for v, of, size in (found, expected))
            raise ValueError(
                f"the answer of {self.address[0]}, port {self.address[1]}, has {has}, but this client expects {needs}: "
                "both ends need the same subsystem and the same version"
            )
        return np.frombuffer(packet, "<f8", offset=HEADER_SIZE).copy()

    def _reason(self, header: dict[str, int], request: bytes) -> str:
        code, detail, inputs, parameters = header["code"], header["detail"], self.layout.inputs, self.layout.parameters
        if not 1 <= code <= len(REASONS):
            return f"for the reason {code}, which this version of the protocol does not know"
        name, text = list(REASONS.items())[code - 1]
        if name == "busy":
            return (
                f"busy: another client's session is open, and ends in {detail} s if that stays silent; try again then"
            )
        if name == "parameter" and detail < len(parameters):
            about, value = parameters[detail], np.frombuffer(request, "<f8", 1, HEADER_SIZE)[0]
            bounds = (("at least", about.low), ("at most", about.high))
            words = "".join(f", {side} {bound:g}" for side, bound in bounds if math.isfinite(bound))
            return f"{about.name} must be finite{words}, got {value:g}"
        return f"{text} ({inputs[detail].name})" if name == "value" and detail < len(inputs) else text


class Answer(NamedTuple):
    """What a server in free running tells."""

    time: float  # of the simulation [s]
    torque: float  # for a motor at the handwheel, limited and faded [N m]
    gain: float  # of the watchdog in it, 0 to 1
    phase: str  # of the watchdog: off, starting, on, fading or failed
    delay: float  # since the client sent the inputs that it is the answer to [s]
    outputs: NDArray[np.float64]  # (C,) in the order of the layout


class Stream(Client):
    """A session with a server in free running: inputs go and answers come, each at its own time.

    Parameters and errors are those of :class:`Client`. The server answers in every millisecond from the first inputs
    on. Without inputs for 20 ms its torque fades out; who turns it into a real one has to end it as well, where no
    answer comes.
    """

    period = 1

    def put(self, inputs: ArrayLike) -> None:
        """Send inputs (I,), which act from the next sample on."""
        self._send(self.request(STEP, inputs))
        self.sequence = (self.sequence + 1) % _CYCLE

    def get(self, wait: float = 0.0) -> Answer | None:
        """The newest answer, for which to wait so long [s]; None where there is none."""
        newest = None
        self._pause(wait)
        try:
            while True:
                packet = self._receive()
                header = unpacked(packet)
                if header is None or header["session"] != self.session or header["kind"] != STEPPED:
                    continue
                if header["time"] <= self.time:
                    continue
                outputs = self._values(header, packet)
                self.time = header["time"]
                delay = 1e-9 * (time.monotonic_ns() - header["echo"])
                newest = Answer(self.time, header["torque"], header["gain"], PHASES[header["code"]], delay, outputs)
                self._pause(0.0)
        except (TimeoutError, BlockingIOError, ConnectionRefusedError):
            return newest
        finally:
            self._pause(self.patience)
