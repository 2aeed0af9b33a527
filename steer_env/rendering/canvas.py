"""A surface for antialiased lines, shapes and text, off screen or in a window, with pygame-ce."""

import math
import os
import warnings
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.numerics.extras import install

Colour = tuple[int, int, int]
Box = tuple[int, int, int, int]  # left, top, width, height

SUPERSAMPLING = 2  # shapes are drawn larger by this factor and scaled down: pygame has no antialiased polygons
_RGB = (0xFF, 0xFF00, 0xFF0000, 0)  # bit masks of red, green and blue in the order of an array's bytes


def _pygame() -> Any:
    """The module pygame; DependencyNotInstalled if there is none."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame  # here, because only pictures need it
    except ImportError as error:
        message = f"render_mode draws with pygame-ce, which is not installed: {install('render')}"
        raise gym.error.DependencyNotInstalled(message) from error
    return pygame


def _font_file(bold: bool) -> str:
    """DejaVu Sans from matplotlib, so that text looks the same on every machine."""
    package = find_spec("matplotlib")
    if package is None or package.origin is None:
        raise gym.error.DependencyNotInstalled("pictures need a font of matplotlib: pip install matplotlib")
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return str(Path(package.origin).parent / "mpl-data" / "fonts" / "ttf" / name)


class NoWindowError(RuntimeError):
    """There is no window system, or it refuses a window; the message says so without the name of what needs it."""


class Canvas:
    """A picture of ``width`` by ``height`` pixels; points are (x, y) from its upper left corner, y downward.

    Shapes are drawn into fields; text lies above all of them. Only :meth:`open` and :meth:`show` need a window
    system. The width must be a multiple of four, otherwise the rows of an array would be padded.
    """

    def __init__(self, width: int, height: int) -> None:
        self._pygame = pygame = _pygame()
        self.width, self.height = width, height
        self._fine = pygame.Surface((SUPERSAMPLING * width, SUPERSAMPLING * height), 0, 32)
        self._picture = pygame.Surface((width, height), 0, 32)
        self._bytes = pygame.Surface((width, height), 0, 24, _RGB)
        self._fields: list[Box] = []
        self._texts: list[tuple[Any, tuple[float, float]]] = []
        self._fonts: dict[tuple[int, bool], Any] = {}
        self._written: dict[tuple[Any, ...], Any] = {}
        self._window: Any = None
        self._clock: Any = None

    def __reduce__(self) -> tuple[type["Canvas"], tuple[int, int]]:
        return Canvas, (self.width, self.height)  # surfaces cannot be pickled; a copy is drawn anew

    def begin(self, colour: Colour) -> None:
        """Begin an empty picture."""
        self._picture.fill(colour)
        self._fields.clear()
        self._texts.clear()

    def panel(self, box: Box, colour: Colour, border: Colour) -> None:
        """A rectangle below all fields."""
        self._picture.fill(colour, box)
        self._pygame.draw.rect(self._picture, border, box, 1)

    def field(self, box: Box, colour: Colour) -> None:
        """Begin a field: all later shapes are clipped to this box."""
        left, top, width, height = (SUPERSAMPLING * value for value in box)
        self._fields.append(box)
        self._fine.set_clip((left, top, width, height))
        self._fine.fill(colour)

    def polygon(self, points: ArrayLike, colour: Colour) -> None:
        """A filled polygon (N, 2)."""
        self._pygame.draw.polygon(self._fine, colour, (SUPERSAMPLING * np.asarray(points)).tolist())

    def lines(self, points: ArrayLike, colour: Colour, width: float = 1.0) -> None:
        """A line through points (N, 2)."""
        points = SUPERSAMPLING * np.asarray(points)
        if len(points) > 1:
            self._pygame.draw.lines(self._fine, colour, False, points.tolist(), max(1, round(SUPERSAMPLING * width)))

    def segments(self, starts: ArrayLike, ends: ArrayLike, colour: Colour, width: float = 1.0) -> None:
        """Straight lines between points (N, 2) each."""
        wide = max(1, round(SUPERSAMPLING * width))
        for start, end in zip(
            (SUPERSAMPLING * np.asarray(starts)).tolist(), (SUPERSAMPLING * np.asarray(ends)).tolist()
        ):
            self._pygame.draw.line(self._fine, colour, start, end, wide)

    def circle(self, centre: Sequence[float], radius: float, colour: Colour, width: float = 0.0) -> None:
        """A circle; filled if the line width is zero. The line lies inside the radius."""
        place = [SUPERSAMPLING * float(value) for value in centre]
        self._pygame.draw.circle(self._fine, colour, place, SUPERSAMPLING * radius, round(SUPERSAMPLING * width))

    def arc(
        self, centre: Sequence[float], radius: float, start: float, end: float, colour: Colour, width: float
    ) -> None:
        """A band around a radius from one angle to another, from twelve o'clock counter-clockwise [rad]."""
        angles = np.linspace(start, end, 2 + int(30.0 * abs(end - start)))
        radii = np.repeat([radius - 0.5 * width, radius + 0.5 * width], angles.size)
        self.polygon(polar_points(centre, radii, np.concatenate([angles, angles[::-1]])), colour)

    def text(
        self, words: str, place: Sequence[float], colour: Colour, size: int = 13, bold: bool = False, align: float = 0.0
    ) -> float:
        """Text at the height of ``place``: to the right of it (align 0), centred (0.5) or to the left of it (1).

        Returns
        -------
        float
            Width of the text.
        """
        image = self._image(words, colour, size, bold)
        width, height = image.get_size()
        self._texts.append((image, (round(place[0] - align * width), round(place[1] - 0.5 * height))))
        return float(width)

    def _image(self, words: str, colour: Colour, size: int, bold: bool) -> Any:
        key = (words, colour, size, bold)
        if key not in self._written:
            if len(self._written) > 500:
                self._written.clear()
            if not self._pygame.font.get_init():  # again after another environment's close() has ended it for all
                self._pygame.font.init()
                self._fonts.clear()
            if (size, bold) not in self._fonts:
                self._fonts[size, bold] = self._pygame.font.Font(_font_file(bold), size)
            self._written[key] = self._fonts[size, bold].render(words, True, colour)
        return self._written[key]

    def _finished(self) -> Any:
        for left, top, width, height in self._fields:
            fine = self._fine.subsurface(
                (SUPERSAMPLING * left, SUPERSAMPLING * top, SUPERSAMPLING * width, SUPERSAMPLING * height)
            )
            part = self._picture.subsurface((left, top, width, height))
            self._pygame.transform.smoothscale(fine, (width, height), part)
        self._picture.blits(self._texts, False)
        return self._picture

    def array(self) -> NDArray[np.uint8]:
        """The picture as (height, width, 3)."""
        self._bytes.blit(self._finished(), (0, 0))
        return np.frombuffer(self._bytes.get_buffer(), np.uint8).reshape(self.height, self.width, 3).copy()

    def open(self, title: str) -> None:
        """Open the window, unless it is open; NoWindowError where there is no window system."""
        pygame = self._pygame
        if self._window is None:
            try:
                pygame.display.init()
                # Without a display SDL draws where nobody sees it, and says nothing.
                if pygame.display.get_driver() == "offscreen" != os.environ.get("SDL_VIDEODRIVER"):
                    pygame.display.quit()
                    raise pygame.error("no display was found")
                self._window = pygame.display.set_mode((self.width, self.height))
            except pygame.error as error:
                raise NoWindowError(f"needs a window, and there is none ({error})") from error
            pygame.display.set_caption(title)
            self._clock = pygame.time.Clock()

    def events(self) -> tuple[list[Any], bool]:
        """The events of pygame since the last call, and whether the user has closed the window."""
        found = self._pygame.event.get()
        return found, any(event.type == self._pygame.QUIT for event in found)

    def pressed(self, event: Any, key: str) -> bool:
        """Whether an event is that a key was pressed, by its name in pygame."""
        return bool(event.type == self._pygame.KEYDOWN and event.key == getattr(self._pygame, f"K_{key}"))

    def fill_screen(self) -> None:
        """Let the open window fill the screen, with the picture scaled; or have its size again."""
        pygame = self._pygame
        full = pygame.SCALED | pygame.FULLSCREEN
        size = (self.width, self.height)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "no fast renderer")  # the processor scales it then
            self._window = pygame.display.set_mode(size, 0 if self._window.get_flags() & pygame.FULLSCREEN else full)

    def flip(self, period: float) -> None:
        """Show the picture in the open window, at least ``period`` [s] after the last."""
        self._clock.tick(1.0 / period)
        self._window.blit(self._finished(), (0, 0))
        self._pygame.display.flip()

    def show(self, title: str, period: float) -> bool:
        """Show the picture in a window, ``period`` [s] after the last; False once there is no window.

        The user may have closed it. Without a window system a warning says so, as Gymnasium's own environments draw
        where nobody sees it.
        """
        try:
            self.open(title)
        except NoWindowError as error:
            gym.logger.warn(f"render_mode='human' {error}: nothing is shown; use render_mode='rgb_array'")
            return False
        if self.events()[1]:
            self.close()
            return False
        self.flip(period)
        return True

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window = None
            self._pygame.display.quit()


def polar_points(centre: Sequence[float], radius: ArrayLike, angle: ArrayLike) -> NDArray[np.float64]:
    """Points (N, 2) at radii from a centre and at angles from twelve o'clock, counter-clockwise [rad]."""
    angle = np.asarray(angle, float)
    return np.asarray(centre, float) - (np.array([np.sin(angle), np.cos(angle)]) * np.asarray(radius, float)).T


def nice_step(span: float, parts: float) -> float:
    """The largest 1, 2 or 5 times a power of ten that divides a span into at least ``parts`` parts."""
    rough = span / parts
    power = 10.0 ** math.floor(math.log10(rough))
    return next(power * factor for factor in (5.0, 2.0, 1.0) if power * factor <= rough * (1.0 + 1e-9))


def mix(a: Colour, b: Colour, part: float) -> Colour:
    """A mixture of two colours; ``part`` is the share of the second."""
    red, green, blue = (round(x + part * (y - x)) for x, y in zip(a, b))
    return red, green, blue
