"""A wheel on a CAN bus, by python-can with the messages of a DBC: angle frames come, torque frames go.

A torque frame is sent by :meth:`Can.write` alone, at most once in a period. The cyclic transmission of the operating
system is not used, as it would go on sending the last torque for a process that has been stopped. Who drives the motor
has to end its torque where no frame arrives.
"""

import math
import time
from itertools import product
from typing import Any, NamedTuple

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import did_you_mean, number, read_number
from steer_env.friction.numerics.extras import install
from steer_env.live.devices.common.device import Clock, Device, DeviceError, Reading, register
from steer_env.recording.units import parse_unit

_MOST_FRAMES = 1000  # frames that one call takes; the rest waits
_SPARE = 1_000_000  # of the period by which a frame may go early, as the calls come at times of their own [ns]


class Signal(NamedTuple):
    """A signal of a message, and its unit."""

    message: Any  # of cantools
    name: str
    factor: float  # SI units in one of the DBC's

    def label(self) -> str:
        """As a person writes it."""
        return f"{self.message.name}.{self.name}"


class Can(Device):
    """A wheel on a bus.

    Parameters
    ----------
    dbc : str
        File of the messages.
    interface, channel : str
        Of the bus, as python-can calls them.
    bus : str
        What else python-can needs to open it: ``"bitrate=500000+fd=true"``.
    angle, torque : str
        Signals, ``MESSAGE.SIGNAL``, of the handwheel's angle and of the motor's torque.
    speed, throttle, brake : str
        Further signals that arrive; empty where there is none. Pedals are in % or from 0 to 1. The speed is for
        programs of your own: a drive makes it of the angles, at the rate of its loop.
    counter : str
        A signal of the angle's message that counts its frames: one that does not count on is stale.
    torque_counter : str
        A signal of the torque's message that has to count its frames.
    also : str
        Constant values of other signals of the torque's message, as ``"ENABLE=1+MODE=3"``; the rest is at its initial
        value of the DBC, or zero.
    angle_unit, speed_unit, torque_unit : str
        Units where the DBC has none.
    right_positive : bool
        Whether the bus counts angle, speed and torque positive to the right.
    period_ms : float
        Of the torque frame [ms]; 0 for the cycle time of the DBC.
    max_torque, reverse, clock
        As of :class:`Device`.
    """

    motor = True

    def __init__(
        self,
        dbc: str = "",
        interface: str = "socketcan",
        channel: str = "can0",
        bus: str = "",
        angle: str = "WHEEL.ANGLE",
        torque: str = "MOTOR.TORQUE",
        speed: str = "",
        throttle: str = "",
        brake: str = "",
        counter: str = "",
        torque_counter: str = "",
        also: str = "",
        angle_unit: str = "",
        speed_unit: str = "",
        torque_unit: str = "",
        right_positive: bool = False,
        period_ms: float = 0.0,
        max_torque: float = 5.0,
        reverse: bool = False,
        clock: Clock = time.monotonic_ns,
    ) -> None:
        super().__init__(max_torque, reverse, clock)
        self._dbc, self._given = dbc, {"interface": interface, "channel": channel} | _pairs("bus", bus)
        self._names = {"angle": angle, "torque": torque, "speed": speed, "throttle": throttle, "brake": brake}
        self._counters = {"counter": counter, "torque_counter": torque_counter}
        self._also = {name: number(f"also: {name}", read_number(text)) for name, text in _pairs("also", also).items()}
        self._units = {"angle": angle_unit, "speed": speed_unit, "torque": torque_unit}
        self._side = -1.0 if right_positive else 1.0
        self._period = round(1e6 * number("period_ms", period_ms, minimum=0.0, maximum=100.0))
        self.about = f"the CAN bus {channel} of {interface}"

    def _open(self) -> None:
        try:
            import can  # here, because they are an extra
            import cantools
        except ImportError:
            raise DeviceError(f"CAN needs the packages python-can and cantools: {install('drive')}") from None
        self._can = can
        self._messages = self._database(cantools)
        self._signals = {use: self._signal(use, name, _UNITS[use]) for use, name in self._names.items() if name}
        self._prepare()
        given: dict[str, Any] = {key: can.util.cast_from_string(value) for key, value in self._given.items()}
        listens = {signal.message.frame_id: signal.message for use, signal in self._signals.items() if use != "torque"}
        filters = [
            {"can_id": i, "can_mask": 0x1FFFFFFF, "extended": message.is_extended_frame}
            for i, message in listens.items()
        ]
        try:
            self._bus = can.Bus(can_filters=filters, **given)
        except (can.CanError, OSError, ValueError, TypeError) as error:
            raise DeviceError(
                f"{self.about} cannot be opened ({error}): is the interface there and up? The options interface, "
                "channel and bus are those of python-can"
            ) from None
        self._values = dict.fromkeys(("angle", "speed", "throttle", "brake"), 0.0)
        self._values["speed"] = float("nan")
        self._counted, self._sent, self._count = None, self.clock() - 10**9, 0

    def _database(self, cantools: Any) -> list[Any]:
        if not self._dbc:
            raise DeviceError(f"{self.about} needs the DBC that says what is in its frames: dbc=FILE")
        try:
            return list(cantools.database.load_file(self._dbc, strict=False).messages)
        except Exception as error:  # the operating system's, and those of cantools' parsers
            reason = " ".join(str(error).split())
            raise DeviceError(f"{self._dbc} cannot be read as a CAN database: {reason}") from None

    def _signal(self, use: str, label: str, expected: str) -> Signal:
        """A signal by its name, in its unit."""
        labels = {f"{message.name}.{s.name}": (message, s) for message in self._messages for s in message.signals}
        if label not in labels:
            raise DeviceError(
                f"{self._dbc} has no signal {label!r}, which {use}=MESSAGE.SIGNAL chooses; "
                f"{did_you_mean(label, labels)}"
            )
        message, signal = labels[label]
        text = self._units.get(use, "") or signal.unit or ""
        unit, factor = (parse_unit(text) or ("", 1.0)) if text != "%" else ("1", 0.01)
        if expected == "1" and not text:
            unit = "1"
        if expected and unit != expected:
            raise DeviceError(
                f"{label} in {self._dbc} is in {text or 'no unit'}, which is none of {_EXAMPLES[expected]}"
                + (f": give {use}_unit=UNIT" if use in self._units else "")
            )
        return Signal(message, signal.name, factor)

    def _prepare(self) -> None:
        """What the torque frame needs: its period, the rest of its signals, and room for the largest torque."""
        found = self._signals["torque"]
        message = found.message
        if not self._period:
            if not message.cycle_time:
                raise DeviceError(f"{self._dbc} tells no cycle time of {message.name}: give period_ms=NUMBER")
            self._period = round(1e6 * message.cycle_time)
        if found.message is self._signals["angle"].message:
            raise DeviceError(f"angle and torque cannot both be signals of {message.name}: the wheel sends one of them")
        for use, label in self._counters.items():
            if label:
                of = self._signals["torque" if use == "torque_counter" else "angle"].message
                if self._signal(use, label, "").message is not of:
                    raise DeviceError(f"{use}={label} must be a signal of {of.name}")
        names = {signal.name: signal for signal in message.signals}
        for name in self._also:
            if name not in names:
                raise DeviceError(f"{message.name} in {self._dbc} has no signal {name!r}; {did_you_mean(name, names)}")
        self._frame = {name: float(signal.initial or 0.0) for name, signal in names.items()} | self._also
        self._counter = self._counters["torque_counter"].rpartition(".")[2]
        self._counts = _counts(names[self._counter]) if self._counter else range(1)
        for torque, count in product((-self.max_torque, self.max_torque), (self._counts[0], self._counts[-1])):
            try:
                self._data(torque, count)
            except Exception as error:  # of cantools, which names the signal
                raise DeviceError(
                    f"{message.name} in {self._dbc} cannot carry {torque:g} N m ({error}): lower max_torque, or give "
                    "the other signals a value by also=SIGNAL=NUMBER"
                ) from None

    def _data(self, torque: float, count: int) -> bytes:
        """The bytes of a torque frame."""
        found = self._signals["torque"]
        values = {**self._frame, found.name: self._side * torque / found.factor}
        if self._counter:
            values[self._counter] = count
        data: bytes = found.message.encode(values, strict=True)
        return data

    def read(self) -> Reading | None:
        """The newest angle frame; None where none arrived, or where its counter stands still."""
        news = False
        try:
            for _ in range(_MOST_FRAMES):
                frame = self._bus.recv(timeout=0)
                if frame is None:
                    break
                news = self._take(frame) or news
        except (self._can.CanError, OSError) as error:
            raise self._down(error) from None
        if not news:
            return None
        values = self._values
        return self.reading(values["angle"], values["speed"], values["throttle"], values["brake"])

    def _take(self, frame: Any) -> bool:
        """Take the signals of a frame; whether it told a new angle."""
        if frame.is_error_frame or frame.is_remote_frame:
            return False
        news = False
        for use, (message, name, factor) in self._signals.items():
            same = frame.arbitration_id == message.frame_id and frame.is_extended_id == message.is_extended_frame
            if use == "torque" or not same or len(frame.data) < message.length:
                continue
            values = message.decode(frame.data, decode_choices=False)
            if use == "angle" and self._stands(values):
                continue
            news = news or use == "angle"
            value = factor * float(values[name])
            self._values[use] = within(value, 0.0, 1.0) if use in ("throttle", "brake") else self._side * value
        return news

    def _stands(self, values: dict[str, Any]) -> bool:
        """Whether the counter of an angle frame is the same as before."""
        name = self._counters["counter"].rpartition(".")[2]
        if not name:
            return False
        before, self._counted = self._counted, values[name]
        return bool(before == self._counted)

    def _down(self, error: Exception) -> DeviceError:
        return DeviceError(f"{self.about} is down ({error}): check cable, bit rate and the interface, and start again")

    def _push(self, torque: float) -> None:
        now = self.clock()
        if now - self._sent < self._period - min(_SPARE, self._period // 4):
            return
        self._send(torque)
        # By whole periods, so that calls at times of their own do not stretch the cycle.
        self._sent += max(1, round((now - self._sent) / self._period)) * self._period

    def _send(self, torque: float) -> None:
        message = self._signals["torque"].message
        frame = self._can.Message(
            arbitration_id=message.frame_id,
            is_extended_id=message.is_extended_frame,
            data=self._data(torque, self._counts[self._count]),
        )
        self._count = (self._count + 1) % len(self._counts)
        try:
            self._bus.send(frame, timeout=0)
        except (self._can.CanError, OSError) as error:
            raise self._down(error) from None

    def _close(self) -> None:
        try:
            self._send(0.0)
        except Exception:  # also of cantools: what ends here must not keep the bus open
            pass  # the node ends the torque by itself
        finally:
            self._bus.shutdown()


# Unit of each use in memory, and what units a DBC may have for it.
_UNITS = {"angle": "rad", "speed": "rad/s", "torque": "N m", "throttle": "1", "brake": "1"}
_EXAMPLES = {"rad": "deg, rad", "rad/s": "deg/s, rad/s", "N m": "Nm, mNm, N cm", "1": "%, 1"}


def _counts(signal: Any) -> range:
    """The numbers through which a counter runs: those of its bits, within the least and the largest of the DBC.

    Raises
    ------
    DeviceError
        It does not count whole numbers by one.
    """
    if signal.is_float or signal.scale != 1 or signal.offset != int(signal.offset):
        raise DeviceError(f"the counter {signal.name} does not count by one: choose another signal")
    half = 2 ** (signal.length - 1)
    low, high = (-half, half - 1) if signal.is_signed else (0, 2 * half - 1)
    low, high = low + int(signal.offset), high + int(signal.offset)
    least = low if signal.minimum is None else max(low, math.ceil(signal.minimum))
    most = high if signal.maximum is None else min(high, math.floor(signal.maximum))
    if least >= most:
        raise DeviceError(f"the counter {signal.name} cannot count from {least} to {most}: choose another signal")
    return range(least, most + 1)


def _pairs(option: str, text: str) -> dict[str, str]:
    """``"a=1+b=2"`` by name."""
    found = {}
    for part in filter(None, text.split("+")):
        name, equals, value = part.partition("=")
        if not equals:
            raise ValueError(f"{option} is like NAME=VALUE+NAME=VALUE, got {part!r}")
        found[name.strip()] = value.strip()
    return found


register("can", Can)
