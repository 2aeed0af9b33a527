"""Recordings to and from files: what is written is read back, what comes from elsewhere is read or refused."""

import dataclasses
import gzip
import os
import sys

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from steer_env import metrics
from steer_env.recording.files import FORMATS, read, write
from steer_env.recording.recording import DEGREE, FILE_UNITS, Recording, require_moderate
from tests.needs import needs
from tests.steer_env.recorded import UNITS, made_weave

PACKAGES = {".mf4": ["asammdf"], ".mdf": ["asammdf"], ".parquet": ["pyarrow"]}
SUFFIXES = [pytest.param(suffix, marks=needs(*PACKAGES.get(suffix, []))) for suffix in FORMATS]


@pytest.fixture
def weave():
    meta = {"manoeuvre": "weave", "speed_kph": 100.0, "cycles": 5, "mirrored": False}
    return dataclasses.replace(made_weave(), meta=meta)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_recording_is_the_same_through_every_format(weave, tmp_path, suffix):
    """To 1e-12: nothing is lost but the last bit in going to degrees and back; times, forces and metres are exact."""
    path = tmp_path / f"weave{suffix}"
    write(weave, path)
    back = read(path)
    np.testing.assert_array_equal(back.time, weave.time)
    for name, unit in UNITS.items():
        np.testing.assert_allclose(back[name], weave[name], rtol=1e-15 if "rad" not in unit else 1e-12)
    assert back.units == weave.units
    assert back.meta == weave.meta
    assert [type(value) for value in back.meta.values()] == [str, float, int, bool]
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    expected, found = metrics.evaluate(weave, "weave"), metrics.evaluate(back, "weave")
    assert not expected["torque_at_0g"].reason
    for name, value in expected.items():
        np.testing.assert_allclose(found[name][:3], value[:3], rtol=1e-9, atol=1e-12)


def test_a_file_with_a_decimal_comma_is_the_same_recording(weave, tmp_path):
    plain, comma = tmp_path / "plain.csv", tmp_path / "comma.csv"
    write(weave, plain)
    write(weave, comma, decimal=",")
    assert "time_s;" in comma.read_text(encoding="utf-8")
    one, other = read(plain), read(comma)
    for name in one.channels:
        np.testing.assert_array_equal(other[name], one[name])
    assert other.meta == one.meta
    with pytest.raises(ValueError, match=r"decimal sign ',' is of \.csv files"):
        write(weave, tmp_path / "comma.mat", decimal=",")
    with pytest.raises(ValueError, match=r"must be one of .*got ';'"):
        write(weave, comma, decimal=";")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_gaps_and_odd_meta_survive(tmp_path, suffix):
    written = Recording(
        [0.0, 0.1, 0.4],
        {
            "yaw_rate": [1.0, np.nan, -0.0],
            "torque in the shaft" if suffix != ".mat" else "shaft": [-1e300, 1e300, 5e-324],
        },
        {"yaw_rate": "rad/s", "torque in the shaft" if suffix != ".mat" else "shaft": "N m"},
        {"driver": "Ørsted <a & b>\n\x01", "none": None, "number": "1.5"},
    )
    write(written, tmp_path / f"run{suffix}")
    back = read(tmp_path / f"run{suffix}")
    (counted,) = back.meta["no_value"].values()
    assert counted == {"empty": 1}
    assert {key: value for key, value in back.meta.items() if key != "no_value"} == written.meta
    for name in written.channels:
        np.testing.assert_allclose(back[name], written[name], rtol=1e-15)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_nested_meta_survives(weave, tmp_path, suffix):
    """A record of where a file comes from: dicts and lists, deep and long, with every kind of text and number."""
    record = {
        "version": "1.0",
        "command": ["run", "weave", "--set", 'column.K_tb=143, "x"'],
        "car": {
            "column": {"K_tb": 143.0, "curve": [[0.0, 1e-300], [0.1, -0.1]]},
            "doors": 4,
            "tyre": None,
            "own": True,
        },
        "text": "Ø <a> & 'b': c\n# d; e, f\tg",
        "long": ["x" * 100] * 1000,
        "empty": [{}, []],
    }
    written = dataclasses.replace(
        weave, meta={**weave.meta, "trace": record, "list": "[1, 2]", "inputs": [1, {"a": 2}]}
    )
    record["car"]["doors"] = 2  # a recording does not change
    write(written, tmp_path / f"run{suffix}")
    back = read(tmp_path / f"run{suffix}").meta
    assert back == written.meta
    assert back["trace"]["car"]["doors"] == 4
    assert back["list"] == "[1, 2]"


def test_a_module_beside_a_matlab_file_is_not_run(tmp_path, monkeypatch):
    write(Recording(np.arange(2.0), {}, {}, {"a": 1}), tmp_path / "run.mat")
    (tmp_path / "pickle.py").write_text("raise SystemExit('it ran')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", [each for each in sys.path if each])
    assert read("run.mat").meta["a"] == 1


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("run.mat", lambda data: (184, 0)),  # a type of numbers that there is not, for which scipy does not look
        pytest.param("run.mf4", lambda data: (data.rfind(b"##CN") + 94, 16), marks=needs("asammdf")),  # 1 MB off
    ],
)
def test_a_file_that_crashes_its_reader_is_refused(weave, tmp_path, name, damage):
    write(weave, path := tmp_path / name)
    data = bytearray(path.read_bytes())
    place, value = damage(data)
    data[place] = value
    path.write_bytes(data)
    kind = "a MATLAB file" if name.endswith("mat") else "an MDF file"
    with pytest.raises(ValueError, match=rf"{name}: cannot be read as {kind} \(the reader crashed\); is it complete"):
        read(path)


@pytest.mark.parametrize("name", ["run.txt", "run", "run.mf4.gz"])
def test_other_suffixes_are_refused(weave, tmp_path, name):
    for act in (lambda: write(weave, tmp_path / name), lambda: read(tmp_path / name)):
        with pytest.raises(ValueError, match=r"recordings end in \.csv, \.mat, \.mf4, \.mdf, \.parquet"):
            act()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_missing_file_is_an_os_error(tmp_path, suffix):
    with pytest.raises(FileNotFoundError):
        read(tmp_path / f"none{suffix}")


def test_every_column_names_its_unit(weave, tmp_path):
    write(weave, tmp_path / "weave.csv")
    lines = (tmp_path / "weave.csv").read_text().splitlines()
    assert lines[:4] == ["# manoeuvre: weave", "# speed_kph: 100.0", "# cycles: 5", "# mirrored: false"]
    assert lines[4] == "time_s,handwheel_angle_deg,handwheel_torque_Nm,lateral_acceleration_m_s2,yaw_rate_deg_s"
    assert float(lines[130].split(",")[1]) == pytest.approx(0.3 / DEGREE)  # a quarter period on, in degrees
    assert len(lines) == 5 + weave.time.size


@given(
    st.lists(st.floats(), min_size=2, max_size=8).filter(lambda values: not np.isnan(values).all()),
    st.sampled_from([*FILE_UNITS]),
)
def test_round_trip(tmp_path_factory, values, unit):
    """To 1e-12: nothing is lost but the last bit in going to degrees and back."""
    path = tmp_path_factory.getbasetemp() / "round_trip.csv"
    limited = np.clip(values, -1e300, 1e300)
    written = Recording(np.arange(limited.size) / 3, {"some_channel": limited}, {"some_channel": unit})
    write(written, path)
    back = read(path)
    np.testing.assert_array_equal(back.time, written.time)
    np.testing.assert_allclose(back["some_channel"], limited, rtol=1e-12, atol=1e-300)
    assert back.units == written.units


@given(st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(st.characters(codec="utf-8")))
@example("\x1b")
def test_meta_round_trip(tmp_path_factory, value):
    path = tmp_path_factory.getbasetemp() / "meta.csv"
    write(Recording(np.arange(2.0), {}, {}, {"key": value, "other key": "1.5"}), path)
    meta = read(path).meta
    assert meta == {"key": value, "other key": "1.5"}
    assert type(meta["key"]) is type(value)


def test_a_name_that_reads_as_another_unit_is_refused(tmp_path):
    ambiguous = Recording(np.arange(2.0), {"speed_m": np.arange(2.0)}, {"speed_m": "s"})
    for suffix in (".csv", ".mat"):
        with pytest.raises(ValueError, match="channel 'speed_m' in 's' cannot be a column: rename"):
            write(ambiguous, tmp_path / f"a{suffix}")
    assert not list(tmp_path.iterdir())


@needs("asammdf")
def test_a_name_that_reads_as_another_unit_is_kept_where_units_are_apart(tmp_path):
    ambiguous = Recording(np.arange(2.0), {"speed_m": np.arange(2.0)}, {"speed_m": "s"})
    write(ambiguous, tmp_path / "a.mf4")
    assert read(tmp_path / "a.mf4").units == ambiguous.units


@pytest.mark.parametrize("name", ["a,b", "a;b", "a\tb", "a\nb", " a", "(a"])
def test_names_that_no_column_can_have(tmp_path, name):
    channels, units = {name: np.arange(2.0)}, {name: "s"}
    if name == "(a":  # reads back as itself
        write(Recording(np.arange(2.0), channels, units), tmp_path / "a.csv")
        assert list(read(tmp_path / "a.csv").channels) == [name]
    else:
        with pytest.raises(ValueError, match="cannot be a column: rename the channel"):
            write(Recording(np.arange(2.0), channels, units), tmp_path / "a.csv")
    with pytest.raises(ValueError, match="cannot be a variable in MATLAB: rename the channel"):
        write(Recording(np.arange(2.0), channels, units), tmp_path / "a.mat")


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
            patch.setattr("steer_env.recording.csv_file._meta_text", interrupt)
        with pytest.raises(KeyboardInterrupt):
            write(weave, path)
    assert [file.name for file in tmp_path.iterdir()] == ["weave.csv"]
    assert path.read_text() == "old"
    write(weave, path)
    assert path.read_text() != "old"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"no header: expected a line that names the columns, time_s or Time \[s\] among them"),
        (
            "time_s,yaw_rate\n0,1\n1,2\n",
            r"column 'yaw_rate' names no unit; .* \[channels.yaw_rate\] from = \"yaw_rate\", unit = \"...\", with",
        ),
        ("time_s,a_deg,a_m\n0,1,1\n", "'a_deg' and 'a_m' are both 'a': name one of them in a mapping"),
        (
            "time_s|a_deg\n0|1\n1|3\n",
            r"no time among the columns time_s\|a_deg: separate columns by , ",
        ),
        ("time_s,a_deg\n0,1\nnan,2\n", "column 'time_s', wanted as time, has 'nan' in line 3, which is no finite time"),
    ],
)
def test_what_a_file_is_refused_for(tmp_path, text, message):
    path = tmp_path / "run.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=f"run.csv: {message}"):
        read(path)


def test_a_reading_that_is_too_large_for_a_metric_is_refused(tmp_path):
    (tmp_path / "run.csv").write_text("time_s,yaw_rate_deg_s\n0,1\n1,1e308\n")
    with pytest.raises(ValueError, match=r"channel 'yaw_rate', sample 2: expected at most 1e\+60"):
        require_moderate(read(tmp_path / "run.csv"))


def test_a_compressed_file_that_was_cut_is_refused(tmp_path):
    path = tmp_path / "run.csv.gz"
    path.write_bytes(gzip.compress(b"time_s,a_deg\n" + b"".join(b"%d,1\n" % k for k in range(5000)))[:-40])
    with pytest.raises(ValueError, match=r"run\.csv\.gz: cannot be unpacked by gzip .*; is it complete"):
        read(path)


def test_a_table_from_a_spreadsheet_is_read(tmp_path):
    """Byte-order mark, Windows line ends, spaces, no meta."""
    path = tmp_path / "run.csv"
    path.write_bytes("\ufefftime_s, handwheel_angle_deg\r\n0, 180\r\n0.5, -90\r\n".encode())
    np.testing.assert_allclose(read(path)["handwheel_angle"], [np.pi, -np.pi / 2])
