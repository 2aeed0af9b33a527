"""Recordings: checks at construction, what is derived from them, and the file format."""

import dataclasses
import os
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steer_env.recording import DEGREE, FILE_UNITS, Recording

UNITS = {"handwheel_angle": "rad", "handwheel_torque": "N m", "lateral_acceleration": "m/s2", "yaw_rate": "rad/s"}


@pytest.fixture
def weave():
    time = np.arange(1001) / 100
    wave = np.sin(2 * np.pi * 0.5 * time)
    channels = dict(zip(UNITS, (0.3 * wave, 3.0 * wave, 2.0 * wave, 0.1 * wave)))
    return Recording(time, channels, UNITS, {"manoeuvre": "weave", "speed_kph": 100.0, "cycles": 5, "mirrored": False})


def test_channels_are_found_by_name(weave):
    np.testing.assert_array_equal(weave["yaw_rate"], weave.channels["yaw_rate"])
    with pytest.raises(ValueError, match="no channel 'yaw' in this recording; it has handwheel_angle, handwheel_tor"):
        weave["yaw"]


def test_a_recording_does_not_change(weave):
    with pytest.raises(ValueError, match="read-only"):
        weave["yaw_rate"][0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        weave.time = weave.time + 1
    again = pickle.loads(pickle.dumps(weave))
    np.testing.assert_array_equal(again["yaw_rate"], weave["yaw_rate"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": [0.0, 1.0, np.nan]}, "time needs at least two samples, all finite"),
        ({"time": [0.0]}, "time needs at least two samples"),
        ({"time": [0.0, 1.0, 1.0]}, "sample 2 is 1.0 s after 1.0 s"),
        ({"time": np.zeros((3, 1))}, r"'time' has shape \(3, 1\)"),
        ({"channels": {"yaw_rate": [0.0, 1.0]}}, "channel 'yaw_rate' has 2 samples, time has 3"),
        ({"channels": {"time": [0.0, 1.0, 2.0]}, "units": {"time": "s"}}, "no channel may be called 'time'"),
        ({"units": {}}, r"units must name the channels \['yaw_rate'\]; got \[\]"),
        ({"units": {"yaw_rate": "deg/s"}}, r"unit 'deg/s'; known units are \['rad', "),
        ({"meta": {"a: b": 1}}, "meta key 'a: b' must be a single line"),
        ({"meta": {"friction": np.zeros(2)}}, "allowed are text, numbers"),
    ],
)
def test_what_a_recording_refuses(change, message):
    plain = {"time": [0.0, 1.0, 2.0], "channels": {"yaw_rate": [0.0, 1.0, 2.0]}, "units": {"yaw_rate": "rad/s"}}
    with pytest.raises(ValueError, match=message):
        Recording(**{**plain, **change})


def test_between_keeps_both_ends(weave):
    part = weave.between(2.0, 3.0)
    assert (part.time[0], part.time[-1], part.time.size) == (2.0, 3.0, 101)
    assert part.meta == weave.meta
    with pytest.raises(ValueError, match=r"no samples from 11 to 12 s; time runs from 0\.0 to 10\.0 s"):
        weave.between(11, 12)


def test_resampled_reads_straight_lines(weave):
    fine = weave.resampled(250.0)
    assert fine.rate == pytest.approx(250.0)
    assert fine.time[-1] == 10.0
    # A chord lies within (omega dt)^2 / 8 of a sine.
    np.testing.assert_allclose(fine["yaw_rate"], 0.1 * np.sin(np.pi * fine.time), atol=0.1 * (np.pi * 0.01) ** 2 / 8)
    with pytest.raises(ValueError, match=r"rate is 0\.05 Hz; it must give at least two samples"):
        weave.resampled(0.05)


def test_low_pass_has_no_phase_and_halves_at_the_cutoff():
    """Amplitude 1 / (1 + (f/fc)^4) at every frequency, the same for all channels, to 0.1 % away from the ends."""
    time = np.arange(4001) / 1000
    for frequency in (0.5, 5.0, 20.0):
        wave = np.sin(2 * np.pi * frequency * time)
        smooth = Recording(time, {"a": wave, "b": -7 * wave}, {"a": "1", "b": "N m"}).filtered(5.0)
        middle = slice(1000, 3001)
        expected = wave[middle] / (1 + (frequency / 5.0) ** 4)
        np.testing.assert_allclose(smooth["a"][middle], expected, atol=1e-3)
        np.testing.assert_allclose(smooth["b"], -7 * smooth["a"], rtol=1e-12, atol=1e-12)


def test_what_the_low_pass_refuses(weave):
    with pytest.raises(ValueError, match="sampling at 100 Hz is too slow for a low-pass at 30 Hz; record at 120 Hz"):
        weave.filtered(30.0)
    with pytest.raises(ValueError, match="11 samples are too few for a low-pass at 5 Hz: needs 20"):
        weave.between(0.0, 0.1).filtered(5.0)
    with pytest.raises(ValueError, match="cutoff_hz is 0; it must be positive"):
        weave.filtered(0)
    gap = Recording(weave.time, {"yaw_rate": np.full(1001, np.nan)}, {"yaw_rate": "rad/s"})
    with pytest.raises(ValueError, match="channel 'yaw_rate' has samples that are not finite"):
        gap.filtered(5.0)
    uneven = Recording(weave.time**2, weave.channels, weave.units)
    with pytest.raises(ValueError, match=r"not uniform: call resampled\(rate\) first"):
        uneven.filtered(5.0)


def test_time_stamps_may_be_rounded(weave):
    assert Recording(np.round(np.arange(1001) / 128, 3), weave.channels, UNITS).rate == pytest.approx(128, rel=1e-3)


def test_every_column_names_its_unit(weave, tmp_path):
    weave.to_csv(tmp_path / "weave.csv")
    lines = (tmp_path / "weave.csv").read_text().splitlines()
    assert lines[:4] == ["# manoeuvre: weave", "# speed_kph: 100.0", "# cycles: 5", "# mirrored: false"]
    assert lines[4] == "time_s,handwheel_angle_deg,handwheel_torque_Nm,lateral_acceleration_m_s2,yaw_rate_deg_s"
    assert float(lines[55].split(",")[1]) == pytest.approx(0.3 / DEGREE)  # a quarter period on, in degrees
    assert len(lines) == 5 + weave.time.size


@given(st.lists(st.floats(allow_infinity=True, allow_nan=True), min_size=2, max_size=8), st.sampled_from([*FILE_UNITS]))
def test_round_trip(tmp_path_factory, values, unit):
    """To 1e-12: nothing is lost but the last bit in going to degrees and back."""
    path = tmp_path_factory.getbasetemp() / "round_trip.csv"
    limited = np.clip(values, -1e300, 1e300)
    written = Recording(np.arange(limited.size) / 3, {"some_channel": limited}, {"some_channel": unit})
    written.to_csv(path)
    read = Recording.from_csv(path)
    np.testing.assert_array_equal(read.time, written.time)
    np.testing.assert_allclose(read["some_channel"], limited, rtol=1e-12, atol=1e-300)
    assert read.units == written.units


@given(st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(st.characters(codec="utf-8")))
def test_meta_round_trip(tmp_path_factory, value):
    path = tmp_path_factory.getbasetemp() / "meta.csv"
    Recording(np.arange(2.0), {}, {}, {"key": value, "other key": "1.5"}).to_csv(path)
    meta = Recording.from_csv(path).meta
    assert meta == {"key": value, "other key": "1.5"}
    assert type(meta["key"]) is type(value)


def test_a_name_that_reads_as_another_unit_is_refused(tmp_path):
    ambiguous = Recording(np.arange(2.0), {"speed_m": np.arange(2.0)}, {"speed_m": "s"})
    with pytest.raises(ValueError, match="channel 'speed_m' in 's' cannot be a column: rename"):
        ambiguous.to_csv(tmp_path / "a.csv")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("step", ["write", "rename"])
def test_interrupted_write_leaves_the_old_file(weave, tmp_path, monkeypatch, step):
    path = tmp_path / "weave.csv"
    path.write_text("old")

    def interrupt(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        if step == "rename":
            patch.setattr(os, "replace", interrupt)
        else:
            patch.setattr("steer_env.recording._meta_text", interrupt)
        with pytest.raises(KeyboardInterrupt):
            weave.to_csv(path)
    assert [file.name for file in tmp_path.iterdir()] == ["weave.csv"]
    assert path.read_text() == "old"
    weave.to_csv(path)
    assert path.read_text() != "old"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1, column 1: expected 'time_s', got ''"),
        ("t,yaw_rate_deg_s\n0,1\n1,2\n", "line 1, column 1: expected 'time_s', got 't'"),
        ("# weave\ntime_s\n", "line 1, column 1: expected '# key: value', got '# weave'"),
        (
            "time_s,yaw_rate\n0,1\n1,2\n",
            r"line 1, column 2: expected a name that ends in its unit \(_deg, .*'yaw_rate'",
        ),
        ("time_s,a_deg,a_m\n0,1,1\n", "line 1, column 3: expected each channel once, got 'a_m'"),
        ("# k: v\ntime_s,a_deg\n0,1\n1,x\n", "line 4, column 'a_deg': expected a number, got 'x'"),
        ("time_s,a_deg,b_m\n0,1,2\n1,2\n", "line 3, column 'b_m': expected 3 values, got 2"),
        ("time_s,a_deg\n0,1\n1,2,3\n", "line 3, column 'a_deg': expected 2 values, got 3"),
        ("time_s,a_deg\n0,1\n0,2\n", "line 3, column 'time_s': expected a finite time after that of the line before"),
        ("time_s,a_deg\n0,1\nnan,2\n", "line 3, column 'time_s': expected a finite time"),
        ("time_s,a_deg\n0,1\n", "line 3, column 'time_s': expected at least two rows, got 1"),
    ],
)
def test_what_a_file_is_refused_for(tmp_path, text, message):
    path = tmp_path / "run.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=f"run.csv, {message}"):
        Recording.from_csv(path)


def test_a_table_from_a_spreadsheet_is_read(tmp_path):
    """Byte-order mark, Windows line ends, spaces, no meta."""
    path = tmp_path / "run.csv"
    path.write_bytes("\ufefftime_s, handwheel_angle_deg\r\n0, 180\r\n0.5, -90\r\n".encode())
    np.testing.assert_allclose(Recording.from_csv(path)["handwheel_angle"], [np.pi, -np.pi / 2])
