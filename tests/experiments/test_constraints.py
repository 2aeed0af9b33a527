"""The constraints of a tuning against the margins of steady turns."""

import math

import pytest

from steer_env import friction
from steer_env.experiments.calibration import constraints, problem
from steer_env.targets import load
from steer_env.vehicle import cars
from steer_env.vehicle.analysis import assist_loop
from steer_env.vehicle.analysis.operating_point import cornering, steady, with_hands

LOAD = 300.0  # [kg]
# From the beginning of a search. At 140 km/h the response has a sharp peak where the gain margin is read.
PEAKED = {
    "boost_level": 1.295,
    "boost_progression": 0.8919,
    "boost_low_speed": 1.056,
    "damping_level": 0.6388,
    "damping_low_speed": 1.243,
    "lead_zero": 14.46,
    "lead_pole": 139.8,
    "handwheel_damping": 0.001677,
}


# Its active return is saturated in a turn, so that the gain margin is 7 dB smaller there than straight ahead.
SATURATED = {
    "boost_level": 0.441,
    "boost_progression": 1.025,
    "boost_low_speed": 0.845,
    "damping_level": 0.453,
    "damping_low_speed": 1.436,
    "lead_zero": 25.094,
    "lead_pole": 107.585,
    "return_gain": 6.659,
    "return_saturation": 0.501,
    "handwheel_damping": 0.113,
    "friction_share": 0.531,
}


@pytest.mark.whole
@pytest.mark.parametrize(
    ("values", "kph", "torques", "most"),
    [
        (PEAKED, 140.0, (0.0, 2.0, 2.6, 3.0, 3.5, 4.0), 0.1),
        (PEAKED, 100.0, (0.0, 2.6, 3.0, 4.0), 0.1),
        (SATURATED, 140.0, (0.0, 3.0, 4.0, 6.0), 0.5),
        ({}, 140.0, (0.0, 2.0, 3.0, 4.0, 5.0), 0.1),
        ({"boost_level": 1.35, "friction_share": 0.3}, 40.0, (0.0, 2.0, 3.0), 0.1),
    ],
)
def test_gain_margin_is_that_of_the_worst_steady_turn(monkeypatch, values, kph, torques, most):
    car, law = cars.load("compact"), friction.resolve("lugre")
    laden, a = car.loaded(LOAD), problem.assist(problem.make(car, load("compact")), values)
    monkeypatch.setattr(constraints, "SPEEDS", (kph,))
    found = constraints.margins(car, a, law, LOAD, constraints.reaches(laden))
    turn = cornering(laden._replace(assist=a), kph / 3.6)
    points = [steady(turn, torque=torque) for torque in torques]
    worst = min(assist_loop.margins(with_hands(p, "off", of)).gain for p in points for of in (None, law))
    over = found[f"gain_{kph:.0f}"] - 20.0 * math.log10(worst)
    assert -0.25 <= over <= most


def test_steepest_part_counts_once_the_car_reaches_where_it_begins():
    a = cars.load("compact").assist
    whole = a.torques + a.boost[1]
    for k in (2, 5):
        below, above = (constraints.steepest(a, a.speeds[1], whole[k] + change) for change in (-1e-6, 1e-6))
        assert below == pytest.approx((a.boost[1, k] - a.boost[1, k - 1]) / (a.torques[k] - a.torques[k - 1]))
        assert above == pytest.approx((a.boost[1, k + 1] - a.boost[1, k]) / (a.torques[k + 1] - a.torques[k]))
