"""Steady circles of a car whose angles and torque are polynomials of the lateral acceleration."""

import numpy as np
import pytest

from steer_env import metrics
from tests.steer_env.checks import burst, check, check_alike, check_refused, refusals
from tests.synthetic.recordings import changed, mirrored
from tests.synthetic.steady_circle import circles, constant_radius, constant_speed, oversteering


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
@pytest.mark.parametrize("record", [constant_radius, constant_speed])
def test_circles_in_closed_form(record, rate):
    """Within 0.3 %: the low-pass at the start and the end of the ramps."""
    check(*record(rate), {"rest": 3e-3})


def test_an_oversteering_car_has_a_critical_speed():
    check(*oversteering(100.0), {"rest": 5e-3})


@pytest.mark.parametrize("record", [constant_radius, constant_speed])
def test_sides_and_offsets(record):
    clean, _ = record(100.0)
    assert len(metrics.evaluate(clean)["roll_gradient"].repeats) == 4
    check_alike(clean, mirrored(clean), rel=1e-3, nan_ok=True)
    shifted = changed(clean, **{n: clean[n] + 0.02 for n in ("handwheel_angle", "handwheel_torque")})
    check_alike(clean, shifted, rel=1e-6, nan_ok=True)


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (circles(100.0, "speed", rise=8.0), "let it rise by 0.5 or less"),
        (circles(100.0, "radius", rise=8.0), "let it rise by 0.5 or less"),
        (circles(100.0, "speed", highest=3.0), "not every ramp covers 1 to 4 m/s2"),
        (changed(circles(100.0, "radius"), vehicle_speed=1.2 * circles(100.0, "radius")["vehicle_speed"]), "not 100 m"),
        (changed(circles(100.0, "speed"), lateral_acceleration=None), "no channel 'lateral_acceleration'"),
        (burst(circles(100.0, "speed"), "lateral_acceleration"), "not finite"),
        (changed(circles(100.0, "speed"), vehicle_speed=np.full(26401, 30.0)), "108 km/h on average, not 80"),
        (
            changed(circles(100.0, "speed"), handwheel_angle=-circles(100.0, "speed")["handwheel_angle"]),
            "check the signs",
        ),
    ],
)
def test_refused_altogether(bad, reason):
    check_refused(bad, reason)


def test_refused_one_by_one():
    clean = circles(100.0, "speed")
    low = refusals(circles(100.0, "speed", highest=6.0))
    assert low.keys() - {"critical_speed"} == {n for n in metrics.available() if n.endswith("at_6m_s2")}
    assert "continue each ramp until it does" in low["understeer_gradient_at_6m_s2"]
    bare = metrics.evaluate(changed(clean), steering_ratio=None)
    assert bare["understeer_gradient"].reason.startswith("steering_ratio is not known")
    assert bare["steering_wheel_angle_gradient"].reason == ""
    assert set(refusals(changed(clean, roll_angle=None))) == {"roll_gradient", "critical_speed"}
    assert set(refusals(changed(clean, sideslip_angle=None))) == {"sideslip_gradient", "critical_speed"}
