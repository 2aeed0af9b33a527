"""What keyboard, mouse, gamepad and wheel have in common, whose events the window's thread gets from pygame."""

import time
from typing import Any

from steer_env.friction.numerics.check import whole
from steer_env.friction.numerics.extras import install
from steer_env.live.devices.common.commands import BUTTONS, parse_buttons
from steer_env.live.devices.common.device import Clock, Device, DeviceError, pedal

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
        raise DeviceError(f"{about} needs the package pygame-ce: {install('drive')}") from None
    return pygame


NO_AXIS = -1


class JoystickInput(WindowInput):
    """A joystick of SDL.

    Parameters
    ----------
    device : str
        Its number, or a part of its name; empty for the only one.
    axes : dict of str to int
        Number of the axis by the name of the option: ``steering_axis``, ``throttle_axis``, ``brake_axis``; NO_AXIS
        where there is none.
    rest : float
        What a pedal's axis reads that is not pressed, 1 or -1.
    buttons : str
        As of :func:`steer_env.live.devices.common.commands.parse_buttons`.
    clock : callable
        As of :class:`Device`.
    """

    def __init__(
        self, device: str, axes: dict[str, int], rest: float, buttons: str = BUTTONS, clock: Clock = time.monotonic_ns
    ) -> None:
        super().__init__(clock)
        if rest not in (-1.0, 1.0):
            raise ValueError(f"rest must be 1 or -1, got {rest!r}")
        self._wanted_name, self._rest = str(device), float(rest)
        self._axes = {name: whole(name, number, NO_AXIS) for name, number in axes.items()}
        self._buttons = parse_buttons(buttons)

    def _open(self) -> None:
        super()._open()
        self.pygame.joystick.init()
        found = [self.pygame.joystick.Joystick(i) for i in range(self.pygame.joystick.get_count())]
        self._joystick = choose_named(found, [stick.get_name() for stick in found], self._wanted_name, self.name)
        self.about = f"the {self.name} {self._joystick.get_name()!r}"
        count = self._joystick.get_numaxes()
        for option, axis in self._axes.items():
            if axis >= count:
                raise DeviceError(
                    f"{self.about} has {count} axes, numbered from 0, and none for {option}={axis}: give another one, "
                    f"or {NO_AXIS} where there is none"
                )
        self._values: dict[int, float] = {}  # of axes that have moved; before, SDL does not know where they are
        self._removed = False

    def _feed(self, event: Any) -> None:
        if getattr(event, "instance_id", None) != self._joystick.get_instance_id():
            return
        pygame = self.pygame
        if event.type == pygame.JOYAXISMOTION:
            self._values[event.axis] = event.value
        elif event.type == pygame.JOYBUTTONDOWN and event.button in self._buttons:
            self.keys.down(("button", event.button), self._buttons[event.button])
        elif event.type == pygame.JOYBUTTONUP:
            self.keys.up(("button", event.button))
        elif event.type == pygame.JOYDEVICEREMOVED:
            self._removed = True

    def steering(self) -> float:
        """The steering axis, -1 at the left and 1 at the right, 0 before it moved."""
        return self._values.get(self._axes["steering_axis"], 0.0)

    def pedals(self) -> tuple[float, float]:
        """Throttle and brake, 0 to 1; 0 before they moved.

        Raises
        ------
        DeviceError
            The device was unplugged.
        """
        if self._removed:
            raise DeviceError(f"{self.about} was unplugged: plug it in and start again")
        throttle, brake = (
            pedal(self._values.get(self._axes[name], self._rest), self._rest, -self._rest)
            for name in ("throttle_axis", "brake_axis")
        )
        return throttle, brake


def choose_named(things: list[Any], names: list[str], wanted: str, kind: str) -> Any:
    """The thing that a person asked for by number or part of a name; the only one where nothing was asked for.

    Raises
    ------
    DeviceError
        There is none, or more than one, with those that there are.
    """
    listed = "; ".join(f"{i}: {name}" for i, name in enumerate(names)) or "none"
    fitting = [i for i, name in enumerate(names) if wanted.lower() in name.lower()]
    if wanted.isdecimal():
        fitting = [int(wanted)] if int(wanted) < len(things) else []
    if len(fitting) != 1:
        asked = f" {wanted!r}" if wanted else ""
        what = f"no {kind}{asked} is there" if not fitting else f"more than one {kind}{asked} is there"
        raise DeviceError(f"{what}; found: {listed}. Plug it in, or choose by device=NUMBER or device=PART OF ITS NAME")
    return things[fitting[0]]
