"""Limit cycles by harmonic balance against simulation, with an assist that has too much boost and delay."""

import math

import numpy as np
import pytest

from steer_env.vehicle import cars, limit_cycle
from steer_env.vehicle.operating_point import cornering, held, steady

CAR = cars.load("compact")
SPEED = 25.0  # [m/s]


@pytest.fixture(scope="module")
def unstable():
    """Straight running with three times the boost, 4 ms of delay and a motor without limit."""
    assist = CAR.assist._replace(boost=3.0 * CAR.assist.boost, delay=4, limit=1e4)
    return steady(cornering(CAR._replace(assist=assist), SPEED))


@pytest.mark.parametrize("hands", ["on", pytest.param("off", marks=pytest.mark.whole)])
@pytest.mark.parametrize("law", ["coulomb", "lugre", "viscous"])
def test_a_cycle_of_the_car_is_predicted(unstable, law, hands):
    """Frequency and amplitude within 10 % where the third harmonic is below 5 %; none is missed."""
    found = limit_cycle.compare(held(unstable, hands), law)
    assert len(found) == 1
    assert 0.01 < found[0].simulated.third < limit_cycle.THIRD
    assert found[0].agrees


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


def test_gain_of_the_boost():
    """At small amplitudes its slope at zero, at large ones 4/pi of its end over the amplitude."""
    a = CAR.assist
    row = np.array([np.interp(SPEED, a.speeds, a.boost[:, i]) for i in range(a.torques.size)])
    assert limit_cycle.boost_gain(a, 0.01, SPEED) == pytest.approx(row[1] / a.torques[1], rel=1e-6)
    assert limit_cycle.boost_gain(a, 1e4, SPEED) == pytest.approx(4.0 * row[-1] / (math.pi * 1e4), rel=1e-3)
