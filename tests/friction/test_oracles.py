"""Coulomb and viscous friction by hand; ``tests.verification.friction`` holds the other closed forms."""

import math

import numpy as np
import pytest

from steer_env import friction
from steer_env.friction import law


@pytest.mark.parametrize("R", [0.3, -0.3, 0.9, -0.9])
def test_coulomb_sticks_exactly(R):
    assert law.step(friction.make("coulomb", F_c=0.9), 1.0, np.zeros(0), 100.0, R, 1e-3, 1.0) == (0.0, R)


def test_coulomb_response():
    torque = friction.response("coulomb", [0.0, 0.1, 0.3, 0.3, 0.2], 1e-3)
    assert torque.tolist() == [0.0, 0.9, 0.9, 0.0, -0.9]


def test_viscous_torque_and_coasting():
    p = friction.make("viscous", sigma_2=0.5)
    np.testing.assert_allclose(friction.response(p, [0.0, 0.01, -0.01], 0.01), [0.0, 0.5, -1.0], rtol=1e-15)
    m, h, v = 0.05, 1e-3, 2.0
    for _ in range(100):
        w, _ = law.step(p, 1.0, np.zeros(0), 2.0 * m / h, 2.0 * m * v / h, h, 0.0)
        v = 2.0 * w - v
    a = 0.5 * h * p.sigma_2 / m  # the midpoint rule turns exp(-2a) into (1 - a)/(1 + a)
    assert v == pytest.approx(2.0 * ((1.0 - a) / (1.0 + a)) ** 100, rel=1e-13)
    assert v == pytest.approx(2.0 * math.exp(-1.0), rel=1e-5)  # a^2/3 per time constant


def test_viscous_default_loses_as_much_per_weave_cycle_as_coulomb():
    A, omega = math.radians(15.1), 2.0 * math.pi * 0.2
    assert math.pi * friction.make("viscous").sigma_2 * omega * A**2 == pytest.approx(4.0 * 0.9 * A, rel=0.01)
