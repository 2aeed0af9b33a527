"""What keyboard, mouse, gamepad and wheel have in common, whose events the window's thread gets from pygame."""

import time
from typing import Any

from steer_env.live.devices.common.device import Clock, Device, DeviceError

_LONGEST = 0.1  # time that a wanted angle moves at most between two calls, as behind a process that was stopped [s]


class WindowInput(Device):
    """A device without a motor, in which a person wants an angle.

    Attributes
    ----------
    wanted : float
        The angle [rad].
    """

    hands = "torque"

    def __init__(self, clock: Clock = time.monotonic_ns) -> None:
        super().__init__(clock=clock)
        self.wanted = 0.0

    def _open(self) -> None:
        self.pygame = pygame_or_error(self.about)
        self._last = self.clock()

    def _dead_man(self, now: int) -> bool:
        """Buttons, too, are told by the window."""
        return super()._dead_man(now) and self.answers(now)

    def code(self, key: str) -> int:
        """Number of a key, as events have it, by its name in pygame."""
        found: int = getattr(self.pygame, f"K_{key}")
        return found

    def elapsed(self) -> float:
        """Time since the last call [s]."""
        now = self.clock()
        passed, self._last = 1e-9 * (now - self._last), now
        return min(max(passed, 0.0), _LONGEST)

    def recentre(self) -> None:
        """What is wanted becomes zero; a wheel takes its angle as straight ahead."""
        self.wanted = 0.0
        if self.hands == "angle":
            super().recentre()


def pygame_or_error(about: str) -> Any:
    """The package pygame.

    Raises
    ------
    DeviceError
        It is not installed.
    """
    try:
        import pygame  # here, because it is an extra
    except ImportError:
        raise DeviceError(f"{about} needs the package pygame-ce: pip install '.[drive]'") from None
    return pygame
