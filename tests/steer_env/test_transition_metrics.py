"""Transition metrics against a car with dead bands of its own."""

import numpy as np
import pytest

from steer_env import metrics
from steer_env.recording.recording import DEGREE
from tests.steer_env.checks import burst, check, check_alike, check_refused, refusals
from tests.synthetic.recordings import changed, mirrored
from tests.synthetic.transition import transition_answers, transitions


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_transitions_in_closed_form(rate):
    """Within 1 %: the low-pass rounds the kinks where the response begins."""
    check(transitions(rate), transition_answers(), {"rest": 0.01})


def test_sides_and_offsets():
    """Offsets of the sensors drop out of the mean of both sides, to 2 %: they shift what is near the centre."""
    clean = transitions(100.0)
    assert len(metrics.evaluate(clean)["transition_torque_at_1m_s2"].repeats) == 8
    check_alike(clean, mirrored(clean), rel=1e-3)
    offset = {"handwheel_angle": 0.1 * DEGREE, "handwheel_torque": 0.1, "lateral_acceleration": 0.03}
    check_alike(clean, changed(clean, **{n: clean[n] + x for n, x in offset.items()}), rel=2e-2)


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (transitions(100.0, rise=2.5), "deg/s: steer at 5 or less"),
        (transitions(100.0).between(0.0, 16.0), "1 ramps of handwheel_angle to the left and 0 to the right"),
        (transitions(100.0, peak=2 * DEGREE), "below 0.05 g: steer further"),
        (transitions(100.0, peak=35 * DEGREE), "above 0.35 g: steer less far"),
        (changed(transitions(100.0), handwheel_angle=None), "no channel 'handwheel_angle'"),
        (burst(transitions(100.0), "lateral_acceleration"), "not finite"),
        (changed(transitions(100.0), vehicle_speed=np.full(17101, 20.0)), "72 km/h on average, not 100"),
    ],
)
def test_refused_altogether(bad, reason):
    check_refused(bad, reason)


def test_refused_one_by_one():
    clean = transitions(100.0)
    swapped = refusals(changed(clean, yaw_rate=-clean["yaw_rate"]))
    assert swapped.keys() == {n for n in metrics.available("transition") if "yaw" in n}
    assert all("check the signs" in text for text in swapped.values())
    assert refusals(changed(clean, handwheel_torque=None)).keys() == {
        n for n in metrics.available("transition") if "torque" in n
    }
    small = refusals(transitions(100.0, peak=7 * DEGREE))
    assert {name for name in small if "steer further" in small[name]} == {
        n for n in metrics.available("transition") if n.endswith("at_1m_s2")
    }
