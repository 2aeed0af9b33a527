"""Spellings of units in files."""

import numpy as np
import pytest

from steer_env.recording.units import FILE_UNITS, file_unit, split, understood


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
        assert understood(text) == (unit, pytest.approx(size, rel=1e-12)), text
        assert understood(f" {text} ") == understood(text)


def test_the_spelling_with_a_space():
    assert understood("N m") == ("N m", 1.0)


@pytest.mark.parametrize("text", ["", " ", "furlong", "MS", "nm", "M", "deg/h", "rad s"])
def test_what_is_not_understood(text):
    assert understood(text) is None


@pytest.mark.parametrize("unit", FILE_UNITS)
def test_both_forms_of_every_unit_of_a_recording(unit):
    suffix, size = FILE_UNITS[unit]
    assert understood(suffix) == understood(file_unit(unit)) == (unit, size)
    assert understood(unit) == (unit, 1.0)
    assert split(f"some_channel_{suffix}") == ("some_channel", suffix)


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
    assert split(column) == expected
