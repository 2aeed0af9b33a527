"""Drives in real time with the fake wheel: what a person presses, and what goes wrong. No time is judged here."""

import contextlib
import errno
import math
import os
import sys
import threading
import time
from typing import ClassVar

import numpy as np
import pytest

from steer_env.live.devices import DeviceError, make
from steer_env.live.devices.fake import Fake
from steer_env.live.devices.keyboard import Keyboard
from steer_env.live.drive.hands import car_configuration
from steer_env.live.drive.session import Options, Session
from steer_env.recording import files
from steer_env.vehicle import cars
from steer_env.vehicle.plant import CHANNEL

SPEED = 100.0 / 3.6
LAWS = "lugre", "lugre,F_c=1.1", "lugre,F_c=1.2"  # of one structure, which is compiled once


def session(folder, device=None, laws=LAWS[:2], **options):
    """A session that is not yet begun."""
    device = device or make("fake")
    car = cars.load("compact")
    configurations = [car_configuration(law, car, law, speed=SPEED, hands=device.hands) for law in laws]
    return Session(configurations, device, Options(SPEED, folder=folder, **options))


def until(condition, seconds=60.0):
    """Wait for something to happen."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)


def driven(drive):
    """The recording of a session that is over."""
    return files.read(drive.path)


class Let(Fake):
    """A fake wheel whose dead-man key may be let go."""

    held = False

    def read(self):
        reading = super().read()
        return reading and reading._replace(dead_man=self.held)


class Broken(Fake):
    """A device with a mistake in its program."""

    def read(self):
        if self.clock() - self.wheel.begin > 500_000_000:
            raise ZeroDivisionError("a mistake")
        return super().read()


def test_the_road_begins_anew_under_the_car_and_the_recording_goes_on(tmp_path):
    drive = session(tmp_path)
    with drive:
        until(lambda: drive.time() > 1.0)
        before = drive.shown()
        drive.command("road")
        shown = drive.shown()
        until(lambda: drive.time() > 1.3)
    x, y, yaw = (CHANNEL[name] for name in ("x", "y", "yaw_angle"))
    assert before.channels[x] > 20.0
    assert abs(shown.channels[x]) < 2.0  # some milliseconds later
    assert abs(shown.channels[y]) < 0.05
    assert abs(shown.channels[yaw]) < 0.01
    np.testing.assert_allclose(np.diff(shown.history.pose[:, 0]), np.diff(shown.history.pose[:, 0]).mean(), rtol=0.05)
    steps = np.diff(driven(drive)["x"])
    assert steps.max() < 1.1 * np.median(steps)


def test_a_drive_is_recorded_and_configurations_change_while_driving(tmp_path):
    laws = LAWS[:2]
    drive = session(tmp_path)
    with drive:
        until(lambda: drive.time() > 0.5)
        drive.command("swap")
        until(lambda: drive.shown().chosen == 1)
        drive.command("set_1")
        until(lambda: drive.shown().chosen == 0)
        drive.command("set_5")
        drive.command("faster")
        shown, now = drive.shown(), drive.time()
        assert shown.held == pytest.approx(105.0 / 3.6)
        until(lambda: drive.time() > now + 0.3)
    assert shown.device == drive.device.about
    assert [info.label for info in shown.configurations] == list(laws)
    assert not drive.failure
    told = [words for _, words in drive.events]
    assert told == [
        f"configuration 2: {laws[1]}",
        f"configuration 1: {laws[0]}",
        "there is no configuration 5",
        "speed held at 105 km/h",
    ]
    recording = driven(drive)
    assert set(recording["chosen_set"]) == {1.0, 2.0}
    assert recording["target_speed"].max() == pytest.approx(5.0 / 3.6)
    assert recording["watchdog_gain"][-1] < 1.0  # it has faded
    assert recording.meta["device"] == drive.device.about
    assert [each["label"] for each in recording.meta["sets"]] == list(laws)
    assert np.isfinite([recording[name] for name in recording.channels]).all()


@pytest.mark.parametrize(
    ("fault", "sentence"), [("unplug", "was unplugged: plug it in"), ("refuse", "refuses the torque: check its supply")]
)
def test_a_device_that_fails_ends_the_drive_with_a_sentence_and_a_recording(fault, sentence, tmp_path):
    drive = session(tmp_path, make("fake", faults=f"{fault}@1"))
    with drive:
        drive.wait(30.0)
        assert drive.over.is_set()
        assert sentence in drive.shown().note
    assert sentence in drive.failure
    assert driven(drive).time[-1] > 0.1
    assert drive.device.wheel.motor == 0.0


def test_a_mistake_of_a_program_is_not_hidden_and_loses_nothing(tmp_path):
    drive = session(tmp_path, Broken())
    with pytest.raises(ZeroDivisionError, match="a mistake"), drive:
        drive.wait(30.0)
    assert driven(drive).time[-1] > 0.1


def test_two_quick_swaps_end_where_they_began_and_a_third_configuration_becomes_one_of_the_pair(tmp_path):
    drive = session(None, laws=LAWS)
    with drive:
        for name in ("swap", "swap", "set_3", "swap", "swap"):
            drive.command(name)
        until(lambda: drive.shown().chosen == 2)
        assert drive.shown().pair == (0, 2)
    assert [words.partition(":")[0] for _, words in drive.events] == [
        "configuration 2",
        "configuration 1",
        "configuration 3",
        "configuration 1",
        "configuration 3",
    ]


def test_a_chassis_that_keeps_its_speed_says_so():
    device, car = make("fake"), cars.load("compact")
    one = car_configuration("lugre", car, speed=SPEED, hands=device.hands, chassis="single_track")
    drive = Session([one], device, Options(SPEED))
    with drive:
        drive.command("faster")
    assert "not by this chassis" in drive.events[0][1]


def test_an_angle_that_jumps_under_torque_ends_the_drive(tmp_path):
    drive = session(tmp_path)

    def jumped():
        if drive.gain() > 0.2:  # a busy machine may have faded it out
            drive.device.inject("jump", 90.0)
        return drive.over.is_set()

    with drive:
        until(jumped)
    assert "the handwheel angle jumped" in drive.failure
    assert driven(drive)["wheel_torque"][-1] == 0.0


def test_a_clock_that_jumps_is_told_and_ends_the_torque(tmp_path):
    drive = session(tmp_path)
    with drive:
        until(lambda: drive.gain() > 0.2)
        drive.device.inject("clock", 5.0)
        until(lambda: drive.events and drive.gain() == 0.0)
    assert not drive.failure
    assert drive.events[0][1].startswith("the device's clock is 5.0 s ahead")
    assert driven(drive)["wheel_torque"][-1] == 0.0


def test_a_new_centre_waits_until_there_is_no_torque(tmp_path):
    drive = session(tmp_path, make("fake", person="weave", frequency=1.0))
    with drive:
        until(lambda: drive.gain() > 0.5)
        drive.command("recentre")
        until(lambda: drive.events)
        until(lambda: drive.gain() > 0.2)
    assert [words for _, words in drive.events] == ["straight ahead is here"]
    assert not drive.failure


def test_a_full_disk_ends_the_drive_with_a_sentence(tmp_path, monkeypatch):
    drive = session(tmp_path)
    with drive:
        until(lambda: drive.path.stat().st_size > 20_000)

        def full(file, text):
            raise OSError(errno.ENOSPC, "No space left on device")

        monkeypatch.setattr(os, "write", full)
        drive.wait(30.0)
        monkeypatch.undo()
    assert "takes no more (No space left on device); what it has is kept" in drive.failure
    assert driven(drive).time.size > 10


def test_there_is_no_torque_without_the_dead_man_key(tmp_path):
    drive = session(tmp_path, Let(), dead_man=True)
    with drive:
        until(lambda: drive.time() > 0.5)
        assert drive.shown().phase == "off"
        drive.device.held = True
        until(lambda: drive.shown().gain > 0.2)
        drive.device.held = False
        until(lambda: drive.shown().gain == 0.0)
    recording = driven(drive)
    early = recording.time < 0.4
    assert not recording["wheel_torque"][early].any()
    assert recording["wheel_torque"].any()


def test_a_window_that_hangs_does_not_hold_the_dead_man_key(tmp_path):
    import pygame

    class Window(Fake):
        def read(self):
            reading = super().read()
            return reading and reading._replace(dead_man=self.keys.dead_man(self.answers(self.clock())))

    drive = session(tmp_path, Window(), dead_man=True)
    events = [pygame.event.Event(pygame.KEYDOWN, key=pygame.K_SPACE)]

    def fed():
        drive.device.feed(events)
        return drive.gain() > 0.2

    with drive:
        until(fed)
        until(lambda: drive.gain() == 0.0 and drive.shown().waits == "hold Space")
    assert not drive.failure


def test_a_device_that_hangs_does_not_hold_up_the_end_and_gets_no_torque(tmp_path):
    class Hung(Fake):
        hangs = threading.Event()

        def read(self):
            if drive.gain() > 0.5:
                self.asked = self.wheel.motor
                self.hangs.wait(60.0)
            return super().read()

    drive = session(tmp_path, Hung(timeout_ms=10000.0))
    with drive:
        until(lambda: hasattr(drive.device, "asked"))
    assert "does not answer any more" in drive.failure
    assert drive.device.wheel.motor == 0.0
    drive.device.hangs.set()


def test_an_error_that_passes_leaves_no_torque(tmp_path):
    """A frame that is not sent ends the drive, and the next ones tell zero."""

    class Once(Fake):
        given: ClassVar = []

        def _push(self, torque):
            if drive.gain() > 0.5 and not self.given:
                self.given.append(math.nan)
                raise DeviceError("no buffer")
            if self.given:
                self.given.append(torque)
            super()._push(torque)

    drive = session(tmp_path, Once())
    with drive:
        drive.wait(30.0)
        until(lambda: len(drive.device.given) > 10)  # while the block still runs
    assert drive.failure == "no buffer"
    assert not any(drive.device.given[1:])


def test_a_signal_at_any_point_of_the_beginning_leaves_nothing_behind(tmp_path):
    """The last lines of the entry, behind which the threads run; one line is interrupted in each session."""
    code = Session.__enter__.__code__

    def entered(last):
        drive, count = session(tmp_path), 0

        def trace(frame, event, _):
            nonlocal count
            inside = frame.f_code is code or (
                frame.f_code.co_filename == contextlib.__file__ and frame.f_back.f_code is code
            )
            if event == "line" and inside and hasattr(drive, "_threads") and drive._threads[1].ident:
                count += 1
                if count == last:
                    raise KeyboardInterrupt
            return trace

        before = sys.gettrace()
        try:
            sys.settrace(trace)
            with drive:
                sys.settrace(before)
            return drive, count
        finally:
            sys.settrace(before)

    _, lines = entered(0)
    assert lines
    for last in range(1, lines + 1):
        before = threading.active_count()
        with pytest.raises(KeyboardInterrupt):
            entered(last)
        assert threading.active_count() == before


def test_a_device_from_which_nothing_comes_is_told(tmp_path):
    drive = session(tmp_path, make("fake", faults="silent@0"))
    with drive:
        until(lambda: "no angle arrives" in drive.shown().note)
    assert drive.failure.startswith("no angle ever arrived from the fake wheel")
    assert "with torque for 0.0 s" in drive.summary()[0]


def test_what_the_person_asked_for_is_no_fault(tmp_path):
    drive = session(tmp_path, make("fake", faults="let_go@3"), dead_man=True)
    with drive:
        until(lambda: drive.gain() > 0.2)
        drive.command("pause")
        until(lambda: drive.gain() == 0.0)
        time.sleep(0.3)  # in which the fade is counted
        assert drive.shown().note == "torque paused"
        assert drive.shown().waits.startswith("paused")
        paused = "\n".join(drive.summary())
        drive.command("pause")
        until(lambda: drive.shown().waits == "hold Space")
        until(lambda: "released" in drive.shown().note)
    assert "dead-man key" not in paused
    assert "the dead-man key was released" in "\n".join(drive.summary())


def test_a_device_without_a_motor_has_no_torque_to_lose(tmp_path):
    drive = session(tmp_path, Keyboard(), laws=("lugre",))
    with drive:
        until(lambda: drive.gain() > 0.2)
        assert not drive.shown().motor
        drive.command("pause")
        until(lambda: drive.gain() == 0.0)
        time.sleep(0.3)
        drive.command("pause")
        until(lambda: drive.gain() > 0.1)
    assert not any("faded" in line or "limited" in line for line in drive.summary())


def test_the_keyboard_steers_by_arms(tmp_path):
    drive = session(tmp_path, Keyboard(), laws=("lugre",))
    with drive:
        import pygame

        drive.device.feed([pygame.event.Event(pygame.KEYDOWN, key=pygame.K_LEFT)])
        until(lambda: drive.shown().channels[0] > 0.1)
        assert drive.shown().wanted > 0.1
        drive.command("swap")
        drive.device.feed([pygame.event.Event(pygame.KEYDOWN, key=pygame.K_ESCAPE)])
        drive.wait(30.0)
    assert drive.over.is_set()
    assert not drive.failure
    assert [words for _, words in drive.events] == ["there is no configuration 2"]
    assert driven(drive)["handwheel_torque"].max() > 0.1
    assert driven(drive)["lateral_acceleration"].max() > 0.1


def test_a_drive_without_a_folder_writes_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    drive = session(None, laws=("lugre",))
    with drive:
        until(lambda: drive.time() > 0.2)
    assert drive.path is None
    assert not list(tmp_path.iterdir())
