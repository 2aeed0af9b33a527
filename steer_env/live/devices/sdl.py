"""A force-feedback wheel by SDL's joystick and haptic interfaces, with the package PySDL2, where there is no evdev.

The force is one effect SDL_HAPTIC_CONSTANT of finite length, which begins anew where it is refreshed, so that a wheel
whose program ends, is killed or stopped ends its torque by itself. PySDL2 brings a library of SDL of its own, beside
that of pygame in the same process; neither sees the other's joysticks, events or errors.
"""

import time
import warnings
from typing import Any

from steer_env.friction.numerics.check import whole
from steer_env.friction.numerics.extras import install
from steer_env.live.devices.common.commands import BUTTONS
from steer_env.live.devices.common.device import Clock, DeviceError, Reading, pedal, register, wheel_angle
from steer_env.live.devices.common.force_wheel import ForceWheel
from steer_env.live.devices.common.window_input import NO_AXIS, choose_named

_END = 32767  # of an axis


class Sdl(ForceWheel):
    """A wheel of SDL.

    Parameters
    ----------
    device : str
        Its number, or a part of its name; empty for the only one.
    steering_axis, throttle_axis, brake_axis : int
        Numbers of the axes from 0, -1 where there is none.
    rest : float
        What a pedal's axis reads that is not pressed, 1 or -1.
    degrees, force, timeout_ms, gain, buttons, max_torque, reverse, clock
        As of :class:`ForceWheel`.
    """

    def __init__(
        self,
        device: str = "",
        degrees: float = 900.0,
        force: bool = True,
        timeout_ms: float = 40.0,
        gain: float = 100.0,
        steering_axis: int = 0,
        throttle_axis: int = 2,
        brake_axis: int = 3,
        rest: float = 1.0,
        buttons: str = BUTTONS,
        max_torque: float = 2.5,
        reverse: bool = False,
        clock: Clock = time.monotonic_ns,
    ) -> None:
        super().__init__(degrees, force, timeout_ms, gain, buttons, max_torque, reverse, clock)
        if rest not in (-1.0, 1.0):
            raise ValueError(f"rest must be 1 or -1, got {rest!r}")
        self._wanted, self._rest = str(device), rest
        axes = {"steering_axis": steering_axis, "throttle_axis": throttle_axis, "brake_axis": brake_axis}
        self._axes = {name: whole(name, axis, NO_AXIS) for name, axis in axes.items()}
        self.about = "the wheel (SDL)"

    def _open(self) -> None:
        super()._open()
        self._sdl = _sdl_or_error()
        if self._sdl.SDL_InitSubSystem(_systems(self._sdl)) != 0:
            raise DeviceError(f"SDL cannot look for wheels ({self._last_error()}): take another device")
        try:
            self._find()
            if self.motor:
                self._start()
        except DeviceError:
            self._sdl.SDL_QuitSubSystem(_systems(self._sdl))
            raise

    def _last_error(self) -> str:
        """What SDL told last."""
        return str(self._sdl.SDL_GetError().decode(errors="replace")) or "it told no reason"

    def _find(self) -> None:
        sdl = self._sdl
        sdl.SDL_JoystickUpdate()
        names = [(sdl.SDL_JoystickNameForIndex(i) or b"without a name").decode() for i in range(sdl.SDL_NumJoysticks())]
        index = choose_named(list(range(len(names))), names, self._wanted, "wheel")
        self.about = f"the wheel {names[index]!r}"
        self._joystick = sdl.SDL_JoystickOpen(index)
        if not self._joystick:
            raise DeviceError(f"{self.about} cannot be opened ({self._last_error()}): plug it in again")
        count = sdl.SDL_JoystickNumAxes(self._joystick)
        for option, axis in self._axes.items():
            if axis >= count or (axis == NO_AXIS and option == "steering_axis"):
                raise DeviceError(
                    f"{self.about} has {count} axes, numbered from 0, and none for {option}={axis}: give another one, "
                    f"or {NO_AXIS} for a pedal that is not there"
                )
        self._down = {i: False for i in self._commands if i < sdl.SDL_JoystickNumButtons(self._joystick)}

    def _start(self) -> None:
        """Set gain and autocentring, and upload the effect without force."""
        sdl = self._sdl
        self._haptic = sdl.SDL_HapticOpenFromJoystick(self._joystick)
        abilities = sdl.SDL_HapticQuery(self._haptic) if self._haptic else 0
        if not abilities & sdl.SDL_HAPTIC_CONSTANT:
            raise DeviceError(
                f"{self.about} refuses a constant force, it has none ({self._last_error()}): choose another device, or "
                "drive without by force=false"
            )
        if abilities & sdl.SDL_HAPTIC_AUTOCENTER:
            sdl.SDL_HapticSetAutocenter(self._haptic, 0)
        if abilities & sdl.SDL_HAPTIC_GAIN:
            sdl.SDL_HapticSetGain(self._haptic, round(self._gain))
        self._force = sdl.SDL_HapticEffect()
        self._force.type = sdl.SDL_HAPTIC_CONSTANT
        constant = self._force.constant
        constant.direction.type = sdl.SDL_HAPTIC_STEERING_AXIS
        constant.length = self._length
        self._effect = sdl.SDL_HapticNewEffect(self._haptic, self._force)
        if self._effect < 0:
            raise self._refused()

    def _refused(self) -> DeviceError:
        return DeviceError(
            f"{self.about} refuses the torque ({self._last_error()}): check its supply, and end other programs "
            "that use it"
        )

    def _axis(self, option: str) -> float:
        """An axis, -1 to 1."""
        return max(self._sdl.SDL_JoystickGetAxis(self._joystick, self._axes[option]) / _END, -1.0)

    def _pedal(self, option: str) -> float:
        return 0.0 if self._axes[option] == NO_AXIS else pedal(self._axis(option), self._rest, -self._rest)

    def _angle(self) -> float:
        return wheel_angle(self._axis("steering_axis"), -1.0, 1.0, self._degrees)

    def read(self) -> Reading:
        """The angle now."""
        self._sdl.SDL_JoystickUpdate()
        if not self._sdl.SDL_JoystickGetAttached(self._joystick):
            raise DeviceError(f"{self.about} was unplugged: plug it in and start again")
        for button, was in self._down.items():
            self._down[button] = down = bool(self._sdl.SDL_JoystickGetButton(self._joystick, button))
            if down and not was:
                self.keys.down(("button", button), self._commands[button])
            elif was and not down:
                self.keys.up(("button", button))
        throttle, brake = self._pedal("throttle_axis"), self._pedal("brake_axis")
        return self.reading(self._angle(), throttle=throttle, brake=brake)

    def _update(self, level: int) -> None:
        self._force.constant.level = level
        if self._sdl.SDL_HapticUpdateEffect(self._haptic, self._effect, self._force) != 0:
            raise self._refused()

    def _play(self) -> None:
        if self._sdl.SDL_HapticRunEffect(self._haptic, self._effect, 1) != 0:
            raise self._refused()

    def _close(self) -> None:
        if self.motor:
            self._sdl.SDL_HapticDestroyEffect(self._haptic, self._effect)
            self._sdl.SDL_HapticClose(self._haptic)
        self._sdl.SDL_JoystickClose(self._joystick)
        self._sdl.SDL_QuitSubSystem(_systems(self._sdl))


def _systems(sdl: Any) -> int:
    """The parts of SDL that are used."""
    return int(sdl.SDL_INIT_JOYSTICK | sdl.SDL_INIT_HAPTIC)


def _sdl_or_error() -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it tells which library it has found
            import sdl2  # here, because it is an extra
    except ImportError:
        raise DeviceError(f"wheels by SDL need the packages PySDL2 and pysdl2-dll: {install('drive')}") from None
    sdl2.SDL_SetHint(sdl2.SDL_HINT_JOYSTICK_ALLOW_BACKGROUND_EVENTS, b"1")  # its window would be another one
    return sdl2


register("sdl", Sdl)
