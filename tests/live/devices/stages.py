"""Every device with a fake of what is below it: the kernel, SDL's joysticks, a bus.

A stage turns the wheel, tells what the motor got, unplugs it and lets time pass, in simulated time. It reads bytes as
the kernel's headers and the DBC define them, without the libraries that the devices use.
"""

import ctypes
import errno
import math
import re
import struct
from pathlib import Path

import pytest

from steer_env.live import devices

MS = 1_000_000  # [ns]
DEGREES, TIMEOUT = 900.0, 40  # of every wheel [deg], [ms]


class Clock:
    """A clock that moves when it is told to."""

    def __init__(self):
        self.now = 10**12

    def __call__(self):
        return self.now


class Stage:
    """A device and what is below it; subclasses say how."""

    name = ""
    motor = True
    step = math.radians(0.03)  # of its sensor, and a little

    def __init__(self, patch, folder):
        self.clock, self.patch, self.folder = Clock(), patch, folder

    def make(self, **options):
        return devices.make(self.name, clock=self.clock, **options)

    def wait(self, ms):
        self.clock.now += ms * MS


class FakeStage(Stage):
    name = "fake"

    def make(self, **options):
        self.device = super().make(person="straight", delay_ms=0.0, friction=0.0, **options)
        return self.device

    def turn(self, angle):
        self.wait(2)
        wheel = self.device.wheel
        wheel.advance(self.clock.now)
        wheel.angle, wheel.speed = angle, 0.0
        wheel._past[-1] = angle

    def torque(self):
        self.device.wheel.advance(self.clock.now)
        return self.device.wheel.motor

    def unplug(self):
        self.device.inject("unplug")

    def refuse(self):
        self.device.inject("refuse")


class Kernel:
    """/dev/input as the package evdev sees it: axes, and one memory for effects, of which the newest one acts."""

    path, name = "/dev/input/event7", "Example Wheel"
    forces = (0x52, 0x60, 0x61)  # FF_CONSTANT, FF_GAIN, FF_AUTOCENTER

    def __init__(self, clock):
        self.clock = clock
        self.value, self.pedals = 32768, {2: 255, 5: 255}
        self.error, self.events = None, []
        self.effect, self.played = None, None

    def capabilities(self):
        from evdev import AbsInfo

        axes = [(0, AbsInfo(self.value, 0, 65535, 0, 0, 0))]
        axes += [(code, AbsInfo(value, 0, 255, 0, 0, 0)) for code, value in self.pedals.items()]
        return {1: [288, 289, 290, 291], 3: axes, 21: list(self.forces)}

    def _check(self):
        if self.error:
            raise OSError(self.error, "as the kernel says")

    def absinfo(self, code):
        self._check()
        return dict(self.capabilities()[3])[code]

    def read(self):
        from evdev import InputEvent

        self._check()
        if not self.events:
            raise BlockingIOError
        taken, self.events = self.events, []
        return iter([InputEvent(0, 0, *event) for event in taken])

    def upload_effect(self, effect):
        self._check()
        self.effect = memoryview(effect).tobytes()
        effect.id = 3
        return 3

    def write(self, kind, code, value):
        self._check()
        if (kind, code, value) == (21, 3, 1):
            self.played = self.clock.now

    def erase_effect(self, number):
        self._check()
        assert number == 3
        self.effect = None

    def close(self):
        """Nothing holds the file."""

    def level(self):
        """Share of the full force to the left that acts now, by struct ff_effect of linux/input.h."""
        if self.effect is None or self.played is None:
            return 0.0
        kind, _, direction, _, _, length, delay = struct.unpack_from("<HhHHHHH", self.effect)
        (level,) = struct.unpack_from("<h", self.effect, 16)
        assert (kind, delay) == (0x52, 0)
        if not 0 < length <= 1000 or self.clock.now - self.played > length * MS:
            assert length, "a force without an end"
            return 0.0
        return level / 32767 * math.sin(2.0 * math.pi * direction / 65536)  # 0x4000 is left


class EvdevStage(Stage):
    name = "evdev"

    def __init__(self, patch, folder):
        super().__init__(patch, folder)
        self.kernel = Kernel(self.clock)
        patch.setattr("evdev.list_devices", lambda: [self.kernel.path])
        patch.setattr("evdev.InputDevice", self._open)

    def _open(self, path):
        if path != self.kernel.path:
            raise FileNotFoundError(errno.ENOENT, "No such file or directory")
        return self.kernel

    def make(self, max_torque=8.0, **options):
        self.most = max_torque
        return super().make(max_torque=max_torque, **options)

    def turn(self, angle):
        self.wait(2)
        self.kernel.value = round(65535 * (0.5 - angle / math.radians(DEGREES)))  # right is high
        self.kernel.events.append((3, 0, self.kernel.value))

    def torque(self):
        return self.most * self.kernel.level()

    def unplug(self):
        self.kernel.error = errno.ENODEV
        self.kernel.effect = None

    def refuse(self):
        self.patch.setattr(self.kernel, "upload_effect", self._refused)

    def _refused(self, effect):
        raise OSError(errno.EPERM, "Operation not permitted")


class SdlStage(Stage):
    """A virtual joystick of the library that PySDL2 brings; its force, which virtual ones have not, is recorded."""

    name = "sdl"

    def __init__(self, patch, folder):
        super().__init__(patch, folder)
        with (
            pytest.warns(UserWarning, match="Using SDL2 binaries")
            if "sdl2" not in __import__("sys").modules
            else (__import__("contextlib").nullcontext())
        ):
            import sdl2

        self.sdl, self.code, self.played, self.constant = sdl2, 0, None, None
        assert sdl2.SDL_InitSubSystem(sdl2.SDL_INIT_JOYSTICK) == 0
        self.index = sdl2.SDL_JoystickAttachVirtual(sdl2.SDL_JOYSTICK_TYPE_WHEEL, 4, 6, 0)
        self.handle = sdl2.SDL_JoystickOpen(self.index)
        for pedal in (2, 3):
            sdl2.SDL_JoystickSetVirtualAxis(self.handle, pedal, 32767)
        self.abilities = sdl2.SDL_HAPTIC_CONSTANT | sdl2.SDL_HAPTIC_GAIN
        for name, function in {
            "OpenFromJoystick": lambda joystick: 1,
            "Query": lambda haptic: self.abilities,
            "SetGain": lambda haptic, gain: 0,
            "NewEffect": self._update,
            "UpdateEffect": lambda haptic, number, effect: self._update(haptic, effect),
            "RunEffect": self._run,
            "DestroyEffect": lambda haptic, number: setattr(self, "constant", None),
            "Close": lambda haptic: None,
        }.items():
            patch.setattr(sdl2, f"SDL_Haptic{name}", function)

    def close(self):
        self.sdl.SDL_JoystickClose(self.handle)
        if self.code != "unplugged":
            self.sdl.SDL_JoystickDetachVirtual(self.index)
        self.sdl.SDL_QuitSubSystem(self.sdl.SDL_INIT_JOYSTICK)

    def _update(self, haptic, effect):
        constant = effect.constant
        self.constant = effect.type, constant.direction.type, constant.length, constant.level
        return self.code if isinstance(self.code, int) else -1

    def _run(self, haptic, number, times):
        self.played = self.clock.now
        return 0 if self.code == 0 else -1

    def make(self, max_torque=8.0, **options):
        self.most = max_torque
        return super().make(max_torque=max_torque, **options)

    def turn(self, angle):
        self.wait(2)
        value = round(-32767 * angle / math.radians(DEGREES / 2))
        assert self.sdl.SDL_JoystickSetVirtualAxis(self.handle, 0, value) == 0

    def torque(self):
        if self.constant is None or self.played is None:
            return 0.0
        kind, direction, length, level = self.constant
        assert (kind, direction) == (1, 3)  # SDL_HAPTIC_CONSTANT, SDL_HAPTIC_STEERING_AXIS
        assert 0 < length <= 1000
        return self.most * level / 32767 if self.clock.now - self.played <= length * MS else 0.0

    def unplug(self):
        self.sdl.SDL_JoystickDetachVirtual(self.index)
        self.code = "unplugged"

    def refuse(self):
        self.code = -1


DBC = """VERSION ""
NS_ :
BS_:
BU_: Wheel Host
BO_ 256 WHEEL: 8 Wheel
 SG_ ANGLE : 0|16@1- (0.02,0) [-655|655] "deg" Host
 SG_ SPEED : 16|16@1- (0.1,0) [-3276|3276] "deg/s" Host
 SG_ THROTTLE : 32|8@1+ (0.5,0) [0|100] "%" Host
 SG_ BRAKE : 40|8@1+ (0.5,0) [0|100] "%" Host
 SG_ COUNT : 48|4@1+ (1,0) [0|15] "" Host
BO_ 512 MOTOR: 4 Host
 SG_ TORQUE : 0|16@1- (0.001,0) [-20|20] "Nm" Wheel
 SG_ COUNT : 16|4@1+ (1,0) [0|15] "" Wheel
 SG_ ENABLE : 20|1@1+ (1,0) [0|1] "" Wheel
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 512 2;
"""


class CanStage(Stage):
    """A node on a bus of python-can, which ends its torque where no frame arrives."""

    name = "can"
    interface, channel = "virtual", "stage"

    def __init__(self, patch, folder):
        super().__init__(patch, folder)
        import can

        self.can = can
        self.bus = can.Bus(interface=self.interface, channel=self.channel)
        self.frames, self.arrived, self.count = [], None, 0
        (folder / "wheel.dbc").write_text(DBC)

    def close(self):
        self.bus.shutdown()

    def make(self, **options):
        given = {"dbc": str(self.folder / "wheel.dbc"), "interface": self.interface, "channel": self.channel}
        return super().make(**given | {"max_torque": 8.0} | options)

    def turn(self, angle, speed=0.0, throttle=0.0, brake=0.0, count=None):
        self.wait(2)
        self.count = (self.count + 1) % 16 if count is None else count
        raw = round(math.degrees(angle) / 0.02), round(math.degrees(speed) / 0.1), round(200 * throttle)
        data = struct.pack("<hhBBBB", *raw, round(200 * brake), self.count, 0)
        self.bus.send(self.can.Message(arbitration_id=256, data=data, is_extended_id=False))

    def torque(self):
        while (frame := self.bus.recv(0.0)) is not None:
            if frame.arbitration_id == 512:
                self.frames.append(bytes(frame.data))
                self.arrived = self.clock.now
        if self.arrived is None or self.clock.now - self.arrived > TIMEOUT * MS:
            return 0.0
        return 0.001 * struct.unpack_from("<h", self.frames[-1])[0]

    def unplug(self):
        """The interface goes down under the device."""
        self.patch.setattr("can.interfaces.virtual.VirtualBus.send", self._fails)
        self.patch.setattr("can.interfaces.virtual.VirtualBus._recv_internal", self._fails)

    def _fails(self, *given, **options):
        raise self.can.CanOperationError("Network is down")

    def refuse(self):
        self.patch.setattr("can.interfaces.virtual.VirtualBus.send", self._fails)


def pygame_sdl():
    """The library of SDL that pygame has loaded, which can attach virtual joysticks."""
    found = re.findall(r"(/\S*pygame\S*libSDL2-\S+)", Path("/proc/self/maps").read_text(encoding="utf-8"))
    return ctypes.CDLL(found[0]) if found else None


class JoystickStage(Stage):
    """A virtual joystick of pygame's SDL, whose events pygame gives."""

    motor = False
    axes = 6

    def __init__(self, patch, folder):
        super().__init__(patch, folder)
        patch.setenv("SDL_VIDEODRIVER", "dummy")
        import pygame

        self.pygame = pygame
        pygame.display.init()
        pygame.joystick.init()
        self.sdl = pygame_sdl()
        self.sdl.SDL_JoystickOpen.restype = ctypes.c_void_p
        self.index = self.sdl.SDL_JoystickAttachVirtual(1, self.axes, 6, 0)
        if self.index < 0:
            pytest.skip("this SDL has no virtual joysticks")
        self.handle = ctypes.c_void_p(self.sdl.SDL_JoystickOpen(self.index))
        self.there = True

    def close(self):
        self.sdl.SDL_JoystickClose(self.handle)
        if self.there:
            self.sdl.SDL_JoystickDetachVirtual(self.index)
        self.pygame.quit()

    def make(self, **options):
        self.device = super().make(**options)
        return self.device

    def axis(self, number, value):
        self.sdl.SDL_JoystickSetVirtualAxis(self.handle, number, round(32767 * value))
        self.pump()

    def pump(self):
        self.sdl.SDL_JoystickUpdate()
        self.device.feed(self.pygame.event.get())

    def unplug(self):
        self.sdl.SDL_JoystickDetachVirtual(self.index)
        self.there = False
        self.pump()


class WheelStage(JoystickStage):
    name = "wheel"

    def turn(self, angle):
        self.axis(0, -angle / math.radians(DEGREES / 2))


class GamepadStage(JoystickStage):
    name = "gamepad"

    def make(self, **options):
        return super().make(range_deg=DEGREES / 2, exponent=1.0, rate_deg=5000.0, **options)

    def turn(self, angle):
        self.axis(0, -angle / math.radians(DEGREES / 2))
        self.wait(100)


class EventStage(Stage):
    """A device of pygame that needs no joystick."""

    motor = False

    def __init__(self, patch, folder):
        super().__init__(patch, folder)
        patch.setenv("SDL_VIDEODRIVER", "dummy")
        import pygame

        self.pygame = pygame

    def make(self, **options):
        self.device = super().make(**options)
        return self.device

    def event(self, kind, **content):
        self.device.feed([self.pygame.event.Event(kind, **content)])


class MouseStage(EventStage):
    name = "mouse"

    def make(self, **options):
        return super().make(deg_per_pixel=0.02, range_deg=DEGREES / 2, **options)

    def turn(self, angle):
        pixels = -round(math.degrees(angle - self.device.wanted) / 0.02)  # right is positive
        self.event(self.pygame.MOUSEMOTION, rel=(pixels, 0), pos=(0, 0), buttons=(0, 0, 0))


class KeyboardStage(EventStage):
    name = "keyboard"

    def make(self, **options):
        return super().make(rate_deg=100.0, range_deg=DEGREES / 2, return_deg=0.0, **options)

    def turn(self, angle):
        change = angle - self.device.wanted
        key = self.pygame.K_LEFT if change > 0.0 else self.pygame.K_RIGHT
        self.device.read()
        self.event(self.pygame.KEYDOWN, key=key)
        for _ in range(50):
            self.clock.now += round(abs(math.degrees(change)) / 100.0 / 50 * 1e9)
            self.last = self.device.read()
        self.event(self.pygame.KEYUP, key=key)


STAGES = {
    stage.name: stage
    for stage in (
        FakeStage,
        EvdevStage,
        SdlStage,
        CanStage,
        WheelStage,
        GamepadStage,
        MouseStage,
        KeyboardStage,
    )
}
