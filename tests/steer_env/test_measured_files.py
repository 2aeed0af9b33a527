"""Measured files: other names, units, separators, signs, delays and rasters, and what is refused for what reason."""

import re
import sys

import asammdf
import numpy as np
import pytest
from scipy import io

from steer_env import metrics
from steer_env.recording import channel_mapping
from steer_env.recording.files import read, write
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle.constants import GRAVITY
from tests.steer_env.recorded import made_weave, mapped, refusal

weave = pytest.fixture(made_weave)


# Text from elsewhere


@pytest.mark.parametrize(
    "text",
    [
        "Time [s];SWA [deg];v [km/h]\n0,0;-90,5;36\n0,5;90;72,0\n",
        "Time [ms]\tSWA [°]\tv [km/h]\n0\t-90.5\t36\n500\t90\t72\n",
        "t_s,SWA_deg,v_kmh\r\n0.0,-90.5,36\r\n0.5,90,72\r\n",
        '"Time (s)","SWA (deg)","v (km/h)"\n0,-90.5,36\n.5,9.0e1,72\n\n',
        "Zeit [s];SWA [Deg];v [km/h];\n0;-90,5;36;\n0,5;90;72;\n",
        "SWA [°];v [m/s];Time [s]\n-90,5;10;0\n90;20;0,5\n",
        "Time [s],SWA [deg],Status,v [km/h]\n0,-90.5,ok,36\n0.5,90,bad,72\n",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_a_table_from_elsewhere(tmp_path, text, encoding):
    path = tmp_path / "run.csv"
    path.write_bytes(text.encode(encoding))
    for found, swa, speed in (
        (read(path), "SWA", "v"),
        (read(path, mapped("handwheel_angle=SWA", "vehicle_speed=v")), "handwheel_angle", "vehicle_speed"),
    ):
        assert set(found.channels) == {swa, speed}
        np.testing.assert_allclose(found.time, [0.0, 0.5])
        np.testing.assert_allclose(found[swa], [-90.5 * DEGREE, np.pi / 2])
        np.testing.assert_allclose(found[speed], [10.0, 20.0])
    assert read(path).meta == ({"not_read": "Status"} if "Status" in text else {})


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_empty_cells_are_gaps(tmp_path, separator):
    rows = [["Time [s]", "a [m]", "b [m]"], ["0", "", "1"], ["1", "2", " "], ["2", "", ""], ["3", "5", "nan"]]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(separator.join(row) for row in rows) + "\n")
    found = read(path)
    np.testing.assert_array_equal(found["a"], [np.nan, 2, np.nan, 5])
    np.testing.assert_array_equal(found["b"], [1, np.nan, np.nan, np.nan])


def test_gaps_beside_decimal_commas(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("Time [s];a [m];b [m];\n0,0;;1;\n0,5;1,5;;\n\n1;;;\n")
    found = read(path)
    np.testing.assert_array_equal(found.time, [0, 0.5, 1])
    np.testing.assert_array_equal(found["a"], [np.nan, 1.5, np.nan])
    np.testing.assert_array_equal(found["b"], [1, np.nan, np.nan])


def test_a_text_that_only_python_takes_for_a_number(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time_s,a_m,b_m\n0,1_0,0\n1,2,1\n")
    assert read(path).meta["not_read"] == "a_m"
    assert "has '1_0' in line 2, which is no number" in refusal(path, mapped("own_a=a[m]"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "Time [s];SWA [deg]\n0,1;1\n0,0;2\n",
            "in line 3, which is no finite time that does not go back",
        ),
        (
            "Time [s];yaw_rate [deg/s]\n0,0;1\n\n1,0;1-2\n",
            "column 'yaw_rate [deg/s]', wanted as yaw_rate, has '1-2' in line 4",
        ),
        ("Time [s],SWA [deg]\n0,0,1\n0,5,2\n", "line 2, column 'SWA [deg]': expected 2 values separated by ',', got 3"),
        ("Time [s];SWA [deg]\n0\t1\n1\t2\n", "line 2, column 'SWA [deg]': expected 2 values separated by ';', got 1"),
        ("Time [h];SWA [deg]\n0;1\n1;2\n", "column 'Time [h]' has the unit 'h', which is not known; give it in a"),
        ("Time [deg];SWA [deg]\n0;1\n1;2\n", "column 'Time [deg]' is in 'deg', time needs 's'"),
        ("Zeit,SWA\n0,1\n1,2\n", "no time among the columns Zeit, SWA: expected time_s or Time [s], or a mapping"),
        (
            "Time [s],SWA [deg]\ns,rad\n0,1\n1,2\n",
            "line 2, column 'SWA [deg]': the row of units says 'rad', the header says 'deg': correct one of them",
        ),
        ("Time,SWA\ns,furlong\n0,1\n1,2\n", "none of the columns SWA can be read"),
        ("Time [s],SWA [deg]\n0,x\ns,deg\n", "in line 3, which is no finite time that does not go back"),
    ],
)
def test_text_that_is_refused(tmp_path, text, message):
    path = tmp_path / "run.csv"
    path.write_text(text)
    assert message in refusal(path)


def test_bytes_that_are_no_text_are_refused_and_not_printed(tmp_path):
    path = tmp_path / "run.csv"
    path.write_bytes(np.random.default_rng(1).bytes(3000))
    told = refusal(path)
    assert "no table: it begins with bytes that are no text" in told
    assert len(told) < 200
    assert told.isprintable()


def test_columns_that_are_not_read_are_not_looked_into_but_counted(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time_s,yaw_rate_deg_s,Status\n0,1,ok\n1,2,b,ad\n")
    assert "line 3, column 'Status': expected 3 values" in refusal(path)


# Mappings at work


def test_a_mapping_makes_a_measured_file_the_same_as_a_simulated_one(weave, tmp_path):
    """Signs against ours, other units, the sensor's zero and delay: the metrics are those of the original."""
    columns = [
        weave.time * 1e3,
        -weave["handwheel_angle"] / DEGREE + 0.3,
        weave["handwheel_torque"],
        np.interp(weave.time - 0.05, weave.time, weave["lateral_acceleration"]) / GRAVITY,  # 50 ms late
        weave["yaw_rate"],
    ]
    path = tmp_path / "measured.csv"
    header = "Stamp,SteeringWheelAngle,Torque [Nm],Ay,Gyro [deg/s]"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.17g")
    toml = tmp_path / "map.toml"
    toml.write_text(
        """
        [channels.time]
        from = "Stamp"
        unit = "ms"
        [channels.handwheel_angle]
        from = "SteeringWheelAngle"
        unit = "deg"
        sign = -1
        offset = 0.3
        [channels.handwheel_torque]
        from = "Torque"
        [channels.lateral_acceleration]
        from = "Ay"
        unit = "g"
        delay_ms = 50
        [channels.yaw_rate]
        from = "Gyro [deg/s]"
        unit = "rad/s"
        [meta]
        manoeuvre = "weave"
        frequency_hz = 0.2
        """
    )
    found = read(path, toml)
    assert found.meta == {"manoeuvre": "weave", "frequency_hz": 0.2}
    assert found.time[-1] == pytest.approx(49.95)
    cut = weave.between(0.0, 49.951)
    for name, values in cut.channels.items():
        np.testing.assert_allclose(found[name], values, rtol=1e-9, atol=1e-12)
    for name, value in metrics.evaluate(cut, "weave").items():
        np.testing.assert_allclose(metrics.evaluate(found, "weave")[name][:3], value[:3], rtol=1e-6, atol=1e-9)
    swapped = read(
        path, channel_mapping.load(toml).with_entries([channel_mapping.parse_entry("yaw_rate=Gyro[rad/s],sign=-1")])
    )
    np.testing.assert_array_equal(swapped["yaw_rate"], -found["yaw_rate"])
    assert (
        "yaw_rate does not follow handwheel_angle: check the signs"
        in metrics.evaluate(swapped, "weave")["yaw_lag"].reason
    )


def test_the_offset_is_a_reading_of_the_sensor(tmp_path):
    """It is in the file's unit and comes off before the sign is turned and the scale applied."""
    path = tmp_path / "run.csv"
    path.write_text("time_s,a_deg\n0,10\n1,12\n")
    found = read(path, mapped("handwheel_angle=a[deg],sign=-1,offset=10,scale=1.5"))
    np.testing.assert_allclose(found["handwheel_angle"], [0.0, -3 * DEGREE], atol=1e-15)


def test_an_uncalibrated_channel_is_in_counts_and_its_metrics_are_refused(weave, tmp_path):
    path = tmp_path / "run.csv"
    write(weave, path)
    path.write_text(path.read_text().replace("handwheel_torque_Nm", "Torque"))
    found = read(path, mapped("handwheel_torque=Torque[counts]", manoeuvre="weave", frequency_hz=0.2))
    assert found.units["handwheel_torque"] == "counts"
    assert found.meta["uncalibrated"] == "handwheel_torque"
    values = metrics.evaluate(found)
    assert (
        "handwheel_torque is in counts of its sensor, uncalibrated: give the N m of a count"
        in values["torque_gradient_at_0g"].reason
    )
    plain = metrics.evaluate(weave, "weave", frequency_hz=0.2)
    assert values["yaw_rate_gain"].value == pytest.approx(plain["yaw_rate_gain"].value, rel=1e-9)
    write(found, path)
    assert read(path).units["handwheel_torque"] == "counts"
    calibrated = read(path.with_name("run.csv"), mapped("handwheel_torque=handwheel_torque[counts],scale=2"))
    np.testing.assert_allclose(calibrated["handwheel_torque"], 2 * weave["handwheel_torque"])


@pytest.mark.parametrize(
    ("header", "refused"), [("SWA [Nm]", True), ("SWA (Nm)", True), ("SWA [rad]", False), ("SWA_1", False)]
)
def test_units_that_contradict(tmp_path, header, refused):
    """A mapping corrects the size of a unit, not the quantity; the end of a name may only look like a unit."""
    path = tmp_path / "run.csv"
    path.write_text(f"time_s,{header}\n0,1\n1,2\n")
    entry = mapped(f"handwheel_angle={header}[deg]")
    if refused:
        assert "is in 'Nm' by the file, but in 'deg' by the mapping: these are of different quantities; map ano" in (
            refusal(path, entry)
        )
    else:
        np.testing.assert_allclose(read(path, entry)["handwheel_angle"], [DEGREE, 2 * DEGREE])


def test_a_mapping_reads_what_it_names_and_known_channels(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("# manoeuvre: ramp\ntime_s,yaw_rate_deg_s,a_deg,b_m,c_Nm\n0,1,2,3,4\n1,2,3,4,5\n")
    found = read(path, mapped("handwheel_angle=a", "own_travel=b[mm]", manoeuvre="weave"))
    assert found.units == {"handwheel_angle": "rad", "own_travel": "m", "yaw_rate": "rad/s"}
    np.testing.assert_allclose(found["own_travel"], [0.003, 0.004])
    assert found.meta == {"manoeuvre": "weave"}
    assert set(read(path, mapped("yaw_rate=a[deg/s]")).channels) == {"yaw_rate"}  # in place of the file's own
    assert set(read(path, mapped(manoeuvre="weave")).channels) == {"yaw_rate", "a", "b", "c"}
    np.testing.assert_allclose(read(path, mapped("yaw_rate=,sign=-1"))["yaw_rate"], [-DEGREE, -2 * DEGREE])


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("handwheel_angle=SWE", "no channel 'SWE' for handwheel_angle; did you mean SWA?"),
        ("handwheel_angle=Lenkrad", "no channel 'Lenkrad' for handwheel_angle; there are Time, SWA, Torque, T"),
        ("handwheel_angle=SWA", "'SWA' for handwheel_angle may be any of SWA [deg], SWA [rad]: give its unit"),
        (
            "handwheel_angle=Torque",
            "column 'Torque' names no unit; give it in a mapping, [channels.handwheel_angle] from",
        ),
        (
            channel_mapping.Entry("yaw_rate", "SWA [deg]", None),
            "column 'SWA [deg]' is in 'deg', yaw_rate needs 'rad/s': correct it, [channels.yaw_rate]",
        ),
        ("handwheel_torque=Torque[Nm],delay_ms=9000", "delay of 'handwheel_torque' is -9 s; of 1 s in all, fewer than"),
    ],
)
def test_mappings_that_do_not_fit_the_file(tmp_path, entry, message):
    path = tmp_path / "run.csv"
    path.write_text("Time [s];SWA [deg];SWA [rad];Torque;T [K]\n0;1;1;1;1\n1;2;2;1;1\n")
    given = mapped(entry) if isinstance(entry, str) else channel_mapping.Mapping().with_entries([entry])
    assert message in refusal(path, given)
    assert set(read(path, mapped("handwheel_angle=SWA[rad]")).channels) == {"handwheel_angle"}


# MDF


def mdf(path, *groups, version="4.10"):
    """A file with a group for each list of signals."""
    with asammdf.MDF(version=version) as file:
        for signals in groups:
            file.append(signals)
        file.save(path, overwrite=True)
    return path


def signal(name, time, values, unit="", **more):
    return asammdf.Signal(np.asarray(values), np.asarray(time, dtype=float), unit=unit, name=name, **more)


def test_other_programs_read_our_mdf(weave, tmp_path):
    write(weave, tmp_path / "weave.mf4")
    with asammdf.MDF(tmp_path / "weave.mf4") as file:
        angle = file.get("handwheel_angle")
    assert angle.unit == "deg"
    assert angle.samples.dtype == np.float64
    np.testing.assert_allclose(angle.samples * DEGREE, weave["handwheel_angle"], rtol=1e-15)


def test_groups_of_other_rasters_come_to_one_time(tmp_path):
    """The time is that of the channel with the most samples, as far as all have any; a line is kept by lines."""
    fast, slow = np.arange(101) / 100, 0.025 + np.arange(9) / 10
    path = mdf(
        tmp_path / "run.mf4",
        [signal("SWA", slow, 20 * slow + 1, "deg"), signal("Temperature", slow, slow, "degC")],
        [signal("Gyro", fast, np.round(1e3 * np.sin(fast)).astype(np.int16), "rad/s")],
    )
    found = read(path)
    np.testing.assert_array_equal(found.time, fast[3:83])
    np.testing.assert_allclose(found["SWA"], (20 * found.time + 1) * DEGREE)
    np.testing.assert_array_equal(found["Gyro"], np.round(1e3 * np.sin(found.time)))
    assert found.units == {"SWA": "rad", "Gyro": "rad/s"}
    assert found.meta == {"not_read": "Temperature"}


def test_a_drop_out_of_a_slow_group_is_a_gap(tmp_path):
    fast, slow = np.arange(101) / 100, np.delete(np.arange(11) / 10, [4, 5])
    found = read(
        mdf(tmp_path / "run.mf4", [signal("SWA", slow, slow, "rad")], [signal("v", fast, 36 * fast, "km/h")]),
        mapped("handwheel_angle=SWA", "vehicle_speed=v", speed_m_s=10),
    )
    gap = (found.time > 0.3) & (found.time < 0.6)
    np.testing.assert_array_equal(np.isnan(found["handwheel_angle"]), gap)
    np.testing.assert_allclose(found["handwheel_angle"][~gap], found.time[~gap], atol=1e-12)
    np.testing.assert_allclose(found["vehicle_speed"], 10 * fast)
    with pytest.raises(ValueError, match=r"'handwheel_angle' has a gap from 0.3 to 0.6 s: 0.29 s"):
        found.bridged()


def test_samples_marked_invalid_are_gaps(tmp_path):
    time, invalid = np.arange(11) / 10, np.arange(11) == 4
    path = mdf(tmp_path / "run.mf4", [signal("SWA", time, time, "rad", invalidation_bits=invalid)])
    np.testing.assert_array_equal(np.isnan(read(path)["SWA"]), invalid)


@pytest.mark.parametrize("lost", [np.arange(101) % 2 == 1, np.abs(np.arange(101) - 50) < 3])
def test_nothing_is_interpolated_through_invalid_samples_of_another_raster(tmp_path, lost):
    """Neither where a block is invalid nor where every other sample is: only instants of valid samples have values."""
    slow, fast = np.arange(101) / 100, np.arange(201) / 200
    groups = [signal("SWA", slow, slow, "rad", invalidation_bits=lost)], [signal("v", fast, fast, "m/s")]
    found = read(mdf(tmp_path / "run.mf4", *groups))
    np.testing.assert_array_equal(np.isnan(found["SWA"]), np.interp(fast, slow, lost) > 1e-9)
    assert found.meta["no_value"] == {"SWA": {"marked invalid": np.count_nonzero(lost)}}


def test_a_name_in_two_groups_bears_the_number_of_its_group(tmp_path):
    time = np.arange(11) / 10
    path = mdf(tmp_path / "run.mf4", *([signal("SWA", time, k * time, "rad")] for k in (1, 2)))
    assert "no channel 'SWA' for handwheel_angle; there are SWA (group 0), SW" in refusal(
        path, mapped("handwheel_angle=SWA")
    )
    np.testing.assert_array_equal(read(path, mapped("handwheel_angle=SWA (group 1)"))["handwheel_angle"], 2 * time)
    assert set(read(path).channels) == {"SWA (group 0)", "SWA (group 1)"}


def test_mdf_3_is_read(tmp_path):
    time = np.arange(11) / 10
    path = mdf(tmp_path / "run.mdf", [signal("SWA", time, time, "deg")], version="3.30")
    np.testing.assert_allclose(read(tmp_path / path.name)["SWA"], time * DEGREE)


def test_mdf_that_is_refused(tmp_path):
    time = np.arange(11) / 10
    numbers = signal("SWA", time, time, "deg")
    path = tmp_path / "run.mf4"
    mdf(path, [signal("yaw_rate", time, time, "bananas")])
    assert "column 'yaw_rate' has the unit 'bananas', which is not known; give it in a mapping" in refusal(path)
    mdf(path, [numbers])
    assert "no channel 'Torque' for handwheel_torque" in refusal(path, mapped("handwheel_torque=Torque"))
    assert "this format has a time base of its own: remove [channels.time]" in refusal(path, mapped("time=t[s]"))
    mdf(path, [signal("SWA", [0, 0.1, 0.05], [1.0, 2.0, 3.0], "deg")])
    assert "the time of 'SWA' must be finite and not go back; sample 2 is 0.05 s after 0.1 s" in refusal(path)
    mdf(path, [numbers], [signal("v", time + 5, time, "m/s")])
    assert "'v' begins at 5 s, 'SWA' ends at 1 s: the channels have no time in common" in refusal(path)
    mdf(path, [numbers], [signal("Gear", time, np.array([b"first"] * 11), encoding="utf-8")])
    assert "column 'Gear', wanted as own_gear, holds no plain numbers" in refusal(path, mapped("own_gear=Gear[1]"))
    mdf(path, [signal("Force", time, np.array([b"much"] * 11), "N", encoding="utf-8")])
    assert "none of the columns Force can be read: each needs numbers and a unit (deg, " in refusal(path)
    mdf(path, [numbers], [signal("v", [0.5], [10.0], "m/s")])
    assert read(path).meta == {"not_read": "v"}
    assert "column 'v', wanted as vehicle_speed, has 1 samples" in refusal(path, mapped("vehicle_speed=v"))


def test_without_the_extra(weave, tmp_path, monkeypatch):
    write(weave, tmp_path / "weave.mf4")
    monkeypatch.setitem(sys.modules, "asammdf", None)
    assert "MDF files need the package asammdf: pip install '.[mdf]'" in refusal(tmp_path / "weave.mf4")
    with pytest.raises(ValueError, match=r"pip install '.\[mdf\]'"):
        write(weave, tmp_path / "other.mf4")
    assert [file.name for file in tmp_path.iterdir()] == ["weave.mf4"]


def test_mdf_needs_a_channel(tmp_path):
    with pytest.raises(ValueError, match=r"a recording without channels cannot be an MDF file: write \.csv"):
        write(Recording([0.0, 1.0], {}, {}), tmp_path / "run.mf4")


# MATLAB


@pytest.mark.parametrize("shape", ["row", "column"])
@pytest.mark.parametrize("wrap", [lambda c: c, lambda c: {"run": c}, lambda c: {"log": {"run": c}}])
def test_a_matlab_file_from_elsewhere(tmp_path, shape, wrap):
    content = {
        "t_s": np.arange(3.0),
        "SWA_deg": np.array([0, 90, -90], dtype=np.int16),
        "v": np.array([36.0, 72, 36]),
        "car": "compact",
        "other_raster_m": np.arange(5.0),
        "gain": 3.0,
    }
    path = tmp_path / "run.mat"
    io.savemat(path, wrap(content), oned_as=shape)
    found = read(path)
    np.testing.assert_array_equal(found["SWA"], [0, 90 * DEGREE, -90 * DEGREE])
    assert found.meta == {"not_read": "v, other_raster_m"}
    found = read(path, mapped("handwheel_angle=SWA,sign=-1", "vehicle_speed=v[km/h]"))
    np.testing.assert_allclose(found["handwheel_angle"], [0, -np.pi / 2, np.pi / 2])
    np.testing.assert_allclose(found["vehicle_speed"], [10, 20, 10])
    message = "column 'other_raster_m', wanted as x, has 5 samples, time has 3"
    assert message in refusal(path, mapped("x=other_raster"))


def test_a_matlab_file_of_several_structures(tmp_path):
    io.savemat(
        tmp_path / "run.mat", {"time_s": np.arange(3.0), "imu": {"gyro": np.arange(3.0), "sub": {"a_m": [1, 2, 3]}}}
    )
    found = read(tmp_path / "run.mat", mapped("yaw_rate=imu.gyro[deg/s]", "own_travel=imu.sub.a[m]"))
    np.testing.assert_allclose(found["yaw_rate"], np.arange(3) * DEGREE)
    np.testing.assert_array_equal(found["own_travel"], [1, 2, 3])


def test_matlab_files_that_are_refused(tmp_path):
    path = tmp_path / "run.mat"
    io.savemat(path, {"time_s": [0.0, 1.0, 0.5], "yaw_rate_deg_s": np.arange(3.0)})
    assert "the time of 'time_s' must be finite and not go back; sample 2 is 0.5 s after 1.0 s" in refusal(path)
    io.savemat(path, {"text": "nothing"})
    assert "no time among the columns" in refusal(path)


# Damage


@pytest.mark.parametrize("suffix", [".mat", ".mf4", ".parquet"])
@pytest.mark.parametrize("part", [0.0, 0.5])
def test_a_truncated_file_is_refused(weave, tmp_path, suffix, part):
    path = tmp_path / f"run{suffix}"
    write(weave, path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(part * len(whole))])
    assert "is it complete?" in refusal(path)


def test_truncated_text_is_refused(weave, tmp_path):
    path = tmp_path / "run.csv"
    write(weave, path)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:3000]) + lines[3000][:40])
    assert re.search(r"line 3001, column '\w+': expected 5 values separated by ',', got [1-4]", refusal(path))
    path.write_text(lines[0])
    assert "line 2, column 'time_s': expected at least two rows, got 0" in refusal(path)
