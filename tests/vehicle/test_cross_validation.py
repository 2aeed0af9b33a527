"""Our two tracks as they are driven for ``tests.verification.commonroad``, which holds the comparison."""

from tests.verification.common.commonroad_manoeuvres import MANOEUVRES
from tests.verification.common.commonroad_reference import load
from tests.verification.common.cross_validation import difference, drive_two_track

STEP = MANOEUVRES["step_20"]._replace(duration=4.0)


def test_two_tracks_are_integrated_tightly_and_relax_at_once():
    p = load().parameters
    base = drive_two_track(p, STEP)
    for other, most in ((drive_two_track(p, STEP, tolerance=1e-8), 1e-4), (drive_two_track(p, STEP, 0.015), 2e-3)):
        for channel in ("yaw_rate", "lateral_acceleration"):
            assert difference(other, base, channel) < most
