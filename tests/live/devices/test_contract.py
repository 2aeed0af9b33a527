"""What every device keeps: options, signs, units, an end of the torque, and what it says when it fails."""

import math

import pytest

from steer_env.live import devices
from steer_env.live.devices import COMMANDS, DeviceError
from tests.live.devices.stages import STAGES, TIMEOUT
from tests.needs import needs

pytestmark = needs("can", "evdev", "pygame", "sdl2")

MOTORS = [name for name, stage in STAGES.items() if stage.motor]
GO = [name for name in STAGES if name not in ("mouse", "keyboard")]  # what can be unplugged


@pytest.fixture
def stage(request, monkeypatch, tmp_path):
    """A device and what is below it."""
    made = STAGES[request.param](monkeypatch, tmp_path)
    yield made
    monkeypatch.undo()
    if hasattr(made, "close"):
        made.close()


every = pytest.mark.parametrize("stage", STAGES, indirect=True)
with_motor = pytest.mark.parametrize("stage", MOTORS, indirect=True)


def test_every_device_is_here():
    assert set(STAGES) == set(devices.available())


@pytest.mark.parametrize("name", devices.available())
def test_every_option_has_a_default_and_a_name_that_is_told(name):
    known = devices.options(name)
    assert "clock" not in known
    device = devices.make(name)
    assert device.name == name
    assert device.hands in ("angle", "torque")
    assert device.about
    with pytest.raises(ValueError, match=f"the device {name} has no option 'colour'; it has "):
        devices.make(name, colour="red")


def test_unknown_devices_are_told():
    with pytest.raises(ValueError, match=r"unknown device 'hovercraft'; available: .*fake, .*keyboard"):
        devices.make("hovercraft")


def test_options_are_taken_as_text():
    made = devices.make("fake", max_torque="3.5", bits="14")
    assert made.max_torque == 3.5
    with pytest.raises(ValueError, match="max_torque must be a number, got 'much'"):
        devices.make("fake", max_torque="much")
    with pytest.raises(ValueError, match="bits must be"):
        devices.make("fake", bits="14.5")


@every
def test_left_is_positive_and_in_radians(stage):
    with stage.make() as device:
        for angle in (0.5, -0.5):
            stage.turn(angle)
            reading = device.read()
            assert reading.angle == pytest.approx(angle, abs=1e-3)
            assert reading.stamp == stage.clock.now
            assert math.isnan(reading.speed) or stage.name == "can"


@every
def test_recentre_goes_slowly_where_a_motor_follows(stage):
    with stage.make() as device:
        stage.turn(0.3)
        device.read()
        device.recentre()
        if device.hands == "torque":  # what a person wants begins anew, but for a stick, which is turned
            stage.turn(0.2)
            assert device.read().angle == pytest.approx(0.2, abs=1e-3)
            return
        angles = []
        for _ in range(500):
            stage.turn(0.3)
            stage.wait(2)
            angles.append(device.read().angle)
        assert max(before - after for before, after in zip([0.3, *angles], angles)) < 0.003
        assert angles[-1] == pytest.approx(0.0, abs=1e-3)
        stage.turn(0.2)
        assert device.read().angle == pytest.approx(-0.1, abs=1e-3)


@with_motor
def test_positive_torque_pushes_left_in_newton_metres(stage):
    with stage.make() as device:
        for torque in (2.0, -3.0, 8.0, 0.0):
            stage.wait(20)
            device.write(torque)
            stage.wait(1)
            assert stage.torque() == pytest.approx(torque, abs=1e-3)


@pytest.mark.parametrize("stage", ["evdev", "sdl", "can"], indirect=True)
def test_reverse_is_for_motors_that_pull_to_the_other_side(stage):
    with stage.make(reverse=True) as device:
        device.write(2.0)
        assert stage.torque() == pytest.approx(-2.0, abs=1e-3)


@with_motor
def test_a_torque_that_is_written_again_lasts_and_one_that_is_not_ends(stage):
    with stage.make() as device:
        for _ in range(150):
            stage.wait(2)
            device.write(3.0)
        assert stage.torque() == pytest.approx(3.0, abs=1e-3)
        for _ in range(150):  # refreshed also where it does not change
            stage.wait(2)
            device.write(3.0)
            assert stage.torque() == pytest.approx(3.0, abs=1e-3)
        stage.wait(TIMEOUT + 2)
        assert stage.torque() == 0.0


@with_motor
def test_the_end_of_the_block_ends_the_torque(stage):
    with stage.make() as device:
        stage.wait(2)
        device.write(3.0)
    assert stage.torque() == 0.0


@pytest.mark.parametrize("stage", ["fake", "evdev", "can"], indirect=True)
def test_a_device_opens_again(stage):
    device = stage.make()
    for _ in range(2):
        with device:
            stage.turn(0.2)
            assert device.read().angle == pytest.approx(0.2, abs=1e-3)
            stage.wait(2)
            device.write(3.0)
            stage.wait(1)
            assert stage.torque() == pytest.approx(3.0, abs=1e-3)
        assert stage.torque() == 0.0


@with_motor
def test_more_than_the_motor_has_is_clipped_and_counted(stage):
    with stage.make(max_torque=2.0) as device:
        for torque in (1.0, 5.0, -5.0, 0.5):
            stage.wait(10)
            device.write(torque)
            stage.wait(1)
            assert stage.torque() == pytest.approx(max(-2.0, min(torque, 2.0)), abs=1e-3)
        assert device.clipping() == 0.5


@with_motor
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_torque_that_is_no_number_ends_it(stage, value):
    with stage.make() as device:
        device.write(3.0)
        stage.wait(20)
        with pytest.raises(DeviceError, match="is no number, so that the motor got none"):
            device.write(value)
        stage.wait(1)
        assert stage.torque() == 0.0


@pytest.mark.parametrize("stage", GO, indirect=True)
def test_an_unplugged_device_says_so_and_closes(stage):
    with stage.make() as device:
        stage.turn(0.1)
        device.read()
        device.write(1.0)
        stage.unplug()
        stage.wait(20)
        with pytest.raises(DeviceError, match=r"(was unplugged: plug it in|is down .*: check cable).* start again"):
            device.read()
        if stage.motor and stage.name != "sdl":  # whose force is the stage's own
            with pytest.raises(DeviceError, match=r"was unplugged|is down"):
                device.write(2.0)
        stage.wait(TIMEOUT)
        if stage.motor and stage.name != "can":  # what the bus does not carry ends by the node's timeout
            assert stage.torque() == 0.0


@with_motor
def test_a_motor_that_refuses_says_so(stage):
    with stage.make() as device:
        device.write(1.0)
        stage.wait(2)
        stage.refuse()
        stage.wait(20)
        with pytest.raises(DeviceError, match=r"refuses the torque.*: check its supply|is down .*: check cable"):
            device.write(2.0)


@every
def test_commands_come_from_the_keyboard_beside_every_device(stage):
    import pygame

    with stage.make() as device:
        press = [pygame.event.Event(pygame.KEYDOWN, key=key) for key in (pygame.K_TAB, pygame.K_7, pygame.K_SPACE)]
        stage.turn(0.1)
        device.feed(press)
        stage.wait(2)
        if stage.name == "can":
            stage.turn(0.1)
        reading = device.read()
        assert reading.pressed == {"swap", "set_7"} <= set(COMMANDS)
        assert reading.dead_man
        stage.wait(300)  # the window hangs meanwhile
        if stage.name == "can":
            stage.turn(0.1)
        assert device.read().dead_man == (stage.name == "fake")
        device.feed([])
        stage.turn(0.1)
        assert device.read().dead_man
        device.feed([pygame.event.Event(pygame.WINDOWFOCUSLOST)])
        stage.turn(0.2)
        reading = device.read()
        assert not reading.pressed  # told once
        assert reading.dead_man == (stage.name == "fake")  # whose person holds it always


@pytest.mark.parametrize("stage", ["wheel", "gamepad", "sdl", "evdev"], indirect=True)
def test_a_missing_axis_is_told_with_those_that_there_are(stage):
    missing = "ABS_WHEEL" if stage.name == "evdev" else 17
    message = r"has no axis ABS_WHEEL for brake_axis; it has ABS_RZ, ABS_X, ABS_Z"
    with (
        pytest.raises(DeviceError, match=message if stage.name == "evdev" else r"axes, .*none for brake_axis=17"),
        stage.make(brake_axis=missing),
    ):
        pass


@pytest.mark.parametrize("stage", ["wheel", "gamepad", "sdl", "evdev"], indirect=True)
def test_no_such_device_is_told_with_those_that_there_are(stage):
    with pytest.raises(DeviceError, match=r"no (wheel|gamepad) 'Batmobile' is there; found: ") as caught:
        stage.make(device="Batmobile").__enter__()
    assert "Example Wheel" in str(caught.value) or "0: " in str(caught.value)


@pytest.mark.parametrize("stage", ["evdev", "sdl"], indirect=True)
def test_a_device_without_force_is_refused_or_driven_without(stage):
    if stage.name == "evdev":
        stage.kernel.forces = (0x50,)
        device = stage.make(device="example")
    else:
        stage.abilities = 0
        device = stage.make()
    with pytest.raises(DeviceError, match=r"refuses a constant force, it has none.*force=false"):
        device.__enter__()
    with stage.make(force="false") as device:
        stage.turn(0.3)
        assert device.read().angle == pytest.approx(0.3, abs=0.02)
        device.write(3.0)
        assert stage.torque() == 0.0


PACKAGES = {"evdev": "evdev", "sdl": "sdl2", "can": "cantools", "keyboard": "pygame", "gamepad": "pygame"}


@pytest.mark.parametrize("name", PACKAGES)
def test_a_package_that_is_not_installed_is_named(name, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, PACKAGES[name], None)
    with pytest.raises(DeviceError, match=r"need.*pip install '\.\[drive\]'"):
        devices.make(name).__enter__()


def test_both_libraries_of_sdl_live_in_one_process(monkeypatch, tmp_path):
    """That of pygame and that of PySDL2, each with a wheel of its own, which the other does not see."""
    stages = [STAGES[name](monkeypatch, tmp_path) for name in ("wheel", "sdl")]
    try:
        with stages[0].make() as one, stages[1].make() as other:
            for angle in (0.3, -0.2):
                stages[0].turn(angle)
                stages[1].turn(-angle)
                assert one.read().angle == pytest.approx(angle, abs=1e-3)
                assert other.read().angle == pytest.approx(-angle, abs=1e-3)
            other.write(2.0)
            stages[0].unplug()
            assert stages[1].torque() == pytest.approx(2.0, abs=1e-3)
            assert other.read() is not None
            with pytest.raises(DeviceError, match="was unplugged"):
                one.read()
    finally:
        monkeypatch.undo()
        for made in reversed(stages):
            made.close()


@pytest.mark.parametrize("stage", ["mouse"], indirect=True)
def test_the_window_holds_the_mouse(stage):
    pygame = stage.pygame
    pygame.display.init()
    try:
        with stage.make():
            stage.turn(0.1)
            assert not pygame.mouse.get_relative_mode()  # there is no window
            pygame.display.set_mode((100, 100))
            stage.turn(0.2)
            assert pygame.mouse.get_relative_mode()
    finally:
        pygame.display.quit()
