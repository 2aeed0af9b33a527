"""Files as test benches write them: a time without a unit, a preamble above the header; the template of a mapping."""

import re

import numpy as np
import pytest
from scipy import io

from steer_env.experiments.cli.main import main
from steer_env.recording import channel_mapping
from steer_env.recording.files import read
from tests.steer_env.recorded import mapped, refusal


@pytest.mark.parametrize("name", ["time", "t", "Time", "T"])
def test_a_time_without_a_unit_is_in_seconds_and_told(name, tmp_path, capsys):
    path = tmp_path / "run.csv"
    path.write_text(f"{name},yaw_rate_deg_s\n0.00,0\n0.01,1\n0.02,0\n")
    found = read(path)
    np.testing.assert_allclose(found.time, [0.0, 0.01, 0.02])
    assert found.meta == {"seconds_assumed": name}
    assert read(path, mapped(f"time={name}")).meta == found.meta
    in_ms = read(path, mapped(f"time={name}[ms]"))
    np.testing.assert_allclose(in_ms.time, [0.0, 1e-5, 2e-5])
    assert in_ms.meta == {}
    main(["evaluate", str(path), "--manoeuvre", "weave"])
    assert f"run.csv: without a unit, read in seconds: {name}\n" in capsys.readouterr().out


def test_a_matlab_file_too(tmp_path):
    io.savemat(tmp_path / "run.mat", {"time": np.arange(3) / 100, "yaw_rate_deg_s": np.arange(3.0)})
    found = read(tmp_path / "run.mat")
    assert found.time[1] == 0.01
    assert found.meta == {"seconds_assumed": "time"}


def test_steps_that_are_no_seconds_and_other_units_are_refused(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time,yaw_rate_deg_s\n0,0\n10,1\n20,0\n")
    text = refusal(path)
    assert "column 'time' names no unit, and its steps of 10 are too long for seconds" in text
    assert '[channels.time] from = "time", unit = "ms" (or "us", "s")' in text
    assert read(path, mapped("time=time[s]")).time[1] == 10.0
    path.write_text("Stamp,yaw_rate_deg_s\n0,0\n0.01,1\n")
    assert refusal(path, mapped("time=Stamp")).endswith("with one of s, ms, us")
    path.write_text("time_s,yaw_rate\n0,0\n0.01,1\n")
    allowed = refusal(path).rpartition("with one of ")[2].split(", ")
    assert {"deg/s", "rad/s", "counts"} <= set(allowed)
    assert not {"N", "m", "deg", "kW"} & set(allowed)


PREAMBLE = "Prüfstand: Fahrversuch 12\nDatum: 01.02.2026; Fahrer: A, B\n\n"


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
@pytest.mark.parametrize(
    "table",
    [
        "Zeit;Gierrate;Status\ns;°/s;-\n0,0;1,5;\n0,01;2,5;1\n",
        "Zeit [s];Gierrate [°/s];Status;\n0,0;1,5;;\n0,01;2,5;1;\n",
        "t,Gierrate [deg/s]\n0.0,1.5\n0.01,2.5\n",
    ],
)
def test_a_preamble_is_kept_as_a_comment(table, encoding, tmp_path):
    path = tmp_path / "run.csv"
    path.write_bytes(("# manoeuvre: weave\n# Bench 3\n" + PREAMBLE + table).encode(encoding))
    found = read(path)
    np.testing.assert_allclose(found["Gierrate"], np.radians([1.5, 2.5]))
    np.testing.assert_allclose(found.time, [0.0, 0.01])
    assert found.meta["manoeuvre"] == "weave"
    assert found.meta["comment"] == "\n".join(["Bench 3", *PREAMBLE.split("\n")[:2]])


@pytest.mark.parametrize(
    "text",
    [
        PREAMBLE + "Stamp;Gierrate [°/s]\n0,0;1,5\n0,01;2,5\n",  # names no time
        PREAMBLE + "Zeit [s];Gierrate [°/s]\nnull;eins\n0,0;1,5\n0,01;2,5\n",  # no numbers under it
        PREAMBLE + "Zeit [s];Gierrate [°/s]\n0,0\n0,01;2,5\n",  # a row that is too short
        "Bench\n" * 50 + "Zeit [s];Gierrate [°/s]\n0,0;1,5\n0,01;2,5\n",
    ],
)
def test_what_is_no_preamble_is_refused(text, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(text)
    assert "no time among the columns" in refusal(path)


def test_fifty_lines_are_looked_at(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("Bench\n" * 49 + "Zeit [s];Gierrate [°/s]\n0,0;1,5\n0,01;2,5\n")
    assert read(path).time[1] == 0.01


def sections(path):
    """The columns that a template offers by channel, and its units."""
    text = path.read_text()
    found = {}
    for part in text.split("\n\n"):
        if match := re.match(r"# \[channels\.(\w+)\]", part):
            found[match[1]] = (
                re.findall(r'^# from = "(.*?)"', part, re.M),
                re.search(r'^# unit = "(.*)"', part, re.M)[1],
            )
    return found


def test_a_template_offers_each_column_once_with_its_own_unit(tmp_path):
    names = {
        "time": 0.01,
        "Steering_SWA_deg": 1.0,
        "SWT_Nm": 1.0,
        "V_km_h": 1.0,
        "AY": 1.0,
        "Yaw_deg_s": 1.0,
        "Roll_deg": 1.0,
        "Steering_Angle_Rate_deg_s": 1.0,
        "Accel_X_m_s2": 1.0,
    }
    io.savemat(tmp_path / "run.mat", {name: size * np.arange(3) for name, size in names.items()})
    out = tmp_path / "map.toml"
    assert main(["evaluate", str(tmp_path / "run.mat"), "--template", str(out)]) == 0
    assert sections(out) == {
        "time": (["time"], "s"),
        "handwheel_angle": (["Steering_SWA_deg"], "deg"),
        "handwheel_torque": (["SWT_Nm"], "Nm"),
        "vehicle_speed": (["V_km_h"], "km/h"),
        "lateral_acceleration": (["AY", "Accel_X_m_s2"], "m/s2"),
        "yaw_rate": (["Yaw_deg_s"], "deg/s"),
        "handwheel_speed": (["Steering_Angle_Rate_deg_s"], "deg/s"),
        "roll_angle": (["Roll_deg"], "deg"),
        "sideslip_angle": ([""], "deg"),
    }
    assert '# "V_km_h": km/h, 0 to 2' in out.read_text()


def test_a_filled_in_template_is_a_mapping(tmp_path):
    path, out = tmp_path / "run.csv", tmp_path / "map.toml"
    path.write_text("Stamp;V [km/h];SWA\n0;36;1\n10;72;2\n")
    text = "no time among the columns Stamp"
    assert text in refusal(path)
    path.write_text("t;V [km/h];SWA\n0;36;1\n10;72;2\n")
    assert main(["evaluate", str(path), "--template", str(out)]) == 0
    filled = [line.removeprefix("# ") for line in out.read_text().splitlines()]
    start, end = filled.index("[channels.time]"), filled.index("[channels.lateral_acceleration]")
    out.write_text("\n".join(filled[start:end]).replace('unit = "s"', 'unit = "ms"').replace('from = ""\n', ""))
    channels = channel_mapping.load(out).channels
    assert channels["vehicle_speed"].unit == "km/h"
    out.write_text(out.read_text().partition("[channels.handwheel_torque]")[0])
    found = read(path, out)
    np.testing.assert_allclose(found.time, [0.0, 0.01])
    np.testing.assert_allclose(np.degrees(found["handwheel_angle"]), [1.0, 2.0])
