"""Transition metrics against a car with dead bands of its own."""

import numpy as np
import pytest

from steer_env import metrics
from steer_env.recording import DEGREE
from tests.steer_env.trials import G, changed, check, covers, mirrored, recording, refusals, with_gap

PEAK, RISE = 16 * DEGREE, 10.0  # rad, s
DEAD = {"yaw_rate": 0.4 * DEGREE, "lateral_acceleration": 0.6 * DEGREE}  # handwheel angle [rad]
GAIN = {"yaw_rate": 0.28, "lateral_acceleration": 8.0}  # beyond it, over the handwheel angle [SI]
TORQUE, GRADIENT = 0.7, 1.2  # where the response begins [N m], over the lateral acceleration from there on [N m s2/m]


def transitions(rate, repeats=4, rise=RISE, peak=PEAK):
    """Slow ramps of the handwheel to the left and to the right in turn; dead bands in angle and torque."""
    one = np.cumsum([0.0, 3.0, rise, 2.0, 6.0])
    n = 2 * repeats
    time = np.arange(round((n * one[-1] + 3.0) * rate) + 1) / rate
    angle = np.zeros(time.size)
    for i in range(n):
        angle += (-1) ** i * np.interp(time - i * one[-1], one, [0.0, 0.0, peak, peak, 0.0])
    channels = {
        name: GAIN[name] * np.sign(angle) * np.maximum(np.abs(angle) - dead, 0.0) for name, dead in DEAD.items()
    }
    rubbing = TORQUE * np.clip(angle / (0.3 * DEGREE), -1, 1)
    torque = rubbing + GRADIENT * channels["lateral_acceleration"]
    channels |= {"handwheel_angle": angle, "handwheel_torque": torque, "vehicle_speed": np.full(time.size, 100 / 3.6)}
    return recording(time, channels, manoeuvre="transition")


def transition_answers():
    """What the metrics must be, in their units; by the yaw rate the torque begins before the acceleration does."""
    gap = DEAD["lateral_acceleration"] - DEAD["yaw_rate"]
    sensitivity = GAIN["lateral_acceleration"] * 100 * DEGREE / G
    return {
        "yaw_rate_transition_angle_deadband": DEAD["yaw_rate"] / DEGREE,
        "lateral_acceleration_transition_angle_deadband": DEAD["lateral_acceleration"] / DEGREE,
        "yaw_rate_transition_torque_deadband": TORQUE - GRADIENT * GAIN["lateral_acceleration"] * gap,
        "lateral_acceleration_transition_torque_deadband": TORQUE,
        "transition_torque_gradient_near_centre": GRADIENT * G,
        "transition_torque_gradient_at_1m_s2": GRADIENT * G,
        "transition_torque_at_1m_s2": TORQUE + GRADIENT,
        "transition_sensitivity_near_centre": sensitivity,
        "transition_sensitivity_at_1m_s2": sensitivity,
        "transition_yaw_rate_gain": GAIN["yaw_rate"],
    }


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_transitions_in_closed_form(rate):
    """Within 1 %: the low-pass rounds the kinks where the response begins."""
    check(transitions(rate), transition_answers(), 0.01)


def test_coverage():
    assert min(covers(transitions(200.0), transition_answers()).values()) >= 0.85


def test_sides_and_offsets():
    """Offsets of the sensors drop out of the mean of both sides, to 2 %: they shift what is near the centre."""
    clean = transitions(100.0)
    plain, right = metrics.evaluate(clean), metrics.evaluate(mirrored(clean))
    offset = {"handwheel_angle": 0.1 * DEGREE, "handwheel_torque": 0.1, "lateral_acceleration": 0.03}
    shifted = metrics.evaluate(changed(clean, **{n: clean[n] + x for n, x in offset.items()}))
    assert len(plain["transition_torque_at_1m_s2"].repeats) == 8
    for name, value in plain.items():
        assert right[name].value == pytest.approx(value.value, rel=1e-3), name
        assert shifted[name].value == pytest.approx(value.value, rel=2e-2), name


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (transitions(100.0, rise=2.5), "deg/s: steer at 5 or less"),
        (transitions(100.0).between(0.0, 16.0), "1 ramps of handwheel_angle to the left and 0 to the right"),
        (transitions(100.0, peak=2 * DEGREE), "below 0.05 g: steer further"),
        (transitions(100.0, peak=35 * DEGREE), "above 0.35 g: steer less far"),
        (changed(transitions(100.0), handwheel_angle=None), "no channel 'handwheel_angle'"),
        (with_gap(transitions(100.0), "lateral_acceleration"), "not finite"),
        (changed(transitions(100.0), vehicle_speed=np.full(17101, 20.0)), "72 km/h in the mean, not 100"),
    ],
)
def test_refused_altogether(bad, reason):
    refused = refusals(bad)
    assert refused.keys() == set(metrics.available("transition"))
    assert all(reason in text for text in refused.values()), refused


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
