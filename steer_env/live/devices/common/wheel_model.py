"""A force-feedback wheel as a model: rim and motor with inertia, damping and friction, held by a person's hands.

    J dw/dt = T_hands(t, angle, w) + T_motor - b w - F sign(w)

The motor holds the torque of the last command until its own timeout, behind which it gives none. Numbers are those of
the wheel of a driving simulator, all assumed.
"""

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

Hands = Callable[[float, float, float], float]  # of time [s], angle [rad] and speed [rad/s]: torque [N m]
STEP = 500_000  # of the integration [ns]
_KEPT = 1000  # steps of the past, as long as the longest delay of a sensor
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
        self._past = deque([0.0], _KEPT)  # angles after each step

    def command(self, torque: float, arrives: int) -> None:
        """A torque [N m] that reaches the motor at a time [ns]."""
        self._coming.append((arrives, torque))

    def cut(self) -> None:
        """End the torque at once, as where the supply is cut."""
        self._coming.clear()
        self._held = self.motor = 0.0

    def advance(self, now: int) -> None:
        """Let time pass until the last whole step before a time [ns]; a time that goes back changes nothing."""
        while self.now + STEP <= now:
            self.now += STEP
            self._step(1e-9 * STEP)

    def angle_at(self, time: int) -> float:
        """The angle [rad] that the rim had at a time [ns]; the oldest that is known where that is too long ago."""
        back = min(max((self.now - time) // STEP, 0), len(self._past) - 1)
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
