"""Limit cycles by harmonic balance against simulation, with an assist that has too much boost and delay."""

import math

import numpy as np
import pytest

from steer_env.vehicle import cars
from steer_env.vehicle.analysis import limit_cycle
from steer_env.vehicle.analysis.operating_point import cornering, steady, with_hands
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.steering.linear import answer
from steer_env.vehicle.steering.margins import boost_gain

CAR = cars.load("compact")
SPEED = 25.0  # [m/s]


@pytest.fixture(scope="module")
def unstable():
    """Straight running with three times the boost, 4 ms of delay and a motor without limit."""
    assist = CAR.assist._replace(boost=3.0 * CAR.assist.boost, delay=4, limit=1e4)
    return steady(cornering(CAR._replace(assist=assist), SPEED))


@pytest.mark.parametrize(
    ("law", "hands"),
    [("coulomb", "on"), ("lugre", "on"), ("viscous", "on"), pytest.param("lugre", "off", marks=pytest.mark.whole)],
)
def test_a_cycle_of_the_car_is_predicted(unstable, law, hands):
    """Frequency and amplitude within 10 % where the third harmonic is below 5 %; none is missed."""
    found = limit_cycle.compare(with_hands(unstable, hands), law)
    assert len(found) == 1
    assert 0.01 < found[0].simulated.third < limit_cycle.THIRD
    assert found[0].agrees


@pytest.mark.whole
def test_a_cycle_beside_friction_above_the_bar_is_predicted(unstable):
    """Where hands hold the handwheel, friction above the bar does not matter, and the law below it alone decides."""
    laws = {"gear": "lugre"}, {"gear": "lugre", "upper_column": "coulomb,F_c=0.3"}
    alone, beside = (limit_cycle.compare(unstable, law) for law in laws)
    assert alone == beside
    assert len(beside) == 1
    assert beside[0].agrees
    assert limit_cycle.predict(unstable, {"upper_column": "coulomb"}) == limit_cycle.predict(
        unstable, "viscous,sigma_2=0"
    )


def test_the_cycle_that_does_not_attract_is_the_threshold(unstable):
    """Hands on, a start well below it comes to rest, one well above it goes to the cycle that attracts."""
    threshold, cycle = limit_cycle.predict(unstable, "lugre")
    assert (threshold.attracts, cycle.attracts) == (False, True)
    assert limit_cycle.simulate(unstable, "lugre", 0.6 * threshold.amplitude).amplitude == 0.0
    above = limit_cycle.simulate(unstable, "lugre", 2.5 * threshold.amplitude)
    assert above.amplitude == pytest.approx(cycle.amplitude, rel=0.1)


def test_a_car_without_a_cycle():
    """The default car: nothing is predicted, and nothing found."""
    assert limit_cycle.compare(steady(cornering(CAR, SPEED)), "lugre") == []


def test_first_harmonic_of_the_command():
    """Small amplitudes: slope of the boost with its filter, less the damping; a large torque: 4/pi of the limit."""
    a, f = CAR.assist, 20.0
    balance = limit_cycle._Balance(steady(cornering(CAR, SPEED)), "coulomb")
    z = np.exp(2j * math.pi * f * SAMPLE_TIME)
    slope, D = boost_gain(a, 0.0, SPEED), np.interp(SPEED, a.speeds, a.damping)
    T, w = 0.01 * np.exp(0.3j), 0.02j
    expected = answer(a, slope).state_space()(z) * T - D * w
    assert abs(balance.command(z, T, w) / expected - 1.0) < 1e-3
    weak = limit_cycle._Balance(steady(cornering(CAR._replace(assist=a._replace(limit=1e-3)), SPEED)), "coulomb")
    assert abs(weak.command(z, 5.0, 0.0)) == pytest.approx(4e-3 / math.pi, rel=1e-3)


@pytest.mark.whole
def test_a_cycle_at_the_limit_of_the_motor():
    """Hands off with the motor's own limit: within 10 %, where the limit halves the frequency."""
    assist = CAR.assist._replace(boost=3.0 * CAR.assist.boost, delay=4)
    point = with_hands(steady(cornering(CAR._replace(assist=assist), 50.0 / 3.6)), "off")
    largest = max(limit_cycle.compare(point, "lugre"), key=lambda each: each.simulated.amplitude)
    assert largest.agrees
    assert largest.simulated.frequency < 20.0
