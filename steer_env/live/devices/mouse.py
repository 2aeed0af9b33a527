"""The mouse: moving it to the side moves the wanted angle, to which a virtual arm turns the car's handwheel."""

import math
import time
from typing import Any

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import number
from steer_env.live.devices.common.device import Clock, Reading, register
from steer_env.live.devices.common.window_input import WindowInput

_LEFT_BUTTON, _RIGHT_BUTTON = 1, 3  # buttons


class Mouse(WindowInput):
    """The mouse, which the window holds: left button throttle, right button brake, scroll wheel faster and slower.

    Parameters
    ----------
    deg_per_pixel : float
        Wanted angle that a motion of one pixel is [deg].
    range_deg : float
        Largest wanted angle to either side [deg].
    clock : callable
        As of :class:`Device`.
    """

    def __init__(self, deg_per_pixel: float = 0.2, range_deg: float = 360.0, clock: Clock = time.monotonic_ns) -> None:
        super().__init__(clock)
        self._gain = math.radians(number("deg_per_pixel", deg_per_pixel, minimum=0.001, maximum=10.0))
        self._range = math.radians(number("range_deg", range_deg, minimum=1.0, maximum=900.0))
        self._held: set[int] = set()
        self.about = "the mouse"

    def _open(self) -> None:
        super()._open()
        self._kept = False  # whether the window holds it, so that it does not end at an edge

    def _feed(self, event: Any) -> None:
        pygame = self.pygame
        if not self._kept and pygame.display.get_surface():
            pygame.mouse.set_relative_mode(True)
            self._kept = True
        if event.type == pygame.MOUSEMOTION:
            self.wanted = within(self.wanted - self._gain * event.rel[0], -self._range, self._range)
        elif event.type == pygame.MOUSEBUTTONDOWN:
            self._held.add(event.button)
        elif event.type == pygame.MOUSEBUTTONUP:
            self._held.discard(event.button)
        elif event.type == pygame.MOUSEWHEEL and event.y != 0:
            self.keys.down("wheel", "faster" if event.y > 0 else "slower")
        elif event.type == pygame.WINDOWFOCUSLOST:
            self._held.clear()

    def read(self) -> Reading:
        """The wanted angle now."""
        return self.reading(
            self.wanted, throttle=float(_LEFT_BUTTON in self._held), brake=float(_RIGHT_BUTTON in self._held)
        )


register("mouse", Mouse)
