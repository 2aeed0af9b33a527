"""The fake wheel: its physics against closed forms, what it tells, and its faults, all in simulated time."""

import math

import numpy as np
import pytest

from steer_env.live import devices
from tests.live.devices.stages import MS, Clock


def opened(**options):
    """A fake wheel with a simulated clock, open."""
    clock = Clock()
    return devices.make("fake", clock=clock, **options).__enter__(), clock


def drive(wheel, clock, seconds, torque=None, period=2):
    """Read and write every ``period`` ms for so long; angles read [rad] and torques that acted [N m]."""
    angles, motor = [], []
    for k in range(round(1e3 * seconds)):
        clock.now += MS
        if k % period == 0:
            reading = wheel.read()
            angles.append(reading.angle if reading else math.nan)
            if torque is not None:
                wheel.write(torque)
        else:
            wheel.wheel.advance(clock.now)
        motor.append(wheel.wheel.motor)
    return np.array(angles), np.array(motor)


def test_a_free_wheel_turns_as_the_closed_form():
    """Constant torque on inertia and damping: w = T/b (1 - exp(-b t/J)); left is positive."""
    wheel, clock = opened(person="free", friction=0.0, delay_ms=0.0, bits=32, max_torque=1.0)
    angles, motor = drive(wheel, clock, 0.5, torque=0.5, period=1)
    t = 1e-3 * np.arange(500)
    lag = 0.04 / 0.3
    expected = 0.5 / 0.3 * (t - lag * (1.0 - np.exp(-t / lag)))
    assert angles == pytest.approx(expected, abs=0.003)
    assert motor[-1] == 0.5


def test_friction_holds_what_is_smaller():
    wheel, clock = opened(person="free", friction=0.6)
    angles, _ = drive(wheel, clock, 0.5, torque=0.5)
    assert set(angles) == {0.0}


def test_the_sensor_has_steps():
    wheel, clock = opened(bits=12)
    angles, _ = drive(wheel, clock, 3.0)
    steps = angles / (math.radians(900.0) / 2**12)
    assert steps == pytest.approx(np.round(steps), abs=1e-9)
    assert len(set(steps)) > 20


def test_the_weave_is_one():
    wheel, clock = opened()
    angles, _ = drive(wheel, clock, 30.0)
    t = 2e-3 * np.arange(angles.size)
    shapes = np.column_stack([f(2.0 * math.pi * 0.2 * t[5000:]) for f in (np.sin, np.cos)])
    size = np.hypot(*np.linalg.lstsq(shapes, angles[5000:], rcond=None)[0])
    assert math.degrees(size) == pytest.approx(20.0, rel=0.05)


def test_the_delay_is_half_of_the_sensor_and_half_of_the_motor():
    wheel, clock = opened(person="free", friction=0.0, delay_ms=20.0, bits=32)
    clock.now += 5 * MS
    wheel.write(2.0)
    seen = []
    for _ in range(30):
        clock.now += MS
        seen.append((wheel.read().angle > 0.0, wheel.wheel.motor))
    assert [motor > 0.0 for _, motor in seen].index(True) in (9, 10)
    assert [moved for moved, _ in seen].index(True) in (19, 20, 21)


def test_two_runs_are_equal_to_the_bit():
    runs = [drive(*opened(faults="jump=5@1"), 2.0, torque=1.0) for _ in range(2)]
    for one, other in zip(*runs):
        assert np.array_equal(one, other)


def test_faults_of_the_sensor():
    wheel, clock = opened(faults="stuck@1+jump=9@2+silent@3")
    angles, _ = drive(wheel, clock, 4.0)
    assert len(set(angles[505:995])) == 1
    assert math.degrees(angles[1005] - angles[995]) == pytest.approx(9.0)
    assert np.isnan(angles[1505:]).all()
    wheel, clock = opened(faults="clock=-10@1")
    drive(wheel, clock, 2.0)
    assert wheel.read().stamp == clock.now - 10**10


def test_a_clock_that_goes_back_does_nothing():
    wheel, clock = opened()
    drive(wheel, clock, 1.0, torque=1.0)
    angle = wheel.wheel.angle
    clock.now -= 10**9
    wheel.write(1.0)
    assert wheel.read() is None
    assert wheel.wheel.angle == angle


@pytest.mark.parametrize("bad", ["unplug", "unplug=3@2", "jump@2", "fly@1", "jump=x@1"])
def test_faults_that_are_none_are_refused(bad):
    with pytest.raises(ValueError, match=r"faults are like 'jump=5@2\+unplug@20', got"):
        devices.make("fake", faults=bad)
    wheel, _ = opened()
    with pytest.raises(ValueError, match="fault must be one of unplug"):
        wheel.inject("fly")


def test_a_person_turns_holds_and_lets_go():
    wheel, clock = opened(person="release", amplitude_deg=90.0, frequency=0.5, friction=0.0, delay_ms=0.0, bits=32)
    angles, _ = drive(wheel, clock, 2.5, torque=-0.5, period=1)
    assert np.degrees(angles[1000:1400]) == pytest.approx(90.0, abs=2.0)
    assert np.degrees(angles[2400]) < 60.0  # from 1.5 s on the motor alone turns it back
