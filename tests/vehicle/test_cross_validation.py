"""Our two tracks against the stored reference: inputs and marks; nothing here needs their package."""

from functools import cache

import numpy as np
import pytest

from tests.verification import commonroad as verification
from tests.verification.common.commonroad_manoeuvres import (
    MANOEUVRES,
    START,
    STEER_RATE,
    road_wheel_angle,
)
from tests.verification.common.commonroad_reference import PECULIARITIES, load
from tests.verification.common.cross_validation import MOST_RMS, MOST_STEADY, compare, difference, drive_two_track

STEP = MANOEUVRES["step_20"]._replace(duration=4.0)
comparison = cache(compare)


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


def test_a_mark_missed_with_everything_out_is_a_failure(monkeypatch):
    monkeypatch.setattr(verification, "MANOEUVRES", {"step_30": MANOEUVRES["step_30"]})
    found = comparison("step_30")
    monkeypatch.setattr(verification, "compare", lambda _: found)
    assert [row.verdict for row in verification.rows()] == ["deviates", "pass"]
    missed = {case: result._replace(rms={"yaw_rate": 0.06}) for case, result in found.items()}
    monkeypatch.setattr(verification, "compare", lambda _: missed)
    assert [row.verdict for row in verification.rows()] == ["FAIL", "FAIL"]


def test_peculiarities_are_sentences():
    assert all(text.endswith(".") and text[0].isupper() for text in PECULIARITIES.values())
