"""Faults of a device in the middle of a drive, in the device's own clock; and that ordinary use is none."""

import sys

import numpy as np
import pytest

from steer_env.live.real_time import Limits
from steer_env.live.real_time.loop import counts
from tests.live.devices.coupled import EXCHANGE, Coupled

if sys.platform != "linux":
    pytest.skip("the loop needs Linux", allow_module_level=True)

FADED = 50  # time from a fault to zero torque [ms]
BEGUN = 10  # from its detection to the begin of the fade [ms]
HOLD = round(1e3 * Limits().hold)  # until inputs that cease are detected [ms]
# Fault -> its detection behind it [ms], what the person is told, and the phase that follows.
FAULTS = {
    "unplug": (EXCHANGE, "the fake wheel was unplugged: plug it in and start again", "failed"),
    "refuse": (EXCHANGE, "the fake wheel refuses the torque: check its supply and its emergency stop", "failed"),
    "silent": (HOLD + EXCHANGE, "", "off"),
    "clock=-10": (HOLD + EXCHANGE, "", "off"),
    "clock=10": (HOLD + EXCHANGE, "", "off"),
    "jump=30": (EXCHANGE, "", "failed"),  # further than a wheel turns between two readings
}


@pytest.mark.parametrize("at", [1.7, 1.701, 1.7005])
@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_ends_the_torque(fault, at):
    detected, sentence, phase = FAULTS[fault]
    drive = Coupled(faults=f"{fault}@{at}", frequency=0.5)
    drive.run(2.2)
    begin = int(1e3 * at)
    motor, torques = np.array(drive.motor[begin:]), np.array(drive.torques[begin:])
    before = drive.motor[begin - EXCHANGE - 5]
    assert abs(before) > 0.5
    fades = next(i for i, now in enumerate(drive.phases[begin:]) if now != "on")
    last = int(np.flatnonzero(np.append(1.0, motor))[-1])
    print(f"{fault} at {at} s: fades after {fades} ms, no torque at the motor after {last} ms")
    assert fades <= detected + BEGUN
    assert last < FADED
    assert np.abs(motor).max() <= abs(before) + 0.3
    assert phase == "failed" or np.abs(np.diff(torques)).max() <= 0.2
    assert drive.sentence == sentence
    assert drive.phases[-1] == phase


def test_a_small_jump_of_the_sensor_stays_within_the_limits():
    """It cannot be told from a person's motion; slew and torque are limited."""
    drive = Coupled(faults="jump=5@1.7", frequency=0.5)
    drive.run(2.2)
    torques = np.array(drive.torques)
    grown = np.diff(np.abs(torques))[np.sign(torques[1:]) == np.sign(torques[:-1])]
    print(f"largest torque {np.abs(torques).max():.2f} N m, largest growth in a sample {grown.max():.2f} N m")
    assert np.abs(torques[1690:]).max() <= drive.limits.torque
    assert 0.3 < grown.max() <= 1e-3 * drive.limits.slew + 1e-9  # the limit of power takes away faster
    assert drive.phases[-1] == "on"


def test_a_new_straight_ahead_is_no_jump():
    drive = Coupled(frequency=0.5)
    drive.run(1.7)
    drive.device.recentre()
    drive.run(1.0)
    assert set(drive.phases[1100:]) == {"on"}


def test_a_stuck_sensor_is_a_wheel_that_is_held():
    drive = Coupled(faults="stuck@1.7", frequency=0.5)
    drive.run(4.0)
    assert set(drive.phases[1100:]) == {"on"}
    assert np.ptp(drive.torques[-500:]) < 0.05


def test_a_process_that_is_stopped_leaves_no_torque():
    """For a second: the motor ends by its own timeout, and behind the stop the torque begins softly."""
    drive = Coupled(frequency=0.5)
    drive.run(1.7)
    wheel, before, stopped = drive.device.wheel, drive.motor[-1], drive.clock.now
    assert abs(before) > 0.5
    acted = []
    for ms in range(1000):  # only the wheel's clock goes on
        wheel.advance(stopped + ms * 1_000_000)
        acted.append(wheel.motor)
    last = int(np.flatnonzero(acted)[-1])
    print(f"no torque at the motor {last} ms after the stop")
    assert last < FADED
    drive.run(0.5, missed=1000)
    behind = np.abs(drive.motor[1700:])
    assert behind[:25].max() <= abs(before) + 0.1  # what was in the mailbox, then the fade
    assert not behind[40:60].any()
    assert np.abs(np.diff(behind[60:])).max() < 0.05


@pytest.mark.whole
def test_two_minutes_of_ordinary_use_trip_nothing(capsys):
    """Also where the machine stalls the process for 16 ms, and the thread of Python beside that, every few seconds."""
    drive = Coupled()
    draw = np.random.default_rng(18)
    for _ in range(120):
        stall = int(draw.integers(1, 17)) if draw.random() < 0.3 else 0
        drive.run(1.0 - 1e-3 * stall, missed=stall, kept=False)
    found = counts(drive.loop)
    trips = {name: found[name] for name in ("stale_trips", "deadline_trips", "failure_trips")}
    with capsys.disabled():
        print(f"\ntwo minutes of a weave: {trips}")
    assert drive.mail.get()[1] == "on"
    assert not any(trips.values())
    assert drive.sentence == ""
