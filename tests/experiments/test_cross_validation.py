"""Our two tracks against the stored reference: inputs, marks, table and figure; nothing here needs their package."""

import json
import subprocess
import sys
from functools import cache

import numpy as np
import pytest

from steer_env.experiments.pages import pictures
from steer_env.experiments.studies import cross_validation
from steer_env.experiments.studies.common.commonroad_manoeuvres import (
    MANOEUVRES,
    START,
    STEER_RATE,
    road_wheel_angle,
)
from steer_env.experiments.studies.common.commonroad_reference import PECULIARITIES, load
from steer_env.experiments.studies.cross_validation import MOST_RMS, MOST_STEADY, compare, difference, drive_two_track

STEP = MANOEUVRES["step_20"]._replace(duration=4.0)
comparison = cache(compare)


def test_nothing_needs_their_package():
    modules = "studies.cross_validation", "reports.report", "cli.main"
    imports = ", ".join(f"steer_env.experiments.{name}" for name in modules)
    load = "from steer_env.experiments.studies.common import commonroad_reference; commonroad_reference.load()"
    code = f"import sys; sys.modules['vehiclemodels'] = None; import {imports}; {load}"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", MANOEUVRES)
def test_angle_rate_and_bounds(name):
    manoeuvre = MANOEUVRES[name]
    t = np.linspace(0.0, manoeuvre.duration, 60001)
    angle, rate = road_wheel_angle(manoeuvre, t)
    assert np.abs(angle[t <= START]).max() == 0.0
    assert np.abs(angle).max() == pytest.approx(manoeuvre.amplitude, rel=0.02)
    assert np.abs(rate).max() <= STEER_RATE * (1.0 + 1e-9) < 0.4  # their bound
    smooth = np.abs(t - START) > 0.003  # the circle's ramp starts with a corner
    smooth[[0, -1]] = False
    np.testing.assert_allclose(np.gradient(angle, t)[smooth], rate[smooth], atol=0.01 * np.abs(rate).max())


@pytest.mark.parametrize("name", MANOEUVRES)
def test_two_tracks_keep_the_marks_once_the_named_differences_are_out(name):
    """With room to spare, in fact."""
    result = comparison(name)["reconciled"]
    assert result.passed
    assert max(result.rms.values()) < MOST_RMS / 3.0
    assert max(abs(gap) for *_, gap in result.steady.values()) < MOST_STEADY * 0.75


# Against the model as published [%]: RMS of yaw rate and lateral acceleration, steady yaw rate and roll angle.
PUBLISHED = {
    "step_20": (1.78, 3.76, 2.10, 3.24),
    "step_30": (3.94, 4.37, 4.80, 5.83),
    "sine_20": (1.47, 8.40, 0.50, 11.02),
    "sine_30": (3.55, 8.93, -2.54, 7.08),
    "circle_20": (1.23, 1.24, 2.30, -0.56),
    "circle_30": (2.80, 2.81, 4.96, 1.70),
    "brake_20": (2.83, 3.77, -1.70, 2.06),
    "brake_30": (10.58, 10.12, 16.24, 20.24),
}


@pytest.mark.parametrize("name", MANOEUVRES)
def test_two_tracks_and_the_published_model(name):
    result = comparison(name)["published"]
    steady = (result.steady[key][2] for key in ("yaw_rate", "roll_angle"))
    assert 100.0 * np.array([*result.rms.values(), *steady]) == pytest.approx(PUBLISHED[name], abs=0.1)


def test_two_tracks_are_integrated_tightly_and_relax_at_once():
    p = load().parameters
    base = drive_two_track(p, STEP)
    for other, most in ((drive_two_track(p, STEP, tolerance=1e-8), 1e-4), (drive_two_track(p, STEP, 0.015), 2e-3)):
        for channel in ("yaw_rate", "lateral_acceleration"):
            assert difference(other, base, channel) < most


def test_unknown_kind():
    with pytest.raises(ValueError, match=r"^kind must be step, sine, circle or brake, got 'loop'$"):
        road_wheel_angle(STEP._replace(kind="loop"), 1.0)


def test_table_entries_and_figure():
    results = {name: comparison(name) for name in ("step_30", "brake_30")}
    rows = cross_validation.rows(results)
    assert [row.verdict for row in rows] == ["explained", "pass", "explained", "pass"]
    assert cross_validation.table(results).count("\n") == 3 + len(rows)
    assert cross_validation.extent(results, "published").kept == []
    reconciled = cross_validation.extent(results, "reconciled")
    assert reconciled.kept == ["step_30", "brake_30"]
    assert reconciled.steady < MOST_STEADY < cross_validation.extent(results, "published").steady
    entries = json.loads(json.dumps(cross_validation.entries(results), allow_nan=False))
    given = entries["manoeuvres"]["brake_30"]["published"]
    assert not given["passed"]
    for name, value in given["steady"].items():
        assert name in entries["units"]
        assert value["difference"] == pytest.approx(comparison("brake_30")["published"].steady[name][2])
    svg = pictures.cross_validation(results)
    assert all(text in svg for text in ("step, 30 m/s", "brake, 30 m/s", "CommonRoad reconciled", "yaw rate [deg/s]"))


def test_a_mark_missed_with_everything_out_is_a_failure(monkeypatch, capsys):
    missed = {case: result._replace(rms={"yaw_rate": 0.06}) for case, result in comparison("step_20").items()}
    assert {row.verdict for row in cross_validation.rows({"step_20": missed})} == {"FAIL"}
    for results, code in (({"step_20": missed}, 1), ({"step_20": comparison("step_20")}, 0)):
        monkeypatch.setattr(cross_validation, "collect", lambda results=results: results)
        assert cross_validation.main([]) == code
    assert "| step_20 | reconciled |" in capsys.readouterr().out


def test_peculiarities_are_sentences():
    assert all(text.endswith(".") and text[0].isupper() for text in PECULIARITIES.values())
