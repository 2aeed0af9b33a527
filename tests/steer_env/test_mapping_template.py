"""The template of a mapping, which lists the columns of a file and offers each for the channel that it may be."""

import re

import numpy as np
import pytest
from scipy import io

from steer_env.experiments.cli.main import main
from steer_env.recording import can_log, channel_mapping
from steer_env.recording.files import read
from tests.needs import needs


def sections(path):
    """The columns that a template offers by channel, and its units."""
    text = path.read_text()
    found = {}
    for part in text.split("\n\n"):
        if match := re.match(r"(?:# )?\[channels\.(\w+)\]", part):
            found[match[1]] = (
                re.findall(r'^(?:# )?from = "(.*?)"', part, re.M),
                re.search(r'^(?:# )?unit = "(.*)"', part, re.M)[1],
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
    guessed = channel_mapping.load(out).channels  # "Steering_SWA" is not clear, and neither is "time" without a unit
    assert {name: channel.source for name, channel in guessed.items()} == {
        "handwheel_torque": "SWT_Nm",
        "vehicle_speed": "V_km_h",
        "yaw_rate": "Yaw_deg_s",
        "handwheel_speed": "Steering_Angle_Rate_deg_s",
        "roll_angle": "Roll_deg",
    }


def test_a_filled_in_template_is_a_mapping(tmp_path):
    path, out = tmp_path / "run.csv", tmp_path / "map.toml"
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


def test_german_abbreviations_are_guessed(tmp_path):
    names = {
        "handwheel_angle": "LRW [°]",
        "handwheel_torque": "LRM [Nm]",
        "vehicle_speed": "v_Fzg [km/h]",
        "lateral_acceleration": "Querbeschl [m/s²]",
        "yaw_rate": "Gierwinkelgeschwindigkeit [°/s]",
    }
    path, out = tmp_path / "fahrt.csv", tmp_path / "map.toml"
    path.write_text(";".join(("Zeit [s]", *names.values())) + "\n" + "0;1;1;1;1;1\n1;2;2;2;2;2\n", encoding="latin-1")
    assert main(["evaluate", str(path), "--template", str(out)]) == 0
    found = channel_mapping.load(out).channels
    assert {name: channel.source for name, channel in found.items()} == {"time": "Zeit [s]", **names}


def test_what_is_clear_is_guessed(tmp_path):
    """A German file is read as its template comes; a column that names no unit is left to the reader."""
    path, out = tmp_path / "fahrt.csv", tmp_path / "map.toml"
    path.write_text("Zeit [s];Lenkradwinkel [deg];Lenkmoment;Geschwindigkeit [km/h]\n0,00;1,0;5;36\n0,02;2,0;6;72\n")
    assert main(["evaluate", str(path), "--template", str(out)]) == 0
    found = read(path, out)
    assert set(found.channels) == {"handwheel_angle", "vehicle_speed"}
    np.testing.assert_allclose(found["vehicle_speed"], [10.0, 20.0])


CAN = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 256 LWI: 8 A
 SG_ LWI_Lenkradwinkel : 0|13@1+ (0.1,0) [0|800] "deg" A
 SG_ LWI_VZ_Lenkradwinkel : 13|1@1+ (1,0) [0|1] "" A
 SG_ CR_Mdps_StrColTq : 16|11@1+ (1,-1024) [0|0] "" A
BO_ 257 ESP: 8 A
 SG_ YAW_RATE : 0|16@1- (0.01,0) [0|0] "deg/s" A
"""


@needs("can", "cantools")
@pytest.mark.parametrize(("names", "negative"), [("", 1), ('VAL_ 256 LWI_VZ_Lenkradwinkel 1 "plus" 0 "minus" ;\n', 0)])
def test_sign_and_torque_of_a_can_log_are_proposed(tmp_path, names, negative):
    """The signal of the sign with the angle, and the size of a torque whose database has no unit."""
    log, dbc, out = (tmp_path / name for name in ("drive.log", "car.dbc", "map.toml"))
    dbc.write_text(CAN + names)
    lines = []
    for k in range(400):
        angle = float(30 * np.sin(k / 20))
        bits = round(abs(angle) * 10) | ((angle < 0) == negative) << 13 | (1024 + k) << 16
        yaw = round(-angle * 20) % 65536
        lines += [f"({0.01 * k:.6f}) can0 100#{bits.to_bytes(8, 'little').hex()}"]
        lines += [f"({0.01 * k + 0.001:.6f}) can0 101#{yaw.to_bytes(2, 'little').hex()}{'00' * 6}"]
    log.write_text("\n".join(lines) + "\n")
    assert main(["evaluate", str(log), "--dbc", str(dbc), "--template", str(out)]) == 0
    text = out.read_text()
    assert "\n# scale = 0.01  #" in text
    assert f"  # {negative} where the reading is negative; check it" in text
    assert "yaw_rate: -1.00, so one of the two needs sign = -1" in text  # of the angle with its sign
    guessed = channel_mapping.load(out).channels
    assert guessed["handwheel_angle"].sign_from == "LWI.LWI_VZ_Lenkradwinkel"
    found = read(log, out, can=can_log.Options(dbc))
    assert np.degrees(found["handwheel_angle"]).min() < -29


@pytest.mark.parametrize(("size", "told"), [(2, "their signs are the same"), (-2, "one of the two needs sign = -1")])
def test_the_sign_of_the_angle_is_checked_against_the_yaw_rate(tmp_path, size, told):
    path, out = tmp_path / "run.csv", tmp_path / "map.toml"
    rows = [f"{k / 100},{np.sin(k / 20):.6f},{size * np.sin(k / 20 - 0.3):.6f}" for k in range(400)]
    path.write_text("\n".join(["time [s],steering wheel angle [deg],Yaw [deg/s]", *rows]) + "\n")
    assert main(["evaluate", str(path), "--template", str(out)]) == 0
    (line,) = (line for line in out.read_text().splitlines() if "correlation" in line)
    assert told in line
    correlation = float(re.search(r"-?\d\.\d\d", line.rpartition("yaw_rate")[2])[0])
    assert correlation == pytest.approx(np.sign(size) * np.cos(0.3), abs=0.02)
