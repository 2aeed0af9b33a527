"""A full fake wheel: a simulated rim and motor with a clock of their own, a scripted person, and faults on command."""

import math
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from steer_env.friction.numerics.check import number, one_of, whole
from steer_env.live.devices.common.device import Clock, Device, DeviceError, Reading, register

Hands = Callable[[float, float, float], float]  # of time [s], angle [rad] and speed [rad/s]: torque [N m]
INTEGRATION_STEP = 500_000  # of the integration [ns]
_KEPT_STEPS = 1000  # steps of the past, as long as the longest delay of a sensor
_STOP_STIFFNESS = 200.0  # of the end stops [N m/rad]


class Rim(NamedTuple):
    """What a wheel is made of."""

    inertia: float = 0.04  # of rim and motor [kg m2]
    damping: float = 0.3  # [N m s/rad]
    friction: float = 0.1  # of the bearings [N m]
    lock: float = math.radians(450.0)  # to either side [rad]


class WheelModel:
    """A wheel with a clock of its own, integrated from one call to the next.

    Parameters
    ----------
    rim : Rim
        What it is made of.
    hands : callable
        Torque of a person's hands [N m] by time [s], angle [rad] and speed [rad/s].
    timeout : float
        Without a command for so long, the motor gives no torque [s].
    now : int
        Clock at the begin [ns].
    """

    def __init__(self, rim: Rim, hands: Hands, timeout: float, now: int) -> None:
        self.rim, self.hands, self.timeout = rim, hands, round(1e9 * timeout)
        self.begin = self.now = now
        self.angle, self.speed = 0.0, 0.0
        self.motor = 0.0  # torque that acts now [N m]
        self._coming: deque[tuple[int, float]] = deque()  # commands: when they arrive [ns], torque [N m]
        self._arrived, self._held = now, 0.0
        self._past = deque([0.0], _KEPT_STEPS)  # angles after each step

    def command(self, torque: float, arrives: int) -> None:
        """A torque [N m] that reaches the motor at a time [ns]."""
        self._coming.append((arrives, torque))

    def cut(self) -> None:
        """End the torque at once, as where the supply is cut."""
        self._coming.clear()
        self._held = self.motor = 0.0

    def advance(self, now: int) -> None:
        """Let time pass until the last whole step before a time [ns]; a time that goes back changes nothing."""
        while self.now + INTEGRATION_STEP <= now:
            self.now += INTEGRATION_STEP
            self._step(1e-9 * INTEGRATION_STEP)

    def angle_at(self, time: int) -> float:
        """The angle [rad] that the rim had at a time [ns]; the oldest that is known where that is too long ago."""
        back = min(max((self.now - time) // INTEGRATION_STEP, 0), len(self._past) - 1)
        return self._past[-1 - back]

    def _step(self, h: float) -> None:
        while self._coming and self._coming[0][0] <= self.now:
            self._arrived, self._held = self._coming.popleft()
        self.motor = self._held if self.now - self._arrived <= self.timeout else 0.0
        rim = self.rim
        torque = self.hands(1e-9 * (self.now - self.begin), self.angle, self.speed) + self.motor
        beyond = abs(self.angle) - rim.lock
        if beyond > 0.0:
            torque -= math.copysign(_STOP_STIFFNESS * beyond, self.angle)
        # The damping is implicit, so that no step length is too long for it; the friction stops what it can stop.
        speed = (self.speed + h * torque / rim.inertia) / (1.0 + h * rim.damping / rim.inertia)
        self.speed = math.copysign(max(abs(speed) - h * rim.friction / rim.inertia, 0.0), speed)
        self.angle += h * self.speed
        self._past.append(self.angle)


_ARM = 40.0, 2.0  # stiffness [N m/rad] and damping [N m s/rad] of hands that hold a wheel; assumed
_STRENGTH = 30.0  # largest torque of two hands [N m]; assumed
PEOPLE = {
    "weave": "steers a sine, which grows over its first cycle",
    "straight": "holds the wheel straight",
    "free": "takes the hands off",
    "release": "turns the wheel in a quarter of the sine's period, holds it for a second, and takes the hands off",
}
# Faults, and what the number behind each means.
FAULTS = {
    "unplug": "reading and writing fail, and the motor has no supply",
    "refuse": "the motor takes no torque any more",
    "silent": "no reading arrives any more",
    "stuck": "the angle that is read stands still",
    "delay": "the delay of the wheel from now on [ms]",
    "jump": "the angle that is read jumps by so much [deg]",
    "clock": "the time stamps jump by so much [s]",
    "let_go": "the person lets go of the dead-man key, which was held until then",
}
_WITH_NUMBER = "delay", "jump", "clock"


def make_hands(person: str, amplitude_deg: float, frequency: float) -> Hands:
    """Hands of a person of ``PEOPLE``, who follows a sine of so many deg and Hz, or holds the wheel and lets go of it.

    Raises
    ------
    ValueError
        Unknown person, or a number outside its range.
    """
    one_of("person", person, PEOPLE)
    size = math.radians(number("amplitude_deg", amplitude_deg, minimum=0.0, maximum=450.0))
    number("frequency", frequency, minimum=0.0, maximum=10.0, above=True)
    if person == "free":
        return lambda t, angle, speed: 0.0
    if person == "straight":
        size = 0.0
    omega = 2.0 * math.pi * frequency
    turned = 0.25 / frequency  # to the first peak [s]

    def hands(t: float, angle: float, speed: float) -> float:
        if person == "release":
            if t > turned + 1.0:
                return 0.0
            t = min(t, turned)
        grown = size * (min(t * frequency, 1.0) if person == "weave" else 1.0)
        error, error_speed = grown * math.sin(omega * t) - angle, grown * omega * math.cos(omega * t) - speed
        return max(-_STRENGTH, min(_ARM[0] * error + _ARM[1] * error_speed, _STRENGTH))

    return hands


def parse_faults(text: str) -> list[tuple[float, str, float]]:
    """Faults as the option has them, in the order of their times: ``"jump=5@2+unplug@20"``.

    Returns
    -------
    list of (float, str, float)
        Time since the device was opened [s], name of ``FAULTS``, and number.

    Raises
    ------
    ValueError
        The text is none, with an example.
    """
    found = []
    for part in filter(None, text.split("+")):
        what, at, seconds = part.partition("@")
        name, equals, value = what.strip().partition("=")
        try:
            if not at or name not in FAULTS or (equals != "") != (name in _WITH_NUMBER):
                raise ValueError
            found.append((float(seconds), name, float(value or 0.0)))
        except ValueError:
            known = ", ".join(f"{key}=NUMBER" if key in _WITH_NUMBER else key for key in FAULTS)
            raise ValueError(f"faults are like 'jump=5@2+unplug@20', got {part!r}; there are {known}") from None
    return sorted(found)


class Fake(Device):
    """A wheel that is simulated.

    Parameters
    ----------
    person : {"weave", "straight", "free", "release"}
        What the hands do.
    amplitude_deg, frequency : float
        Of the weave [deg], [Hz].
    inertia, damping, friction : float
        Of the rim [kg m2], [N m s/rad], [N m].
    delay_ms : float
        From the angle of the rim to its reading, and from the torque to the motor, together [ms].
    timeout_ms : float
        Time after which the motor stops where no torque is written [ms].
    degrees, bits : float, int
        From lock to lock [deg], and the resolution of the sensor over that.
    rate : float
        Readings in a second [Hz].
    faults : str
        Faults at stated times, as of :func:`parse_faults`.
    max_torque, clock
        As of :class:`Device`. With a clock that is simulated, everything is repeated to the bit.
    """

    motor = True

    def __init__(
        self,
        person: str = "weave",
        amplitude_deg: float = 20.0,
        frequency: float = 0.2,
        inertia: float = Rim().inertia,
        damping: float = Rim().damping,
        friction: float = Rim().friction,
        delay_ms: float = 8.0,
        timeout_ms: float = 40.0,
        degrees: float = 900.0,
        bits: int = 16,
        rate: float = 1000.0,
        faults: str = "",
        max_torque: float = 8.0,
        clock: Clock = time.monotonic_ns,
    ) -> None:
        super().__init__(max_torque, False, clock)
        lock = math.radians(number("degrees", degrees, minimum=90.0, maximum=3600.0)) / 2
        self._rim = Rim(
            number("inertia", inertia, minimum=1e-3, maximum=1.0),
            number("damping", damping, minimum=0.0, maximum=100.0),
            number("friction", friction, minimum=0.0, maximum=10.0),
            lock,
        )
        self._hands = make_hands(person, amplitude_deg, frequency)
        self._delay = 1e-3 * number("delay_ms", delay_ms, minimum=0.0, maximum=500.0)
        self._timeout = 1e-3 * number("timeout_ms", timeout_ms, minimum=1.0, maximum=10000.0)
        self._resolution = 2.0 * lock / 2 ** min(whole("bits", bits, 8), 32)
        self._period = round(1e9 / number("rate", rate, minimum=10.0, maximum=10000.0))
        self._script = parse_faults(faults)
        self.about = "the fake wheel"

    def _open(self) -> None:
        now = self.clock()
        self.wheel = WheelModel(self._rim, self._hands, self._timeout, now)
        self._told, self._seen, self._jump, self._shift = now - self._period, 0.0, 0.0, 0
        self._faults: set[str] = set()
        self._left = list(self._script)

    def inject(self, fault: str, value: float = 0.0) -> None:
        """Let a fault of ``FAULTS`` happen now, with its number."""
        one_of("fault", fault, FAULTS)
        if fault == "delay":
            self._delay = 1e-3 * value
        elif fault == "jump":
            self._jump += math.radians(value)
        elif fault == "clock":
            self._shift += round(1e9 * value)
        self._faults.add(fault)
        if fault == "unplug":
            self.wheel.cut()

    def _pass(self) -> int:
        """Let the wheel's own time pass until now, with the faults on the way; the time [ns]."""
        now = self.clock()
        while self._left and self.wheel.begin + round(1e9 * self._left[0][0]) <= now:
            seconds, fault, value = self._left.pop(0)
            self.wheel.advance(self.wheel.begin + round(1e9 * seconds))
            self.inject(fault, value)
        self.wheel.advance(now)
        if "unplug" in self._faults:
            raise DeviceError(f"{self.about} was unplugged: plug it in and start again")
        return now

    def read(self) -> Reading | None:
        """What the sensor told half the delay ago, at most once in a period of its rate."""
        now = self._pass()
        if "silent" in self._faults or now - self._told < self._period:
            return None
        self._told = now - (now - self.wheel.begin) % self._period
        if "stuck" not in self._faults:
            angle = self.wheel.angle_at(now - round(0.5e9 * self._delay))
            self._seen = self._resolution * round(angle / self._resolution)
        reading = self.reading(self._seen + self._jump)
        return reading._replace(stamp=now + self._shift, dead_man="let_go" not in self._faults)

    def _push(self, torque: float) -> None:
        now = self._pass()
        if "refuse" in self._faults:
            raise DeviceError(f"{self.about} refuses the torque: check its supply and its emergency stop")
        self.wheel.command(torque, now + round(0.5e9 * self._delay))

    def _close(self) -> None:
        self.wheel.cut()


register("fake", Fake)
