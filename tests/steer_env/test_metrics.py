"""Metrics against loops whose answers are known in closed form."""

import gc
import weakref

import numpy as np
import pytest
from scipy import stats

from steer_env import manoeuvres, metrics
from steer_env.metrics.common import decay, definitions, events
from steer_env.metrics.common.confidence import trend
from steer_env.metrics.common.registry import EVALUATIONS
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle import cars
from tests.steer_env.checks import burst, check_alike, check_refused, refusals
from tests.synthetic.loops import AY_PEAK, linear_car, linear_car_answers, rough_car, rough_car_answers
from tests.synthetic.recordings import changed, mirrored

G = 9.80665
RATE = 100.0  # Hz


def weave(recording, **given):
    return metrics.evaluate(recording, "weave", **given)


def slow_ramp(recording):
    return metrics.evaluate(recording, "slow-ramp", speed_m_s=100 / 3.6)


@pytest.mark.parametrize(("size", "rate"), [(0.8, 1000.0), (1.0, 50.0), (1.5, 100.0)])
def test_ellipses_at_weave(size, rate):
    """Every metric within 0.1 %: what is left is the low-pass, the interpolation and a parabola for an ellipse."""
    found, expected = weave(linear_car(size=size, rate=rate)), linear_car_answers(size=size)
    assert found.keys() == expected.keys() == set(metrics.available("weave"))
    for name, value in found.items():
        assert (value.reason, value.unit) == ("", metrics.definition(name).unit)
        assert value.value == pytest.approx(expected[name], rel=1e-3), name


def test_ellipses_at_slow_ramp():
    found, expected = slow_ramp(linear_car(0.02, cycles=4)), linear_car_answers(0.02)
    assert set(found) == set(metrics.available("slow-ramp"))
    for name, value in found.items():
        assert value.value == pytest.approx(expected[name], rel=1e-3), name


@pytest.mark.parametrize("friction", [0.2, 0.6, 1.5])
def test_friction_loop_at_slow_ramp(friction):
    """Within 0.1 %: the branches are straight, and the 5 Hz low-pass rounds the corners only."""
    found = slow_ramp(rough_car(friction))
    for name in found.keys() & rough_car_answers():
        assert found[name].value == pytest.approx(rough_car_answers(friction)[name], rel=1e-3, abs=1e-3), name


def test_friction_loop_at_weave():
    """Within 0.1 %: the torque falls fast behind its peak, which the low-pass of the peaks follows."""
    found = weave(rough_car(frequency=0.2, cycles=10, triangle=False))
    for name, expected in rough_car_answers().items():
        assert found[name].value == pytest.approx(expected, rel=1e-3, abs=1e-3), name


def curved_car(size=1.0):
    """Torque saturates over lateral acceleration, acceleration stiffens over the angle: gradients vary with level."""
    clean = linear_car(size=size)
    ay = AY_PEAK * size * np.sin(2 * np.pi * 0.2 * clean.time)
    return changed(
        clean,
        lateral_acceleration=ay,
        handwheel_torque=2.0 * np.tanh(ay / 1.2),
        handwheel_angle=0.15 * (ay - 0.05 * ay**3 / 3),
    )


def test_gradients_of_a_curved_car_do_not_depend_on_amplitude():
    """Within 5 % of the derivatives, as a parabola over +-0.05 g does not follow tanh's third derivative.

    At another amplitude within 0.5 %: the window does not grow with it.
    """
    level = 0.1 * G
    expected = {
        "torque_at_0p1g": 2.0 * np.tanh(level / 1.2),
        "torque_gradient_at_0g": 2.0 / 1.2 * G,
        "torque_gradient_at_0p1g": 2.0 / 1.2 * G / np.cosh(level / 1.2) ** 2,
        "torque_gradient_ratio": 1 / np.cosh(level / 1.2) ** 2,
        "steering_sensitivity_at_0p1g": 100 * DEGREE / G / (0.15 * (1 - 0.05 * level**2)),
        "minimum_steering_sensitivity": 100 * DEGREE / G / 0.15,
    }
    small, large = weave(curved_car(0.9)), weave(curved_car(1.4))
    for name, true in expected.items():
        assert small[name].value == pytest.approx(true, rel=0.05), name
        assert large[name].value == pytest.approx(small[name].value, rel=5e-3), name


def test_a_rig_whose_car_does_not_turn_has_metrics():
    found = metrics.evaluate(manoeuvres.drive(cars.load(), manoeuvres.make("rig"), "lugre"))
    assert not [name for name, value in found.items() if value.reason]


def test_a_trend_is_told_as_scipy_tells_it():
    """Points of a line with more and more noise; 3 points are the fewest."""
    random, told = np.random.default_rng(0), []
    for points, size in ((3, 0.02), (3, 0.5), (12, 1.0), (12, 4.0), (12, 16.0)):
        x = np.sort(random.uniform(0.0, 10.0, points))
        y = 0.3 + x + size * random.standard_normal(points)
        slope, significant = trend(x, y)
        expected = stats.linregress(x, y)
        assert slope == pytest.approx(expected.slope, rel=1e-12)
        assert significant == (expected.pvalue < 0.05)
        told.append(significant)
    assert {*told} == {True, False}
    assert trend(np.arange(3), np.ones(3)) == (0.0, False)


def test_left_and_right_are_alike():
    """The mirrored recording has the same metrics; only where its cycles begin differs, by half a period."""
    car = rough_car(frequency=0.2, cycles=10, triangle=False)
    check_alike(car, mirrored(car), "weave", rel=1e-6, abs=1e-9)


def test_offsets_and_pauses_drop_out():
    """A pause before and after changes nothing; offsets of torque and acceleration cost 1 % at most."""
    clean = linear_car()
    pause = int(7.3 * RATE)
    time = np.arange(clean.time.size + 2 * pause) / RATE
    paused = Recording(time, {n: np.pad(v, pause, mode="edge") for n, v in clean.channels.items()}, clean.units)
    check_alike(clean, paused, "weave", rel=1e-3)
    offset = changed(
        clean,
        handwheel_torque=clean["handwheel_torque"] + 0.1,
        lateral_acceleration=clean["lateral_acceleration"] + 0.05,
    )
    check_alike(clean, offset, "weave", rel=1e-2)


def test_cycles_of_growing_amplitude_are_left_out():
    """Growth over the first cycle changes nothing, to 0.1 %.

    Growth over three keeps one of 83 % amplitude among nine: 4 % for what goes with the amplitude squared.
    """
    clean = linear_car(cycles=12)
    for growth, tolerance in ((5.0, 1e-3), (15.0, 4e-2)):
        size = np.clip(clean.time / growth, 0, 1)
        grown = changed(clean, **{n: size * clean[n] for n in clean.channels if n != "vehicle_speed"})
        check_alike(linear_car(), grown, "weave", rel=tolerance)


@pytest.mark.parametrize(
    ("car", "reason"),
    [
        (linear_car(cycles=4), "2 settled cycles between first and last: steer 5 or more"),
        (linear_car(cycles=1), "no whole cycle"),
        (linear_car(0.3), "give frequency_hz=0.3"),
        (changed(linear_car(), handwheel_angle=np.zeros(5001)), "no whole cycle"),
        (linear_car().without("handwheel_angle"), "no channel 'handwheel_angle'"),
        (linear_car(rate=15.0), "record at 20 Hz or faster"),
        (
            changed(linear_car(), handwheel_angle=np.full(5001, np.nan)),
            "'handwheel_angle' has samples that are not finite",
        ),
        (changed(linear_car(), vehicle_speed=np.full(5001, 20.0)), "72 km/h on average, not 100 km/h +- 3%: drive at"),
        (changed(linear_car(), vehicle_speed=np.linspace(25, 30, 5001)), "vehicle_speed differs between cycles"),
        (
            changed(linear_car(), lateral_acceleration=linear_car()["lateral_acceleration"] * np.linspace(1, 2, 5001)),
            "over 20% apart: hold angle and speed",
        ),
    ],
)
def test_refused_altogether(car, reason):
    check_refused(car, reason)


def test_refused_one_by_one():
    """A swapped sign, a missing channel and a level out of reach cost the metrics that need them, no more."""
    clean = linear_car()
    swapped = refusals(changed(clean, handwheel_torque=-clean["handwheel_torque"]))
    assert {"torque_at_0g", "steering_stiffness", "loop_area", "peak_handwheel_torque"} <= swapped.keys()
    assert {"yaw_rate_gain", "angle_hysteresis", "peak_handwheel_angle"}.isdisjoint(swapped)
    assert swapped["loop_area"].startswith("handwheel_torque does not follow handwheel_angle: check the signs")
    missing = refusals(burst(clean, "yaw_rate"))
    assert missing.keys() == {"yaw_rate_gain", "yaw_lag"}
    assert "'yaw_rate' has samples that are not finite" in missing["yaw_lag"]
    missing = refusals(clean.without("yaw_rate"))
    assert missing.keys() == {"yaw_rate_gain", "yaw_lag"}
    assert missing["yaw_lag"].startswith("the recording has no channel 'yaw_rate': record it")
    small = refusals(linear_car(size=0.45))
    assert small["torque_at_0p1g"] == "lateral_acceleration peaks at 0.092 g, below 0.1 g: steer further"
    assert {"torque_gradient_ratio", "work_sensitivity", "minimum_steering_sensitivity"} <= small.keys()
    assert {"torque_at_0g", "torque_gradient_at_0g", "lateral_acceleration_at_0nm", "yaw_lag"}.isdisjoint(small)
    large = refusals(linear_car(size=1.8))
    assert large["torque_at_0g"] == "lateral_acceleration peaks at 0.367 g, above 0.35 g: steer less far"
    assert set(metrics.available("weave")) - large.keys() == {
        "peak_handwheel_torque",
        "peak_handwheel_angle",
        "loop_area",
    }
    quick = refusals(changed(clean, handwheel_angle=0.2 * clean["handwheel_angle"]))
    assert "handwheel_angle does not span 0 +- 0.0698 rad: steer further" in quick["steering_stiffness"]


def test_a_channel_beyond_its_limit_is_refused():
    clean = linear_car()
    wrong = refusals(changed(clean, handwheel_torque=1e3 * clean["handwheel_torque"]))
    text = "handwheel_torque reaches 3200 N m, which is beyond 100: check the unit that it is given in"
    assert wrong["torque_at_0g"] == text


def test_a_level_that_is_not_crossed_is_refused():
    with pytest.raises(metrics.RefusedError, match="does not cross 3 m/s2 on each branch: centre the weave"):
        metrics.read(linear_car()).at("handwheel_torque", "lateral_acceleration", 3.0)


def test_wrong_unit_is_refused():
    clean = linear_car()
    wrong = Recording(clean.time, clean.channels, {**clean.units, "handwheel_angle": "1"})
    assert refusals(wrong, "weave")["yaw_lag"] == "handwheel_angle is in '1': give it in 'rad'"


def test_two_cycles_do_for_a_slow_ramp_and_three_for_a_weave():
    assert slow_ramp(linear_car(0.02, cycles=4))["torque_at_0g"].reason == ""
    assert slow_ramp(linear_car(0.02, cycles=3))["torque_at_0g"].reason != ""
    assert weave(linear_car(cycles=5))["torque_at_0g"].reason == ""


@pytest.mark.parametrize("test", ["weave", "step-steer", "release", "frequency-response"])
def test_no_recording_stays_in_memory(test):
    """Neither by a reading that refers to itself nor by a refusal whose traceback does, without a garbage collector."""
    recording = manoeuvres.drive(cars.load(), manoeuvres.make(test))
    alive = weakref.ref(recording)
    gc.disable()
    try:
        found = metrics.evaluate(recording.without("yaw_rate"))
        metrics.evaluate(recording)
        metrics.evaluate(recording, speed_m_s=1.0)  # refused altogether
        del recording
        assert alive() is None
    finally:
        gc.enable()
    assert any(value.reason for value in found.values())


def test_every_metric_is_declared():
    for name in metrics.available():
        entry = metrics.definition(name)
        assert entry.name == name
        assert entry.unit in metrics.UNITS
        assert entry.definition.endswith(".")
        assert entry.source
        assert entry.usual is None or entry.usual[0] < entry.usual[1]
        assert set(entry.tests) <= set(metrics.tests())
    assert set(metrics.available("slow-ramp")) < set(metrics.available("weave")) < set(metrics.available())
    with pytest.raises(ValueError, match=r"unknown test 'weav'; available: .*weave"):
        metrics.available("weav")
    with pytest.raises(ValueError, match=r"no metric 'torque'; there are .*torsion_bar_ripple"):
        metrics.definition("torque")
    with pytest.raises(ValueError, match="weave has no condition 'frequency'; there are speed_m_s, frequency_hz"):
        weave(linear_car(), frequency=0.2)


def test_a_test_from_outside(monkeypatch):
    metrics.available()  # imports every test, so that the copy holds their metrics
    monkeypatch.setattr(definitions, "_metrics", dict(definitions._metrics))
    monkeypatch.setattr(EVALUATIONS, "_things", dict(EVALUATIONS._things))
    metrics.register_evaluation("straight", lambda recording, conditions: (recording, conditions), speed_m_s=30.0)

    @metrics.metric("deg", "straight", source="here")
    def largest_angle(given):
        """Largest handwheel angle."""
        return np.abs(given[0]["handwheel_angle"]).max()

    assert "straight" in metrics.tests()
    assert metrics.available("straight") == ("largest_angle",)
    assert metrics.conditions("straight") == {"speed_m_s": 30.0}
    clean = linear_car()
    found = metrics.evaluate(clean, "straight")  # the recording's meta says that the test was at 100 km/h
    assert found["largest_angle"].value == pytest.approx(np.degrees(clean["handwheel_angle"].max()))
    assert "on average, not 108 km/h" in metrics.evaluate(clean, "straight", speed_m_s=30.0)["largest_angle"].reason
    with pytest.raises(ValueError, match="test 'weave' is already registered"):
        metrics.register_evaluation("weave", lambda recording, conditions: None)


def test_a_recording_without_a_manoeuvre_asks_for_the_test():
    clean = linear_car()
    nameless = Recording(clean.time, clean.channels, clean.units)
    with pytest.raises(ValueError, match=r"meta names no manoeuvre; say which test it is: .*weave"):
        metrics.evaluate(nameless)


def test_extremes_of_polynomials_are_exact():
    """The top of a cubic and the bottom of a parabola between samples, and the parabola where its bottom is known."""
    x = 0.35 + 0.01 * np.arange(200)
    at, height = events.peak(x, 2.0 - 1.7 * (x - 1.2345) ** 2 + 0.4 * (x - 1.2345) ** 3)
    assert (at, height) == pytest.approx((1.2345, 2.0), abs=1e-10)
    bowl = 0.3 + 2.5 * (x - 1.2345) ** 2
    assert decay.lowest(x, bowl) == pytest.approx((1.2345, 0.3), abs=1e-10)
    assert decay.lowest(x, bowl, at=1.2312) == pytest.approx((1.2312, 0.3 + 2.5 * 0.0033**2), abs=1e-10)
