"""Telemetry for programs of sim racing: the packets OutSim and OutGauge of Live for Speed, over UDP on this machine.

The axes of those packets are X to the right, Y ahead and Z upwards at the start, and angles turn anticlockwise about Z,
X and Y: with this project's x ahead and y to the left

    X = -y,  Y = x,  heading = yaw,  pitch = -pitch (nose up),  roll = roll (to the right)

Velocity and acceleration are differences of the position, which every chassis has. docs/driving.md has every field.

Source: Live for Speed, docs/InSim.txt, OutSimPack and OutGaugePack. Deviations: none that is known; no program that
reads them was tried.
"""

import ipaddress
import math
import socket
import struct
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from types import TracebackType

Sample = tuple[float, Mapping[str, float]]  # time of the simulation [s], and channels by their names [SI]
Address = tuple[str, int]

LOOPBACK = "127.0.0.1"
PERIOD = 0.01  # between packets, the shortest of Live for Speed [s]
_OUTSIM = struct.Struct("<I12f3i")
_OUTGAUGE = struct.Struct("<I4sHBB7f2I3f16s16s")
_FLAGS = 16384 + 32768  # OG_KM and OG_BAR: the driver prefers these to miles and PSI
_METRE = 65536  # of a position
_LARGEST = 3e38  # of a float of 32 bits


def receiver(text: str) -> Address:
    """Address and port of ``[HOST:]PORT``.

    Raises
    ------
    ValueError
        A port out of range, or another machine.
    """
    host, _, port = text.rpartition(":")
    return _local((host or LOOPBACK, int(port) if port.isdecimal() else port))  # type: ignore[arg-type]


def _local(address: Address) -> Address:
    """An address on this machine, as numbers."""
    host, port = address
    host = LOOPBACK if host == "localhost" else host
    try:
        local = ipaddress.IPv4Address(host).is_loopback
    except ValueError:
        local = False
    if not local:
        raise ValueError(f"telemetry goes to programs on this machine only, {LOOPBACK}, got {host!r}")
    if not (isinstance(port, int) and 1 <= port <= 65535):
        raise ValueError(f"the port must be a whole number of at least 1 and at most 65535, got {str(port)!r}")
    return host, port


def _motion(samples: Sequence[Sample]) -> tuple[float, float, float, float]:
    """Velocity [m/s] and acceleration [m/s2] in X and Y, of the last of three samples.

    They are means of the last time between two samples, and of both.
    """
    (t0, a), (t1, b), (t2, c) = samples
    found = []
    for name, sign in (("y", -1.0), ("x", 1.0)):
        before, now = (sign * (q[name] - p[name]) / (t - s) for p, q, s, t in ((a, b, t0, t1), (b, c, t1, t2)))
        found.append((now, 2.0 * (now - before) / (t2 - t0)))
    (v_X, a_X), (v_Y, a_Y) = found
    return v_X, v_Y, a_X, a_Y


def _floats(*values: float) -> list[float]:
    return [min(max(value, -_LARGEST), _LARGEST) for value in values]


def _milliseconds(time: float) -> int:
    return round(1e3 * time) % 2**32


def _position(value: float) -> int:
    """A position [m] in 32 bits, which wrap beyond 32 km."""
    return (round(_METRE * value) + 2**31) % 2**32 - 2**31


def outsim(samples: Sequence[Sample]) -> bytes:
    """The 64 bytes of an OutSimPack for the last of three samples, whose times ascend.

    The angular velocity has the yaw rate alone, and velocity and acceleration none upwards. The acceleration is that of
    the motion, without gravity.
    """
    t, now = samples[-1]
    v_X, v_Y, a_X, a_Y = _motion(samples)
    angles = math.remainder(now["yaw_angle"], math.tau), -now.get("pitch_angle", 0.0), now["roll_angle"]
    values = _floats(0.0, 0.0, now["yaw_rate"], *angles, a_X, a_Y, 0.0, v_X, v_Y, 0.0)
    place = (_position(value) for value in (-now["y"], now["x"], now.get("height", 0.0)))
    return _OUTSIM.pack(_milliseconds(t), *values, *place)


def outgauge(samples: Sequence[Sample]) -> bytes:
    """The 92 bytes of an OutGaugePack for the last of three samples: speed, gear, throttle and brake, the rest zero."""
    t, now = samples[-1]
    v_X, v_Y, *_ = _motion(samples)
    gear = int(now.get("gear", 0.0)) + 1  # 0 is reverse, 1 neutral, 2 the first
    speed, throttle, brake = _floats(math.hypot(v_X, v_Y), now.get("throttle", 0.0), now.get("brake_pedal", 0.0))
    zeros = [0.0] * 6  # engine speed, turbo, temperature of the engine, fuel, oil pressure and temperature
    gauges = [speed, *zeros, 0, 0, throttle, brake, 0.0]
    return _OUTGAUGE.pack(_milliseconds(t), b"", _FLAGS, gear, 0, *gauges, b"", b"")


_KINDS = (outsim, outgauge)


class Telemetry:
    """Sends packets, up to 100 in a second, within a ``with`` block; whether anybody receives them does not matter.

    Parameters
    ----------
    source : callable
        The present sample, or None where there is none. One of the same time as that before is not sent; behind a time
        that falls, motion begins anew.
    outsim, outgauge : (str, int), optional
        Address and port that receive the packets of this kind.

    Raises
    ------
    ValueError
        An address that is not on this machine, or a port out of range.
    """

    def __init__(
        self,
        source: Callable[[], Sample | None],
        *,
        outsim: Address | None = None,
        outgauge: Address | None = None,
    ) -> None:
        given = zip(_KINDS, (outsim, outgauge))
        self._source = source
        self._receivers = [(make, _local(address)) for make, address in given if address is not None]
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> "Telemetry":
        if self._receivers:
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        if self._receivers:
            self._thread.join()

    def _run(self) -> None:
        samples: deque[Sample] = deque(maxlen=3)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)
            while not self._stop.wait(PERIOD):
                found = self._source()
                if found is None or (samples and found[0] == samples[-1][0]):
                    continue
                if samples and found[0] < samples[-1][0]:
                    samples.clear()
                samples.append(found)
                if len(samples) < 3:
                    continue
                for make, address in self._receivers:
                    with suppress(OSError):  # nobody listens, or the system takes no more
                        sender.sendto(make(samples), address)
