"""Frequency responses against second-order systems in closed form, by sweeps and by noise."""

import numpy as np
import pytest

from steer_env import metrics
from steer_env.metrics import frequency_response_curve
from steer_env.recording.recording import DEGREE
from tests.steer_env.checks import burst, check, check_refused, refusals
from tests.synthetic.frequency_response import driven, random_angle, random_steer, swept_sine
from tests.synthetic.recordings import changed

TESTS = ("frequency-response", "random-steer")


COHERENCES = [f"{name}_lowest_coherence" for name in ("yaw_rate", "lateral_acceleration", "torque")]


def check_coherent(made, tolerance):
    """The coherence within 3 % of 1, as the response turns within the band of the mean; noise lowers it further."""
    found = check(*made, tolerance, without=COHERENCES)
    assert all(0.97 < found[name].value < 1.0 for name in COHERENCES)


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_sweeps_in_closed_form(rate):
    """Within 0.5 %."""
    check_coherent(swept_sine(rate), {"rest": 5e-3})


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_noise_in_closed_form(rate):
    """Within 2 %: what the segments cut off at their ends is noise, less with a longer recording; 6 % of a flat top."""
    check_coherent(random_steer(rate), {"rest": 0.02, "yaw_rate_resonance_frequency": 0.06})


@pytest.mark.parametrize("record", [swept_sine, random_steer])
def test_curve(record):
    clean, expected = record(100.0)
    found = frequency_response_curve(clean, "yaw_rate")
    at_1 = np.argmin(np.abs(found.frequency - 1.0))
    assert found.frequency[[0, -1]] == pytest.approx([0.2, 2.0])
    assert -np.angle(found.response[at_1]) / DEGREE == pytest.approx(expected["yaw_rate_phase_lag_at_1hz"], rel=0.02)
    assert np.all(found.gain_low <= found.gain_high)
    assert np.all(found.phase_low <= found.phase_high)
    assert found.gain_low[at_1] == pytest.approx(abs(found.response[at_1]), rel=0.02)
    assert np.all((found.coherence > 0.95) & (found.coherence < 1 + 1e-9))
    with pytest.raises(ValueError, match="no frequency response from manoeuvre 'weave'; there is one from freq"):
        frequency_response_curve(clean, "yaw_rate", "weave")


def test_incoherence_is_refused():
    """Another input as strong as the handwheel: the metrics that rest on the band say at which frequency."""
    clean, _ = random_steer(100.0)
    other = driven(random_angle(100.0, seed=2), 100.0, "random-steer")
    refused = refusals(changed(clean, yaw_rate=clean["yaw_rate"] + other["yaw_rate"]))
    assert refused.keys() == {n for n in metrics.available("random-steer") if n.startswith("yaw")} - {
        "yaw_rate_lowest_coherence"
    }
    assert all("coherence of yaw_rate is" in text and "below 0.9" in text for text in refused.values())


@pytest.mark.parametrize("test", TESTS)
def test_refused_altogether(test):
    clean = (swept_sine if test == TESTS[0] else random_steer)(100.0)[0]
    short = {"frequency-response": "2 sweeps with two seconds straight", "random-steer": "4 segments of 25 s"}[test]
    slow = changed(clean, handwheel_angle=np.where(clean.time < 12, clean["handwheel_angle"], 0) + 0.1)
    cases = [
        (clean.between(0.0, 68.0), short),
        (changed(clean, handwheel_angle=None), "no channel 'handwheel_angle'"),
        (burst(clean, "handwheel_angle"), "not finite"),
        (changed(clean, vehicle_speed=0 * clean.time + 30.0), "108 km/h on average, not 80"),
        (slow, "sweeps" if test == TESTS[0] else "is not excited at"),
    ]
    for bad, reason in cases[: 4 if test == TESTS[1] else 5]:
        check_refused(bad, reason)
    check_refused(clean, "is not excited at 2.", highest_hz=4.0)


def test_refused_one_by_one():
    clean, _ = swept_sine(100.0)
    swapped = refusals(changed(clean, yaw_rate=-clean["yaw_rate"]))
    assert swapped.keys() == {n for n in metrics.available(TESTS[0]) if n.startswith("yaw")} - {
        "yaw_rate_lowest_coherence"
    }
    assert all("check the signs" in text for text in swapped.values())
    assert refusals(changed(clean, handwheel_torque=None)).keys() == {
        n for n in metrics.available(TESTS[0]) if n.startswith("torque")
    }
    assert not any(n.startswith("yaw") for n in refusals(burst(clean, "lateral_acceleration")))
    flat = refusals(changed(clean, yaw_rate=0.3 * clean["handwheel_angle"]))
    assert "does not fall by 3 dB up to 2 Hz" in flat["yaw_rate_bandwidth"]
    assert "does not pass -45 deg" in flat["yaw_rate_equivalent_time"]
    damped = refusals(changed(clean, yaw_rate=0.05 * clean["lateral_acceleration"]))
    assert "no resonance" in damped["yaw_rate_resonance_frequency"]
    assert "yaw_rate_phase_lag_at_1hz" not in damped
