"""Our two tracks against the stored reference; nothing here needs their package."""

import pytest

from tests.verification.common.commonroad_manoeuvres import MANOEUVRES
from tests.verification.common.commonroad_reference import load
from tests.verification.common.cross_validation import MOST_RMS, MOST_STEADY, compare, difference, drive_two_track

STEP = MANOEUVRES["step_20"]._replace(duration=4.0)


@pytest.mark.parametrize("name", MANOEUVRES)
def test_two_tracks_keep_the_marks_once_the_named_differences_are_out(name):
    """With room to spare, in fact."""
    result = compare(name)["reconciled"]
    assert result.passed
    assert max(result.rms.values()) < MOST_RMS / 3.0
    assert max(abs(gap) for *_, gap in result.steady.values()) < MOST_STEADY * 0.75


def test_two_tracks_are_integrated_tightly_and_relax_at_once():
    p = load().parameters
    base = drive_two_track(p, STEP)
    for other, most in ((drive_two_track(p, STEP, tolerance=1e-8), 1e-4), (drive_two_track(p, STEP, 0.015), 2e-3)):
        for channel in ("yaw_rate", "lateral_acceleration"):
            assert difference(other, base, channel) < most
