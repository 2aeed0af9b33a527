"""The keyboard: arrow keys turn the wanted angle at a rate, to which a virtual arm turns the car's handwheel."""

import math
import time
from typing import Any

from steer_env.friction.numerics.check import number
from steer_env.live.devices.common.device import Clock, Reading, register
from steer_env.live.devices.common.window_input import WindowInput

LEFT_KEYS, RIGHT_KEYS, THROTTLE_KEYS, BRAKE_KEYS = (
    ("LEFT", "a"),
    ("RIGHT", "d"),
    ("UP", "w"),
    ("DOWN", "s"),
)  # of pygame, K_...


class Keyboard(WindowInput):
    """Arrow keys, or a, d, w and s.

    Parameters
    ----------
    rate_deg, return_deg : float
        Rates at which the wanted angle moves while a key is held, and back to zero without one [deg/s].
    range_deg : float
        Largest wanted angle to either side [deg].
    clock : callable
        As of :class:`Device`.
    """

    def __init__(
        self,
        rate_deg: float = 60.0,
        return_deg: float = 120.0,
        range_deg: float = 180.0,
        clock: Clock = time.monotonic_ns,
    ) -> None:
        super().__init__(clock=clock)
        self._rate = math.radians(number("rate_deg", rate_deg, minimum=1.0, maximum=2000.0))
        self._return = math.radians(number("return_deg", return_deg, minimum=0.0, maximum=2000.0))
        self._range = math.radians(number("range_deg", range_deg, minimum=1.0, maximum=900.0))
        self.about = "the keyboard"

    def _open(self) -> None:
        super()._open()
        self._held: set[int] = set()
        self._codes = [[self.code(key) for key in keys] for keys in (LEFT_KEYS, RIGHT_KEYS, THROTTLE_KEYS, BRAKE_KEYS)]

    def _feed(self, event: Any) -> None:
        if event.type == self.pygame.KEYDOWN:
            self._held.add(event.key)
        elif event.type == self.pygame.KEYUP:
            self._held.discard(event.key)
        elif event.type == self.pygame.WINDOWFOCUSLOST:  # nobody tells which keys are released meanwhile
            self._held.clear()

    def read(self) -> Reading:
        """The wanted angle now."""
        left, right, throttle, brake = (any(code in self._held for code in codes) for codes in self._codes)
        elapsed = self.elapsed()
        if left != right:
            self.wanted += self._rate * elapsed * (1.0 if left else -1.0)
            self.wanted = max(-self._range, min(self.wanted, self._range))
        elif not left:
            self.wanted = math.copysign(max(abs(self.wanted) - self._return * elapsed, 0.0), self.wanted)
        return self.reading(self.wanted, throttle=float(throttle), brake=float(brake))


register("keyboard", Keyboard)
