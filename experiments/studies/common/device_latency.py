"""How long a torque takes to follow the angle of a wheel, through the fake device, a CAN bus, and UDP, on this machine.

The angle of a wheel jumps to and fro at uneven times. What is told is the time from such a jump to the first torque at
the wheel that has jumped as well: it has passed the device, the thread of Python that reads it every 2 ms, the
mailboxes with their filter of the angle, and the loop, and come back the same way. What a real wheel and its bus or
cable add comes on top.
"""

import math
import threading
import time
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from steer_env.connect.udp import Server, Stream
from steer_env.live import devices
from steer_env.live.devices import Device, DeviceError, Reading
from steer_env.live.devices.fake import Fake
from steer_env.live.real_time import Mailboxes, RealTime
from steer_env.live.real_time.angle_filter import BANDWIDTH
from steer_env.live.real_time.measure import Durations
from steer_env.vehicle.subsystems import Subsystem

BIN = 10e-6  # of the histogram [s]
EXCHANGE = 0.002  # of the thread of Python with a device [s]
_JUMP = math.radians(1.0)  # of the angle [rad]
_ANSWER = 0.4  # change of the torque from one time to the next that is the answer to it [N m]
_GAP, _UNEVEN = 40_000_000, 2_000_000  # between jumps, and beyond that at random [ns]
_PATIENCE = 10_000_000_000  # until the watchdog lets the torque through [ns]
_BUS = "steer-env real-time"
_ANGLE, _TORQUE = 256, 512  # identifiers of the frames
_FRAME_SCALES = math.radians(0.02), 0.001  # of their values [rad], [N m]
_CYCLE = 0.002  # of the node's angle frames [s]


class Latency(NamedTuple):
    """What one way found."""

    durations: Durations  # from a jump of the angle to that of the torque
    lost: int  # jumps that no torque followed before the next one
    clipping: float  # share of the torques beyond the largest of the device [1]


class TooBusyError(ValueError):
    """The machine is too busy to measure a latency."""


class Jumps:
    """An angle that jumps to and fro at stated times, once it begins."""

    def __init__(self, seconds: float) -> None:
        number = max(2, round(1e9 * seconds / (_GAP + _UNEVEN / 2)))
        self._gaps = _GAP + np.random.default_rng(18).integers(0, _UNEVEN, number)
        self._created = time.monotonic_ns()
        self.times = np.zeros(0, np.int64)  # [ns]
        self._next = 0

    def begin(self, phase: str) -> None:
        """Begin with the jumps, as soon as the watchdog's phase is "on".

        Raises
        ------
        TooBusyError
            It was not in a long time.
        """
        if phase == "on" and not self.times.size:
            self.times = time.monotonic_ns() + np.cumsum(self._gaps)
        elif not self.times.size and time.monotonic_ns() - self._created > _PATIENCE:
            raise TooBusyError("the watchdog lets no torque through: the machine is too busy to measure")

    def angle(self) -> float:
        """The angle now [rad]; for one thread."""
        now = time.monotonic_ns()
        while self._next < self.times.size and self.times[self._next] <= now:
            self._next += 1
        return 0.5 * _JUMP * (-1.0) ** self._next

    def next_time(self) -> int:
        """When it jumps next, or looks again [ns]."""
        return int(self.times[self._next]) if self._next < self.times.size else time.monotonic_ns() + _GAP

    def over(self) -> bool:
        """Whether the last jump had its time."""
        return self.times.size > 0 and time.monotonic_ns() > self.times[-1] + _GAP

    def latency(self, heard: list[tuple[int, float]], clipping: float) -> Latency:
        """The latency by the torques [N m] that the wheel heard at times [ns]."""
        at, torque = np.array([t for t, _ in heard]), np.array([value for _, value in heard])
        answers = at[1:][np.abs(np.diff(torque)) > _ANSWER]
        first = np.searchsorted(answers, self.times, side="right")
        found = np.append(answers, np.iinfo(np.int64).max)[first]
        kept = found < np.append(self.times[1:], self.times[-1] + _GAP)
        delays = 1e-9 * (found - self.times)[kept]
        if not delays.size:
            raise TooBusyError("no torque followed the angle: the machine is too busy to measure")
        histogram = np.bincount((delays / BIN).astype(int))
        return Latency(Durations(histogram, BIN, float(delays.max())), int(np.sum(~kept)), clipping)


class _Jumping(Fake):
    """A fake wheel, held by a rim that hardly moves, whose sensor jumps, and which notes its torques."""

    def __init__(self, jumps: Jumps) -> None:
        super().__init__(person="straight", inertia=1.0, damping=100.0, delay_ms=0.0)
        self._jumps = jumps
        self.heard: list[tuple[int, float]] = []

    def read(self) -> Reading | None:
        self._jump = self._jumps.angle()
        return super().read()

    def _push(self, torque: float) -> None:
        super()._push(torque)
        self.heard.append((self.clock(), torque))


def _exchange(device: Device, mail: Mailboxes, subsystem: Subsystem, jumps: Jumps) -> None:
    """Take the angle of a device to the loop and the torque back, as a drive does."""
    inputs, angle = np.zeros(len(subsystem.given)), [signal.name for signal in subsystem.given].index("hand_angle")
    due = time.monotonic()
    while not jumps.over():
        reading = device.read()
        if reading is not None:
            inputs[angle] = reading.angle
            mail.put(inputs, reading.stamp)
        torque, phase, _ = mail.get()
        device.write(torque)
        jumps.begin(phase)
        due = max(due + EXCHANGE, time.monotonic() - EXCHANGE)
        time.sleep(max(due - time.monotonic(), 0.0))


def _compile(subsystem: Subsystem, priority: int) -> tuple[Mailboxes, RealTime]:
    mail = Mailboxes(subsystem, angle_bandwidth=BANDWIDTH)
    return mail, RealTime(subsystem, mail.device, priority=priority)


def through_fake(subsystem: Subsystem, seconds: float, priority: int = 0) -> Latency:
    """Through the fake device without a delay of its own: the exchange and the loop."""
    mail, loop = _compile(subsystem, priority)
    jumps = Jumps(seconds)
    with _Jumping(jumps) as device, loop:
        _exchange(device, mail, subsystem, jumps)
    return jumps.latency(device.heard, device.clipping())


def through_can(subsystem: Subsystem, seconds: float, priority: int = 0) -> Latency:
    """Through python-can's virtual bus, whose node sends its angle at once where it jumps, and else every 2 ms.

    Raises
    ------
    DeviceError
        python-can or cantools are not installed.
    """
    dbc = files("steer_env.experiments") / "data" / "real_time" / "wheel.dbc"
    mail, loop = _compile(subsystem, priority)
    with devices.make("can", dbc=str(dbc), interface="virtual", channel=_BUS, max_torque=8.0) as device:
        jumps, heard, over = Jumps(seconds), list[tuple[int, float]](), threading.Event()
        node = threading.Thread(target=_node, args=(jumps, heard, over), daemon=True)
        node.start()
        try:
            with loop:
                _exchange(device, mail, subsystem, jumps)
        finally:
            over.set()
            node.join()
    return jumps.latency(heard, device.clipping())


def _node(jumps: Jumps, heard: list[tuple[int, float]], over: threading.Event) -> None:
    """A wheel on the bus: it sends its angle and notes the torques that arrive."""
    import can  # an extra, which the device has found

    with can.Bus(interface="virtual", channel=_BUS) as bus:
        sent, due = math.nan, time.monotonic()
        while not over.is_set():
            angle, now = jumps.angle(), time.monotonic()
            if angle != sent or now >= due:
                data = round(angle / _FRAME_SCALES[0]).to_bytes(2, "little", signed=True) + bytes(6)
                bus.send(can.Message(arbitration_id=_ANGLE, data=data, is_extended_id=False))
                sent, due = angle, now + _CYCLE
            next_jump = 1e-9 * (jumps.next_time() - time.monotonic_ns())
            frame = bus.recv(max(0.0, min(due - time.monotonic(), next_jump)))
            if frame is not None and frame.arbitration_id == _TORQUE:
                value = int.from_bytes(frame.data[:2], "little", signed=True)
                heard.append((time.monotonic_ns(), _FRAME_SCALES[1] * value))


def through_udp(subsystem: Subsystem, seconds: float, priority: int = 0) -> Latency:
    """Over UDP by the server of ``steer-env serve``, with a client in Python that waits for answers."""
    with (
        Server(subsystem, mode="free-running", priority=priority) as server,
        Stream(server.layout, server.address) as stream,
    ):
        inputs, angle = np.zeros(len(subsystem.given)), [signal.name for signal in subsystem.given].index("hand_angle")
        jumps, heard = Jumps(seconds), list[tuple[int, float]]()
        while not jumps.over():
            inputs[angle] = jumps.angle()
            stream.put(inputs)
            answer = stream.get(0.1)
            if answer:
                heard.append((time.monotonic_ns(), answer.torque))
            jumps.begin(answer.phase if answer else "")
    return jumps.latency(heard, 0.0)


LATENCY_WAYS = {"fake wheel": through_fake, "virtual CAN": through_can, "UDP": through_udp}


def through_all(subsystem: Subsystem, seconds: float, priority: int = 0) -> dict[str, Latency | str]:
    """The latency by each of ``LATENCY_WAYS``, for so long each [s]; the reason where there is none."""
    found: dict[str, Latency | str] = {}
    for name, through in LATENCY_WAYS.items():
        try:
            found[name] = through(subsystem, seconds, priority)
        except (TooBusyError, DeviceError) as error:
            found[name] = str(error)
    return found
