"""The protocol of a device: what a person does comes in as readings, the torque of the motor goes out.

One thread of Python opens a device, reads it about 500 times in a second, writes the torque and closes it. What a
device needs from the window's thread comes by :meth:`Device.feed`. A device raises :class:`DeviceError` where it is
gone or refuses; its message is a sentence for the person who drives.
"""

import inspect
import math
import time
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Any, NamedTuple, TypeVar

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import flag, number, read_number
from steer_env.friction.numerics.registry import Registry
from steer_env.live.devices.common.commands import Keys

Clock = Callable[[], int]
_ANSWERS = 200_000_000  # time since the last call of feed() for which what the window told counts; assumed [ns]
RECENTRED = 0.5  # rate at which straight ahead moves to where a person wants it; assumed [rad/s]
D = TypeVar("D", bound="Device")


class DeviceError(OSError):
    """A device that is not there, is gone or refuses; the message names it and says what to do."""


class Reading(NamedTuple):
    """What a device told at one time."""

    stamp: int  # monotonic clock at which it arrived [ns]
    angle: float  # of the handwheel, left positive; where ``hands`` is "torque" the angle that is wanted [rad]
    speed: float = math.nan  # of the handwheel, NaN where the device does not tell it [rad/s]
    throttle: float = 0.0  # 0 to 1 [1]
    brake: float = 0.0  # 0 to 1 [1]
    pressed: frozenset[str] = frozenset()  # COMMANDS pressed since the reading before
    dead_man: bool = False  # whether the dead-man key is held; False where the device has none


class Device:
    """A device, closed until its ``with`` block begins.

    Parameters
    ----------
    max_torque : float
        What the motor gives at full force [N m]; a torque beyond it is clipped and counted.
    reverse : bool
        Whether a positive torque has to be sent as a negative one, where the motor pulls to the wrong side.
    clock : callable
        Monotonic clock [ns].

    Attributes
    ----------
    hands : {"angle", "torque"}
        "angle": a wheel, whose angle is that of the car's handwheel, and whose motor may take the torque. "torque": no
        wheel; the angle is what a person wants, to which a virtual arm turns the car's handwheel.
    motor : bool
        Whether it has a motor; without one, :meth:`write` does nothing.
    about : str
        One line on the device that was found.
    """

    name = ""
    hands = "angle"
    motor = False

    def __init__(self, max_torque: float = 8.0, reverse: bool = False, clock: Clock = time.monotonic_ns) -> None:
        self.max_torque = number("max_torque", max_torque, minimum=0.0, maximum=100.0, above=True)
        self.sign = -1.0 if reverse else 1.0
        self.clock = clock
        self.about = self.name
        self.writes, self.clips = 0, 0
        self.keys = Keys()

    def __enter__(self: D) -> D:
        """Open the device.

        Raises
        ------
        DeviceError
            It is not there or cannot be used, with what to do.
        """
        self._raw = self._straight = self._zero = 0.0
        self._centred = self.clock()
        self._fed = self._centred - 2 * _ANSWERS
        self._open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the torque and close the device; one that is gone needs neither."""
        self._close()

    def feed(self, events: Iterable[Any]) -> None:
        """Take events of pygame, from the thread that has the window.

        Every device takes the keys of ``KEYS``, so that a person gives commands by the keyboard beside any of them. It
        has to be called several times in a second, also without events: a dead-man key of a window that hangs is none.
        """
        self._fed = self.clock()
        for event in events:
            self.keys.feed(event)
            self._feed(event)

    def read(self) -> Reading | None:
        """What arrived last; None where nothing did since the last call. Never waits.

        Raises
        ------
        DeviceError
            The device is gone.
        """
        raise NotImplementedError

    def write(self, torque: float) -> None:
        """Give the motor a torque at the handwheel, left positive [N m]; never waits.

        A motor ends its torque by itself where this is not called again within its timeout.

        Raises
        ------
        DeviceError
            The device refuses or is gone, or the torque is not finite, behind which the motor gets none.
        """
        if not self.motor:
            return
        if not math.isfinite(torque):
            self._push(0.0)
            raise DeviceError(f"{self.about}: the torque {torque} N m is no number, so that the motor got none")
        given = within(torque, -self.max_torque, self.max_torque)
        self.writes += 1
        self.clips += given != torque
        self._push(self.sign * given)

    def clipping(self) -> float:
        """Share of the torques written that were beyond ``max_torque`` [1]."""
        return self.clips / max(self.writes, 1)

    def recentre(self) -> None:
        """Take the angle that was read last as straight ahead; what a device without a wheel wants becomes zero.

        The angle that is read goes there slowly, as the torque of a motor follows it.
        """
        self._straight = self._raw

    def reading(self, angle: float, speed: float = math.nan, throttle: float = 0.0, brake: float = 0.0) -> Reading:
        """A reading of now, with what was pressed since the last one; ``angle`` is that of the device itself [rad]."""
        now, keys = self.clock(), self.keys
        most = max(0.0, RECENTRED * 1e-9 * (now - self._centred))
        self._zero += within(self._straight - self._zero, -most, most)
        self._raw, self._centred = angle, now
        return Reading(now, angle - self._zero, speed, throttle, brake, keys.pressed(), self._dead_man(now))

    def _dead_man(self, now: int) -> bool:
        """Whether the dead-man key is held: one of the window only while the window answers."""
        return self.keys.dead_man(window=self.answers(now))

    def answers(self, now: int) -> bool:
        """Whether the window's thread still calls :meth:`feed`, at a time [ns]."""
        return now - self._fed <= _ANSWERS

    def _open(self) -> None:
        """Find the device and make it ready."""

    def _feed(self, event: Any) -> None:
        """Take an event of pygame."""

    def _close(self) -> None:
        """End the torque and let the device go."""

    def _push(self, torque: float) -> None:
        """Give the motor a torque within ``max_torque``, in its own direction [N m]."""
        raise NotImplementedError


_registry: Registry[type[Device]] = Registry("device", "steer_env.live.devices")
_NOT_FOR_USERS = "clock"  # a callable, for tests and simulated time


def available() -> tuple[str, ...]:
    """Names of all devices, in alphabetical order."""
    return _registry.available()


def register(name: str, kind: type[Device]) -> None:
    """Make a class of devices known by a name."""
    kind.name = name
    _registry.register(name, kind)


def options(name: str) -> dict[str, Any]:
    """Names and defaults of what :func:`make` takes for a device.

    Raises
    ------
    ValueError
        Unknown device.
    """
    return {key: parameter.default for key, parameter in _signature(name).items() if key != _NOT_FOR_USERS}


def _signature(name: str) -> dict[str, inspect.Parameter]:
    return dict(inspect.signature(_registry[name]).parameters)


def make(name: str, **given: Any) -> Device:
    """A device by name, not yet open.

    Parameters
    ----------
    name : str
        Of :func:`available`.
    given
        Its :func:`options`; numbers and truth values may be text, as the command line has them.

    Raises
    ------
    ValueError
        Unknown name or option, or a value outside its range.
    """
    known = _signature(name)
    for key in given:
        if key not in known:
            raise ValueError(f"the device {name} has no option {key!r}; it has {', '.join(sorted(options(name)))}")
    return _registry[name](**{key: _read(key, value, known[key].annotation) for key, value in given.items()})


def _read(key: str, value: Any, kind: Any) -> Any:
    """An option in its type, of which the command line has the text."""
    if not isinstance(value, str) or kind not in (float, int, bool):
        return value
    if kind is bool:
        return flag(key, value)
    found = read_number(value)
    return int(found) if kind is int and isinstance(found, float) and found.is_integer() else found


def wheel_angle(value: float, low: float, high: float, degrees: float) -> float:
    """Angle [rad], left positive, of an axis whose ends are a wheel's locks, so many degrees apart; right is high."""
    return math.radians(degrees) * (0.5 - (value - low) / (high - low))


def pedal(value: float, rest: float, full: float) -> float:
    """How far a pedal is pressed, 0 to 1, whose axis reads ``rest`` and ``full`` at its ends."""
    return within((value - rest) / (full - rest), 0.0, 1.0)
