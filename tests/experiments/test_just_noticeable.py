"""What a driver notices: one definition for every page."""

import json
import math

import pytest

from steer_env import metrics
from steer_env.experiments.studies.common import battery
from steer_env.metrics import Value
from steer_env.metrics.common import just_noticeable
from steer_env.metrics.common.just_noticeable import IMPERCEPTIBLE, PERCEPTIBLE, UNKNOWN, Perception, perception

NAN = math.nan


@pytest.mark.parametrize(
    ("name", "base", "gap", "expected"),
    [
        ("torque_at_0p1g", 2.0, (0.31, 0.30, 0.32), Perception(PERCEPTIBLE, True)),
        ("torque_at_0p1g", 2.0, (-0.31, -0.40, -0.22), Perception(PERCEPTIBLE, False)),
        ("torque_at_0p1g", 2.0, (0.29, 0.28, 0.295), Perception(IMPERCEPTIBLE, True)),
        ("torque_at_0p1g", 2.0, (0.25, 0.15, 0.35), Perception(IMPERCEPTIBLE, False)),
        ("torque_at_0p1g", -2.0, (0.31, 0.30, 0.32), Perception(PERCEPTIBLE, True)),
        ("peak_handwheel_angle", 10.0, (2.0, NAN, NAN), Perception(PERCEPTIBLE)),
        ("peak_handwheel_angle", 10.0, (1.0, NAN, NAN), Perception(IMPERCEPTIBLE)),
        ("torque_at_0p1g", 0.4, (0.5, 0.4, 0.6), Perception(UNKNOWN)),  # near zero a share is not constant
        ("peak_handwheel_angle", 2.0, (0.9, 0.8, 0.95), Perception(UNKNOWN)),
        ("torque_at_0p1g", 0.95, (0.14, 0.13, 0.145), Perception(IMPERCEPTIBLE, True)),  # of the floor
        ("torque_at_0p1g", 2.0, (2.3 - 2.0, NAN, NAN), Perception(PERCEPTIBLE)),  # exactly 15 %
        ("torque_at_0p1g", 3.0, (3.45 - 3.0, NAN, NAN), Perception(PERCEPTIBLE)),
        ("torque_at_0p1g", 2.0, (2.3 - 2.0, 2.3 - 2.0, 0.4), Perception(PERCEPTIBLE, True)),
        ("torque_at_0p1g", 2.0, (0.1, 0.0, 2.3 - 2.0), Perception(IMPERCEPTIBLE, False)),
        ("torque_at_0p1g", 2.0, (NAN, NAN, NAN), Perception(UNKNOWN)),
        ("torque_at_0p1g", NAN, (NAN, NAN, NAN), Perception(UNKNOWN)),
    ],
)
def test_a_difference_is_judged_by_its_share_and_its_interval(name, base, gap, expected):
    assert perception(name, base, gap) == expected


@pytest.mark.parametrize(
    ("one", "other"), [(0.95, 5.95), (2.0, 2.3), (2.0, 2.32), (-1.0, 1.0), (0.0, 5.0), (0.9, 1.04)]
)
def test_the_verdict_does_not_depend_on_the_base(one, other):
    """Formerly 5 N m more than 0.95 N m had no threshold, and 5 N m less than 5.95 N m was perceptible."""
    gap, half = other - one, 0.01
    there = perception("peak_handwheel_torque", one, (gap, gap - half, gap + half))
    back = perception("peak_handwheel_torque", other, (-gap, -gap - half, -gap + half))
    assert there == back
    assert there.verdict != UNKNOWN


@pytest.mark.parametrize(
    ("base", "gap", "share"),
    [
        (math.inf, (1.0, NAN, NAN), 0.15),
        (2.0, (-math.inf, NAN, NAN), 0.15),
        (2.0, (0.3, -math.inf, math.inf), 0.15),
        (2.0, (1.0, NAN, NAN), math.inf),
    ],
)
def test_infinite_numbers_are_refused(base, gap, share):
    with pytest.raises(ValueError, match="must be finite"):
        perception("peak_handwheel_torque", base, gap, share)


def test_the_threshold_can_be_another():
    gap = (0.3, 0.29, 0.31)
    assert perception("steady_step_torque", 2.0, gap, 0.1) == Perception(PERCEPTIBLE, True)
    assert perception("steady_step_torque", 2.0, gap, 0.2) == Perception(IMPERCEPTIBLE, True)
    for share in (0.0, -0.1, NAN):
        with pytest.raises(ValueError, match="just-noticeable difference must be above 0"):
            perception("steady_step_torque", 2.0, gap, share)
    with pytest.raises(ValueError, match="no metric 'torque'"):
        perception("torque", 2.0, gap)


def test_thresholds_are_of_sustained_torques_and_angles_alone():
    """Every name is a metric in newton metres or degrees, and none is of a kind without a known threshold."""
    assert set(metrics.available()) >= just_noticeable.SUSTAINED
    for name in metrics.available():
        if just_noticeable.applies(name):
            assert metrics.definition(name).unit in just_noticeable.LEAST_STIMULUS, name
        for word in ("deadband", "gradient", "phase", "lag", "0g", "hysteresis", "ripple", "gain", "crosswind"):
            assert not (word in name.split("_") and just_noticeable.applies(name)), name


def value(name, *repeats):
    mean = sum(repeats) / len(repeats)
    return Value(mean, mean, mean, metrics.definition(name).unit, repeats=repeats)


def test_differences_between_laws_carry_the_verdict():
    name = "torque_at_0p1g"
    felt = battery.difference(name, value(name, 2.5, 2.5, 2.5), value(name, 2.0, 2.0, 2.0))
    assert felt.perception == Perception(PERCEPTIBLE, True)
    assert battery.difference(name, value(name, 2.1, 2.1), value(name, 2.0, 2.0)).perception.verdict == IMPERCEPTIBLE
    large = battery.difference("torque_at_0g", value("torque_at_0g", 3.0, 3.0), value("torque_at_0g", 1.5, 1.5))
    assert large.matters
    assert large.perception == Perception(UNKNOWN)
    assert battery.as_json(large)["perception"] == UNKNOWN
    refused = Value(NAN, NAN, NAN, "N m", "why")
    found = battery.difference(name, refused, value(name, 2.0, 2.0))
    assert found.perception == Perception(UNKNOWN)
    assert json.loads(json.dumps(battery.as_json(found), allow_nan=False))["value"] is None
