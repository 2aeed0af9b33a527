"""Steady circles of a car whose angles and torque are polynomials of the lateral acceleration."""

import numpy as np
import pytest

from steer_env import metrics
from steer_env.recording import DEGREE
from tests.steer_env.trials import G, changed, check, covers, mirrored, recording, refusals, with_gap

RATIO, WHEELBASE, RADIUS, SPEED = 15.0, 2.5, 100.0, 80 / 3.6
K = 0.0045  # understeer gradient [rad s2/m]
BEND = 0.002  # of the handwheel angle above 5 m/s2 [rad s4/m2]
SLIP, ROLL, TORQUE, FRICTION = -0.006, 0.011, 0.6, 0.9  # gradients [SI], friction [N m]
HIGHEST, RISE, HELD = 7.0, 50.0, 3.0  # m/s2, s
GEOMETRY = {"wheelbase_m": WHEELBASE, "steering_ratio": RATIO}


def circles(rate, constant, repeats=2, understeer=K, sides=(1, -1), highest=HIGHEST, rise=RISE):
    """Straight, ramp of the lateral acceleration, held, back; to both sides in turn."""
    start = 0.5 if constant == "radius" else 0.0
    one = np.cumsum([0.0, 4.0, 2.0, rise, HELD, 6.0])
    levels = [0.0, 0.0, start, highest, highest, 0.0]
    n = repeats * len(sides)
    time = np.arange(round((n * one[-1] + 4.0) * rate) + 1) / rate
    size = np.zeros(time.size)
    side = np.ones(time.size)
    for i in range(n):
        inside = (time >= i * one[-1]) & (time < (i + 1) * one[-1])
        size[inside] = np.interp(time[inside] - i * one[-1], one, levels)
        side[inside] = sides[i % len(sides)]
    speed = np.sqrt(np.maximum(size, start) * RADIUS) if constant == "radius" else np.full(time.size, SPEED)
    path = WHEELBASE * size / speed**2
    angle = RATIO * (path + understeer * size) + BEND * np.maximum(size - 5.0, 0.0) ** 2
    channels = {
        "handwheel_angle": side * angle,
        "lateral_acceleration": side * size,
        "yaw_rate": side * size / speed,
        "vehicle_speed": speed,
        "handwheel_torque": side * (TORQUE * size + FRICTION * np.tanh(size / 0.2)),
        "sideslip_angle": side * SLIP * size,
        "roll_angle": side * ROLL * size,
    }
    test = "steady-circle" if constant == "radius" else "steady-circle-speed"
    return recording(time, channels, manoeuvre=test, **GEOMETRY)


def radius(rate):
    """Recording and answers on a constant radius."""
    return circles(rate, "radius"), answers(0.0)


def speed(rate):
    """Recording and answers at constant speed."""
    return circles(rate, "speed"), answers(WHEELBASE / SPEED**2)


def answers(path):
    """What the metrics must be, in their units; a parabola's mean slope from 5.5 to 6.5 is that at 6."""
    per_g, bend = G / DEGREE, 2 * BEND * 1.0
    return {
        "understeer_gradient": K * per_g,
        "understeer_gradient_at_6m_s2": (K + bend / RATIO) * per_g,
        "steering_wheel_angle_gradient": RATIO * (K + path) * per_g,
        "steering_wheel_angle_gradient_at_6m_s2": (RATIO * (K + path) + bend) * per_g,
        "sideslip_gradient": SLIP * per_g,
        "roll_gradient": ROLL * per_g,
        "steering_wheel_torque_gradient": TORQUE * G,
        "steering_wheel_torque_gradient_at_6m_s2": TORQUE * G,
        "characteristic_speed": 3.6 * np.sqrt(WHEELBASE / K),
        "critical_speed": None,
        "highest_lateral_acceleration": HIGHEST / G,
    }


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
@pytest.mark.parametrize("record", [radius, speed])
def test_circles_in_closed_form(record, rate):
    """Within 0.3 %: the low-pass at the start and the end of the ramps."""
    check(*record(rate), 3e-3)


@pytest.mark.parametrize("record", [radius, speed])
def test_coverage(record):
    assert min(covers(*record(200.0)).values()) >= 0.85


def test_an_oversteering_car_has_a_critical_speed():
    found = metrics.evaluate(circles(100.0, "radius", understeer=-0.002))
    assert found["critical_speed"].value == pytest.approx(3.6 * np.sqrt(WHEELBASE / 0.002), rel=5e-3)
    assert found["characteristic_speed"].reason == "the car oversteers: it has a critical speed instead"


@pytest.mark.parametrize("record", [radius, speed])
def test_sides_and_offsets(record):
    clean, _ = record(100.0)
    plain, right = metrics.evaluate(clean), metrics.evaluate(mirrored(clean))
    assert len(plain["roll_gradient"].repeats) == 4
    shifted = metrics.evaluate(changed(clean, **{n: clean[n] + 0.02 for n in ("handwheel_angle", "handwheel_torque")}))
    for name, value in plain.items():
        assert right[name].value == pytest.approx(value.value, rel=1e-3, nan_ok=True), name
        assert shifted[name].value == pytest.approx(value.value, rel=1e-6, nan_ok=True), name


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (circles(100.0, "speed", rise=8.0), "let it rise by 0.5 or less"),
        (circles(100.0, "radius", rise=8.0), "let it rise by 0.5 or less"),
        (circles(100.0, "speed", highest=3.0), "m/s2, not from 1 to 4 m/s2"),
        (changed(circles(100.0, "radius"), vehicle_speed=1.2 * circles(100.0, "radius")["vehicle_speed"]), "not 100 m"),
        (changed(circles(100.0, "speed"), lateral_acceleration=None), "no channel 'lateral_acceleration'"),
        (with_gap(circles(100.0, "speed"), "lateral_acceleration"), "not finite"),
        (changed(circles(100.0, "speed"), vehicle_speed=np.full(26401, 30.0)), "108 km/h in the mean, not 80"),
        (
            changed(circles(100.0, "speed"), handwheel_angle=-circles(100.0, "speed")["handwheel_angle"]),
            "check the signs",
        ),
    ],
)
def test_refused_altogether(bad, reason):
    refused = refusals(bad)
    assert refused.keys() == set(metrics.available("steady-circle"))
    assert all(reason in text for text in refused.values()), refused


def test_refused_one_by_one():
    clean = circles(100.0, "speed")
    low = refusals(circles(100.0, "speed", highest=6.0))
    assert low.keys() - {"critical_speed"} == {n for n in metrics.available() if n.endswith("at_6m_s2")}
    assert "drive on until it does" in low["understeer_gradient_at_6m_s2"]
    bare = metrics.evaluate(changed(clean), steering_ratio=None)
    assert bare["understeer_gradient"].reason.startswith("neither meta nor condition says steering_ratio")
    assert bare["steering_wheel_angle_gradient"].reason == ""
    assert set(refusals(changed(clean, roll_angle=None))) == {"roll_gradient", "critical_speed"}
    assert set(refusals(changed(clean, sideslip_angle=None))) == {"sideslip_gradient", "critical_speed"}
