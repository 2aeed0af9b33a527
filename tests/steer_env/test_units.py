"""Spellings of units in files."""

import numpy as np
import pytest

from steer_env.recording import table
from steer_env.recording.files import read
from steer_env.recording.units import FILE_UNITS, file_unit, parse_unit, split_unit


@pytest.mark.parametrize(
    ("spellings", "unit", "size"),
    [
        ("deg ° º degree DEG Deg", "rad", np.pi / 180),
        ("rad RAD", "rad", 1.0),
        ("deg/s °/s deg_s Deg/s", "rad/s", np.pi / 180),
        ("rad/s", "rad/s", 1.0),
        ("deg/s^2 deg/s² deg_s2 °/s²", "rad/s2", np.pi / 180),
        ("Nm N*m N·m N.m", "N m", 1.0),
        ("m/s m_s", "m/s", 1.0),
        ("km/h kmh kph KM/H", "m/s", 1 / 3.6),
        ("m/s^2 m/s² m/s**2 m_s2 m/s/s", "m/s2", 1.0),
        ("g", "m/s2", 9.80665),
        ("mm", "m", 1e-3),
        ("kN", "N", 1e3),
        ("ms", "s", 1e-3),
        ("%", "1", 0.01),
        ("- 1", "1", 1.0),
    ],
)
def test_spellings(spellings, unit, size):
    for text in spellings.split():
        assert parse_unit(text) == (unit, pytest.approx(size, rel=1e-12)), text
        assert parse_unit(f" {text} ") == parse_unit(text)


def test_the_spelling_with_a_space():
    assert parse_unit("N m") == ("N m", 1.0)


@pytest.mark.parametrize("text", ["", " ", "furlong", "MS", "nm", "M", "deg/h", "rad s"])
def test_unknown_spellings(text):
    assert parse_unit(text) is None


@pytest.mark.parametrize("unit", FILE_UNITS)
def test_both_forms_of_every_unit_of_a_recording(unit):
    suffix, size = FILE_UNITS[unit]
    assert parse_unit(suffix) == parse_unit(file_unit(unit)) == (unit, size)
    assert parse_unit(unit) == (unit, 1.0)
    assert split_unit(f"some_channel_{suffix}") == ("some_channel", suffix)


@pytest.mark.parametrize(
    ("column", "expected"),
    [
        ("SWA [deg]", ("SWA", "deg")),
        ("SWA(furlong)", ("SWA", "furlong")),
        ("SWA []", ("SWA", "")),
        ("wheel speed (front) [km/h]", ("wheel speed (front)", "km/h")),
        ("v_km_h", ("v", "km_h")),
        ("travel_mm", ("travel", "mm")),
        ("yaw_rate", ("yaw_rate", None)),
        ("_deg", ("_deg", None)),
        ("", ("", None)),
    ],
)
def test_names_and_units_of_columns(column, expected):
    assert split_unit(column) == expected


@pytest.mark.parametrize(
    "header", ["Time [s],yaw_rate [deg/s],v [m/s]\n", "time_s,yaw_rate_deg_s,v_m_s\n", "Time,yaw_rate,v\ns,deg/s,m/s\n"]
)
def test_the_unit_of_a_column_is_parsed_once(tmp_path, monkeypatch, header):
    parsed = []
    monkeypatch.setattr(table, "parse_unit", lambda text: parsed.append(text) or parse_unit(text))
    (tmp_path / "run.csv").write_text(f"{header}0,1,2\n0.01,1,2\n")
    assert read(tmp_path / "run.csv").units == {"yaw_rate": "rad/s", "v": "m/s"}
    assert [text.replace("_", "/") for text in parsed] == ["s", "deg/s", "m/s"]
