"""A force-feedback wheel under Linux, by the package evdev: its axes, and a constant force of finite length.

The force is one effect of the kernel's interface, of type FF_CONSTANT, which lasts ``timeout_ms`` and begins anew where
it is refreshed. A wheel whose program ends, is killed or stopped therefore ends its torque by itself. Its direction is
0x4000, which the kernel calls left; source: include/uapi/linux/input.h, struct ff_effect. Some drivers pull to the
other side: ``reverse``.
"""

import errno
import time
from typing import Any

from steer_env.friction.numerics.extras import install
from steer_env.live.devices.common.commands import BUTTONS
from steer_env.live.devices.common.device import Clock, DeviceError, Reading, pedal, register, wheel_angle
from steer_env.live.devices.common.force_wheel import ForceWheel

_LEFT_DIRECTION = 0x4000
_FULL_GAIN = 0xFFFF
_ALIVE = 0.1  # time after which a wheel that tells nothing is asked whether it is still there [s]
NO_AXIS = "none"


class Evdev(ForceWheel):
    """A wheel of the kernel's input system.

    Parameters
    ----------
    device : str
        Path under /dev/input, or a part of its name; empty for the only one with a constant force.
    steering_axis, throttle_axis, brake_axis : str
        Names of the axes, ``none`` where there is none.
    rest : {"high", "low"}
        Which end of its axis a pedal has that is not pressed.
    degrees, force, timeout_ms, gain, buttons, max_torque, reverse, clock
        As of :class:`ForceWheel`; the wheel's buttons are numbered from 0.
    """

    def __init__(
        self,
        device: str = "",
        degrees: float = 900.0,
        force: bool = True,
        timeout_ms: float = 40.0,
        gain: float = 100.0,
        steering_axis: str = "ABS_X",
        throttle_axis: str = "ABS_Z",
        brake_axis: str = "ABS_RZ",
        rest: str = "high",
        buttons: str = BUTTONS,
        max_torque: float = 2.5,
        reverse: bool = False,
        clock: Clock = time.monotonic_ns,
    ) -> None:
        super().__init__(degrees, force, timeout_ms, gain, buttons, max_torque, reverse, clock)
        if rest not in ("high", "low"):
            raise ValueError(f"rest must be high or low, got {rest!r}")
        self._wanted, self._rest_high = device, rest == "high"
        self._axes = {"steering_axis": steering_axis, "throttle_axis": throttle_axis, "brake_axis": brake_axis}
        self.about = "the wheel (evdev)"

    def _open(self) -> None:
        super()._open()
        try:
            import evdev  # here, because it is an extra
        except ImportError:
            raise DeviceError(
                f"wheels by evdev need Linux and the package evdev: {install('drive')}; elsewhere take device sdl"
            ) from None
        self._evdev, self._codes = evdev, evdev.ecodes
        self._wheel = self._find_device()
        self.about = f"the wheel {self._wheel.name!r} at {self._wheel.path}"
        try:
            self._prepare()
        except DeviceError:
            self._wheel.close()
            raise

    def _prepare(self) -> None:
        abilities = self._wheel.capabilities()
        axes = dict(abilities.get(self._codes.EV_ABS, []))
        self._codes_of = {option: self._axis(option, name, axes) for option, name in self._axes.items()}
        self._range = {code: (info.min, info.max) for code, info in axes.items()}
        self._values = {code: info.value for code, info in axes.items()}
        buttons = sorted(abilities.get(self._codes.EV_KEY, []))
        self._buttons = {code: self._commands[i] for i, code in enumerate(buttons) if i in self._commands}
        self._heard, self._lost = self.clock(), False
        if self.motor:
            self._start(abilities.get(self._codes.EV_FF, []))

    def _find_device(self) -> Any:
        """The device that a person asked for."""
        paths = self._evdev.list_devices()
        if self._wanted.startswith("/"):
            try:
                return self._evdev.InputDevice(self._wanted)
            except OSError as error:
                raise DeviceError(
                    f"{self._wanted} cannot be opened ({error.strerror}): plug the wheel in, and give the user the "
                    f"group 'input'; found: {_list([self._evdev.InputDevice(path) for path in paths])}"
                ) from None
        there = [self._evdev.InputDevice(path) for path in paths]
        listed = _list(there)
        if self._wanted:
            fitting = [device for device in there if self._wanted.lower() in device.name.lower()]
        else:
            fitting = [device for device in there if _has_force(device) or (not self.motor and _has_axes(device))]
        for device in there:
            if device not in fitting or len(fitting) > 1:
                device.close()
        if len(fitting) != 1:
            asked = f"wheel {self._wanted!r}" if self._wanted else f"wheel{' with a constant force' * self.motor}"
            raise DeviceError(
                f"{'more than one' if fitting else 'no'} {asked} is there; found: {listed}. Plug it in, give the user "
                "the group 'input', or choose by device=/dev/input/eventN or device=PART OF ITS NAME"
            )
        return fitting[0]

    def _axis(self, option: str, name: str, axes: dict[int, Any]) -> int | None:
        """Code of an axis; None where there is none."""
        if name == NO_AXIS and option != "steering_axis":
            return None
        code = self._codes.ecodes.get(name)
        if code not in axes:
            known = ", ".join(sorted(_name(self._codes.ABS[axis]) for axis in axes)) or "none"
            raise DeviceError(
                f"{self.about} has no axis {name} for {option}; it has {known}: choose one of them by {option}=NAME, "
                f"or {NO_AXIS} for a pedal that is not there"
            )
        found: int = code
        return found

    def _start(self, forces: list[int]) -> None:
        """Set gain and autocentring, and upload the effect without force."""
        codes, ff = self._codes, self._evdev.ff
        if codes.FF_CONSTANT not in forces:
            raise DeviceError(
                f"{self.about} refuses a constant force, it has none: choose another device, or drive without by "
                "force=false"
            )
        envelope = ff.Envelope(0, 0, 0, 0)
        self._effect = ff.Effect(
            codes.FF_CONSTANT,
            -1,
            _LEFT_DIRECTION,
            ff.Trigger(0, 0),
            ff.Replay(self._length, 0),
            ff.EffectType(ff_constant_effect=ff.Constant(0, envelope)),
        )
        try:
            if codes.FF_AUTOCENTER in forces:
                self._wheel.write(codes.EV_FF, codes.FF_AUTOCENTER, 0)
            if codes.FF_GAIN in forces:
                self._wheel.write(codes.EV_FF, codes.FF_GAIN, round(self._gain / 100.0 * _FULL_GAIN))
            self._wheel.upload_effect(self._effect)
        except OSError as error:
            raise self._error(error) from None

    def _error(self, error: OSError, what: str = "refuses the torque") -> DeviceError:
        """The sentence for an error of the operating system."""
        if error.errno == errno.ENODEV:
            return DeviceError(f"{self.about} was unplugged: plug it in and start again")
        return DeviceError(
            f"{self.about} {what} ({error.strerror}): check its supply, end other programs that use it, and give the "
            "user the right to write to it (group 'input')"
        )

    def read(self) -> Reading:
        """The angle now; the kernel tells only what changes, so that a wheel at rest is asked whether it is there."""
        now = self.clock()
        try:
            self._listen(now)
        except OSError as error:
            raise self._error(error, "cannot be read") from None
        throttle, brake = self._pedal("throttle_axis"), self._pedal("brake_axis")
        return self.reading(self._angle(), throttle=throttle, brake=brake)

    def _listen(self, now: int) -> None:
        try:
            for event in self._wheel.read():
                self._heard = now
                self._take(event)
        except BlockingIOError:
            pass  # nothing has changed
        if self._lost or now - self._heard > 1e9 * _ALIVE:
            for code in self._values:
                self._values[code] = self._wheel.absinfo(code).value
            self._heard, self._lost = now, False

    def _take(self, event: Any) -> None:
        codes = self._codes
        if event.type == codes.EV_ABS and event.code in self._values:
            self._values[event.code] = event.value
        elif event.type == codes.EV_KEY and event.code in self._buttons:
            if event.value:
                self.keys.down(event.code, self._buttons[event.code])
            else:
                self.keys.up(event.code)
        elif event.type == codes.EV_SYN and event.code == codes.SYN_DROPPED:
            self._lost = True  # the kernel's buffer was full, as behind a process that was stopped
            self.keys.release()

    def _angle(self) -> float:
        code = self._codes_of["steering_axis"]
        assert code is not None  # refused where it is opened
        return wheel_angle(self._values[code], *self._range[code], self._degrees)

    def _pedal(self, option: str) -> float:
        code = self._codes_of[option]
        if code is None:
            return 0.0
        low, high = self._range[code]
        return pedal(self._values[code], *((high, low) if self._rest_high else (low, high)))

    def _update(self, level: int) -> None:
        self._effect.u.ff_constant_effect.level = level
        try:
            self._wheel.upload_effect(self._effect)
        except OSError as error:
            raise self._error(error) from None

    def _play(self) -> None:
        try:
            self._wheel.write(self._codes.EV_FF, self._effect.id, 1)
        except OSError as error:
            raise self._error(error) from None

    def _close(self) -> None:
        try:
            if self.motor:
                self._wheel.erase_effect(self._effect.id)
        except OSError:
            pass  # the wheel is gone, and its effects with it
        finally:
            self._wheel.close()


def _has_force(device: Any) -> bool:
    from evdev import ecodes

    return ecodes.FF_CONSTANT in device.capabilities().get(ecodes.EV_FF, [])


def _has_axes(device: Any) -> bool:
    from evdev import ecodes

    return ecodes.ABS_X in dict(device.capabilities().get(ecodes.EV_ABS, []))


def _list(devices: list[Any]) -> str:
    """The devices that were found, and what each can do."""
    from evdev import ecodes

    def told(device: Any) -> str:
        abilities = device.capabilities()
        forces = [_name(ecodes.FF[code]) for code in abilities.get(ecodes.EV_FF, []) if code in ecodes.FF]
        return (
            f"{device.path} {device.name!r} ({len(abilities.get(ecodes.EV_ABS, []))} axes, "
            f"{len(abilities.get(ecodes.EV_KEY, []))} buttons, forces: {', '.join(forces) or 'none'})"
        )

    return "; ".join(map(told, devices)) or "none"


def _name(names: Any) -> str:
    """The first of several names of one code."""
    return str(names if isinstance(names, str) else names[0])


register("evdev", Evdev)
