"""The recording of a drive: a weave on a fake clock, and files that grow."""

import errno
import math
import os

import numpy as np
import pytest

from steer_env import manoeuvres, metrics
from steer_env.live.drive.hands import car_configuration
from steer_env.live.drive.log import Appended, Column, Log, new_file, recorded_columns
from steer_env.live.real_time import CarConfigurations, Limits, Mailboxes, RealTime
from steer_env.live.real_time.angle_filter import BANDWIDTH
from steer_env.live.real_time.loop import PERIOD, tick
from steer_env.recording import files
from steer_env.vehicle import cars

CHANNELS = [("handwheel_angle", "rad"), ("handwheel_torque", "N m"), ("chosen_set", "1")]


def test_a_full_disk_leaves_no_empty_file(tmp_path, monkeypatch):
    def full(file, text):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(OSError, match="choose another directory"):
        new_file(tmp_path, [Column("x", "m", 0)], {})
    assert not list(tmp_path.iterdir())


def weave(folder, amplitude, seconds, chassis, bits=None):
    """A weave by readings of a wheel every 2 ms, on a clock that is not the machine's; the recording that it leaves."""
    car = cars.load("compact")
    configurations = CarConfigurations([car_configuration("lugre", car, chassis=chassis)[0]])
    mail = Mailboxes(configurations, angle_bandwidth=BANDWIDTH)
    real_time = RealTime(configurations, mail.device, Limits())
    columns = recorded_columns(configurations.subsystem, real_time.recorder)
    path, file = new_file(folder, columns, {"manoeuvre": "weave", "speed_m_s": 100.0 / 3.6})
    log = Log(columns, file)
    names = [signal.name for signal in configurations.subsystem.given]
    model, loop, _ = real_time._arguments
    step = math.radians(900.0) / 2**bits if bits else None
    for k in range(round(1e3 * seconds)):
        now = (k + 5) * PERIOD
        if k % 2 == 0:
            angle, _ = manoeuvres.make("weave").hand(np.array([1e-3 * k]), amplitude)
            read = float(angle[0]) if step is None else step * round(float(angle[0]) / step)
            mail.put([read if name == "hand_angle" else 0.0 for name in names], now)
        tick(model, loop, mail.device, now, 0)
        if k % 100 == 99:
            log.add(*real_time.recorder.drain())
    log.close()
    return files.read(path)


@pytest.mark.whole
@pytest.mark.parametrize("chassis", ["single_track", "two_track"])
def test_a_persons_weave_gets_the_metrics_of_the_robots(chassis, tmp_path):
    """Through filter, loop, recorder, thinning and file; the sensor's 16 bit only add noise."""
    manoeuvre = manoeuvres.make("weave")
    manoeuvre = type(manoeuvre)(**{**manoeuvre.__dict__, "chassis": chassis})
    robot = manoeuvres.drive(cars.load("compact"), manoeuvre)
    driven = weave(tmp_path, robot.meta["amplitude_rad"], manoeuvre.duration, chassis, bits=16)
    expected, found = metrics.evaluate(robot), metrics.evaluate(driven)
    assert expected.keys() == found.keys()
    for name, value in expected.items():
        assert found[name].value == pytest.approx(value.value, rel=0.02, abs=1e-3), name


def test_rows_are_means_and_the_speed_is_that_of_the_way(tmp_path):
    driven = weave(tmp_path, 0.2, 2.0, "single_track")
    assert driven.rate == pytest.approx(200.0)
    assert driven.time[0] == pytest.approx(0.003)
    assert driven["vehicle_speed"] == pytest.approx(100.0 / 3.6, rel=1e-4)
    assert set(driven["chosen_set"]) == {1.0}
    assert driven["deadlines_missed"].sum() == 0.0
    assert driven["watchdog_gain"][-1] == 1.0
    assert driven.meta["manoeuvre"] == "weave"


@pytest.fixture
def columns():
    """Those of a drive of one configuration."""
    configurations = CarConfigurations([car_configuration("lugre", cars.load("compact"))[0]])
    return recorded_columns(
        configurations.subsystem, RealTime(configurations, Mailboxes(configurations).device).recorder
    )


def test_no_file_is_ever_overwritten(columns, tmp_path):
    (tmp_path / "drive-0007.csv").write_text("mine")
    made = [new_file(tmp_path, columns, {})[0].name for _ in range(2)]
    assert made == ["drive-0008.csv", "drive-0009.csv"]
    assert (tmp_path / "drive-0007.csv").read_text() == "mine"
    with pytest.raises(FileExistsError):
        Appended(tmp_path / "drive-0007.csv", CHANNELS, {})


def test_lost_samples_leave_a_gap(columns, tmp_path):
    path, file = new_file(tmp_path, columns, {})
    log, rows = Log(columns, file), np.zeros((100, 60))
    log.add(rows, 50)
    log.add(rows, 0)
    log.close()
    time = files.read(path).time
    assert np.diff(time).max() == pytest.approx(0.055)
    assert np.diff(time).min() == pytest.approx(0.005)


def grown(path, rows):
    """A file with so many rows, and their values."""
    values = np.random.default_rng(0).normal(size=(rows, len(CHANNELS)))
    file = Appended(path, CHANNELS, {"manoeuvre": "weave", "sets": [{"label": "a"}]})
    for k in range(rows):
        file.add(np.array([0.005 * (k + 1)]), values[k : k + 1])
    file.close()
    return values


def test_a_file_is_read_back_as_it_was_given(tmp_path):
    values = grown(tmp_path / "a.csv", 40)
    read = files.read(tmp_path / "a.csv")
    for (name, unit), column in zip(CHANNELS, values.T):
        assert read[name] == pytest.approx(column, rel=1e-6)
        assert read.units[name] == unit
    assert read.meta["sets"] == [{"label": "a"}]
    assert "torn" not in read.meta


@pytest.mark.parametrize("cut", [1, 3, 20])
def test_a_last_line_that_was_cut_off_is_left_out_and_told(cut, tmp_path):
    grown(tmp_path / "a.csv", 40)
    whole = (tmp_path / "a.csv").read_bytes()
    (tmp_path / "a.csv").write_bytes(whole[:-cut])
    read = files.read(tmp_path / "a.csv")
    assert read.time.size == 39
    assert read.meta["torn"] == "the last line"


def test_other_files_may_end_without_a_line_feed(tmp_path):
    """A last number may be cut off there as well, but nothing tells."""
    (tmp_path / "b.csv").write_text("time_s,handwheel_angle_deg\n0.0,1.0\n0.1,2.0\n0.2,3.0")
    assert files.read(tmp_path / "b.csv").time.size == 3
