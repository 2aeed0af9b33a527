"""Step metrics against second-order systems in closed form."""

import numpy as np
import pytest

from steer_env import metrics
from tests.steer_env.checks import burst, check, check_alike, check_refused, refusals
from tests.synthetic.recordings import changed, mirrored
from tests.synthetic.step import SIZE, SPEED, YAW, step_answers, steps


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_steps_in_closed_form(rate):
    """Within 0.5 %; the overshoot of 8 % of a cubic's top within 1 %, as is a 10 % time of few samples at 50 Hz."""
    loose = {"lateral_acceleration_overshoot": 0.01, "yaw_rate_rise_time": 0.01, "lateral_acceleration_rise_time": 0.01}
    check(steps(rate), step_answers(), {"rest": 5e-3, **loose})


def test_every_step_is_a_repeat_and_a_return_is_none():
    found = metrics.evaluate(steps(100.0))["yaw_rate_peak_time"]
    assert len(found.repeats) == 6
    assert np.ptp(found.repeats) < 0.01


def test_sides_and_offsets():
    """The mirror image is the same; offsets of the sensors drop out, that of the torque as both sides count."""
    clean = steps(100.0)
    offset = changed(clean, **{n: clean[n] + 0.05 for n in clean.channels if n != "vehicle_speed"})
    for other in (mirrored(clean), offset):
        check_alike(clean, other, rel=1e-6)


def test_sideslip_from_speeds():
    clean = steps(100.0)
    lateral = SPEED * np.tan(clean["sideslip_angle"])
    derived = metrics.evaluate(changed(clean, sideslip_angle=None, lateral_speed=lateral))
    for name in ("steady_step_sideslip", "tb_factor"):
        assert derived[name].value == pytest.approx(metrics.evaluate(clean)[name].value, rel=1e-3)


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (steps(100.0, rise=1.0), "deg/s at most: step at 200 to 500 deg/s"),
        (steps(100.0).between(0.0, 4.0), "no step from straight ahead held for 3 s"),
        (steps(100.0).between(1.0, 8.0), "0.5 s straight before it"),
        (changed(steps(100.0), handwheel_angle=None), "no channel 'handwheel_angle'"),
        (changed(steps(100.0), vehicle_speed=0 * steps(100.0).time + 30.0), "108 km/h on average, not 80"),
        (burst(steps(100.0), "handwheel_angle"), "not finite"),
    ],
)
def test_refused_altogether(bad, reason):
    check_refused(bad, reason)


def test_refused_at_another_level():
    clean = steps(100.0)
    for size, reason in ((0.3, "below 0.15 g: steer further"), (2.0, "above 0.65 g: steer less far")):
        check_refused(changed(clean, lateral_acceleration=size * clean["lateral_acceleration"]), reason)


def test_refused_one_by_one():
    clean = steps(100.0)
    swapped = refusals(changed(clean, yaw_rate=-clean["yaw_rate"]))
    assert {name for name in swapped if "check the signs" in swapped[name]} == swapped.keys()
    assert swapped.keys() == {n for n in metrics.available("step-steer") if n.startswith("yaw_rate")} | {"tb_factor"}
    assert refusals(changed(clean, handwheel_torque=None)).keys() == {"steady_step_torque"}
    assert refusals(changed(clean, sideslip_angle=None)).keys() == {"steady_step_sideslip", "tb_factor"}
    assert {"yaw_rate_overshoot", "tb_factor"} < refusals(burst(clean, "yaw_rate")).keys()
    assert not any(n.startswith("lateral") for n in refusals(burst(clean, "yaw_rate")))
    # Without the lateral acceleration its level is yaw rate times speed.
    assert "yaw_rate_overshoot" not in refusals(changed(clean, lateral_acceleration=None))
    damped = changed(clean, yaw_rate=0.045 * clean["lateral_acceleration"] ** 1)
    assert refusals(damped) == {}
    late = refusals(changed(clean, yaw_rate=YAW[0] / SIZE * clean["handwheel_angle"]))
    assert {"yaw_rate_peak_time", "yaw_rate_overshoot"} <= late.keys()
