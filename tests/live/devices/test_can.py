"""The CAN device beside its contract: frames to the bit, counters, what the DBC lacks, and other buses."""

import math
import re
import struct

import pytest

from steer_env.live import devices
from steer_env.live.devices import DeviceError
from tests.live.devices.stages import DBC, CanStage
from tests.needs import needs

pytestmark = needs("can", "cantools")


@pytest.fixture
def stage(monkeypatch, tmp_path):
    """A node on a virtual bus."""
    made = CanStage(monkeypatch, tmp_path)
    yield made
    monkeypatch.undo()
    made.close()


def test_every_signal_arrives_in_its_unit(stage):
    with stage.make(speed="WHEEL.SPEED", throttle="WHEEL.THROTTLE", brake="WHEEL.BRAKE") as device:
        assert device.read() is None
        stage.turn(math.radians(90.0), math.radians(-30.0), throttle=0.25, brake=1.0)
        reading = device.read()
        assert math.degrees(reading.angle) == pytest.approx(90.0)
        assert math.degrees(reading.speed) == pytest.approx(-30.0)
        assert (reading.throttle, reading.brake) == (0.25, 1.0)
        assert device.read() is None


def test_the_newest_of_several_frames_counts(stage):
    with stage.make() as device:
        for angle in (0.1, 0.2, 0.3):
            stage.turn(angle)
        assert device.read().angle == pytest.approx(0.3, abs=1e-3)
        assert device.read() is None


def test_a_bus_that_counts_to_the_right(stage):
    with stage.make(right_positive="true") as device:
        stage.turn(0.2)
        assert device.read().angle == pytest.approx(-0.2, abs=1e-3)
        device.write(2.0)
        assert stage.torque() == pytest.approx(-2.0)


def test_a_frame_whose_counter_stands_is_stale(stage):
    with stage.make(counter="WHEEL.COUNT") as device:
        stage.turn(0.1, count=5)
        assert device.read() is not None
        stage.turn(0.2, count=5)
        assert device.read() is None
        stage.turn(0.2, count=6)
        assert device.read().angle == pytest.approx(0.2, abs=1e-3)


def test_the_torque_frame_to_the_bit(stage):
    with stage.make(torque_counter="MOTOR.COUNT", also="ENABLE=1") as device:
        for _ in range(20):
            stage.wait(2)
            device.write(-1.5)
        stage.torque()
    stage.torque()
    frames = [struct.unpack("<hBB", frame) for frame in stage.frames]
    assert [torque for torque, _, _ in frames] == [-1500] * 20 + [0]  # and none behind the end
    assert [byte & 15 for _, byte, _ in frames] == [i % 16 for i in range(21)]
    assert {byte >> 4 for _, byte, _ in frames} == {1}


@pytest.mark.parametrize(
    ("text", "counts"),
    [("@1+ (1,0) [0|14]", range(15)), ("@1- (1,0) [-8|7]", range(-8, 8)), ("@1+ (1,0) [0|0]", range(16))],
)
def test_a_counter_runs_through_the_range_of_the_dbc_and_the_last_frame_is_zero(stage, text, counts):
    (stage.folder / "wheel.dbc").write_text(re.sub(r"(SG_ COUNT : 16\|4)@1\+ \S+ \S+", rf"\1{text}", DBC))
    with stage.make(torque_counter="MOTOR.COUNT") as device:
        for _ in range(40):
            stage.wait(2)
            device.write(3.0)
    stage.torque()
    frames = [struct.unpack_from("<hB", frame) for frame in stage.frames]
    assert [torque for torque, _ in frames] == [3000] * 40 + [0]
    assert [byte & 15 for _, byte in frames] == [counts[i % len(counts)] % 16 for i in range(41)]


def test_a_counter_that_does_not_count_by_one_is_refused(stage):
    (stage.folder / "wheel.dbc").write_text(re.sub(r"(SG_ COUNT : 16\|4)@1\+ \S+ \S+", r"\1@1+ (1,0) [3|3]", DBC))
    with pytest.raises(DeviceError, match="the counter COUNT cannot count from 3 to 3"):
        stage.make(torque_counter="MOTOR.COUNT").__enter__()


@pytest.mark.parametrize(("period", "calls", "frames"), [(0, 2, 500), (10, 2, 100), (5, 2, 200), (2, 1, 500)])
def test_the_torque_frame_is_cyclic(stage, period, calls, frames):
    """With the cycle of the DBC, 2 ms, or a stated one; calls at other times do not stretch it."""
    with stage.make(period_ms=period) as device:
        for _ in range(1000 // calls):
            stage.wait(calls)
            device.write(1.0)
        stage.torque()
        assert len(stage.frames) == pytest.approx(frames, abs=1)


def test_foreign_short_and_remote_frames_are_none(stage):
    message = stage.can.Message
    with stage.make() as device:
        for frame in (
            message(arbitration_id=257, data=bytes(8), is_extended_id=False),
            message(arbitration_id=256, data=bytes(8), is_extended_id=True),
            message(arbitration_id=256, data=bytes(3), is_extended_id=False),
            message(arbitration_id=256, dlc=8, is_remote_frame=True, is_extended_id=False),
        ):
            stage.bus.send(frame)
        assert device.read() is None


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"dbc": ""}, "needs the DBC that says what is in its frames: dbc=FILE"),
        ({"dbc": "none.dbc"}, "none.dbc cannot be read as a CAN database"),
        (
            {"angle": "WHEEL.ANGEL"},
            "has no signal 'WHEEL.ANGEL', which angle=MESSAGE.SIGNAL chooses; did you mean WHEEL.ANGLE",
        ),
        (
            {"torque": "X"},
            "has no signal 'X', which torque=MESSAGE.SIGNAL chooses; there are WHEEL.ANGLE, .*MOTOR.TORQUE",
        ),
        ({"torque": "WHEEL.SPEED"}, r"WHEEL.SPEED in .* is in deg/s, which is none of Nm, .*: give torque_unit=UNIT"),
        ({"angle": "WHEEL.COUNT"}, "is in no unit, which is none of deg, rad: give angle_unit=UNIT"),
        ({"max_torque": 30.0}, "cannot carry -30 N m .*: lower max_torque"),
        ({"also": "LAMP=1"}, "MOTOR in .* has no signal 'LAMP'; there are TORQUE, COUNT, ENABLE"),
        ({"torque_counter": "WHEEL.COUNT"}, "torque_counter=WHEEL.COUNT must be a signal of MOTOR"),
        ({"interface": "socketcan", "channel": "can7"}, "the CAN bus can7 of socketcan cannot be opened"),
        ({"interface": "pigeon"}, "cannot be opened .*pigeon"),
    ],
)
def test_what_cannot_be_is_told(stage, options, message):
    with pytest.raises(DeviceError, match=message):
        stage.make(**options).__enter__()


def test_a_dbc_without_cycle_time_needs_a_period(stage):
    (stage.folder / "wheel.dbc").write_text(DBC.replace('BA_ "GenMsgCycleTime" BO_ 512 2;', ""))
    with pytest.raises(DeviceError, match=r"tells no cycle time of MOTOR: give period_ms=NUMBER"):
        stage.make().__enter__()
    with stage.make(period_ms=4):
        pass


def test_a_text_that_is_no_list_is_refused():
    for option in ("bus", "also"):
        with pytest.raises(ValueError, match=f"{option} is like NAME=VALUE"):
            devices.make("can", **{option: "fast"})
