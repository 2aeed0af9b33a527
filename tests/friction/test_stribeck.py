"""The set-valued law with a Stribeck curve, and the exponential spring with its Maxwell branch."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from steer_env import friction
from steer_env.friction import law
from steer_env.friction.models import stribeck
from steer_env.testing.histories import memory_after

P = friction.make("stribeck", F_c=1.0, F_s=1.5, v_s=0.05, sigma_2=0.2)


@pytest.mark.parametrize("R", [0.3, -1.2, 1.5, -1.5])
def test_it_sticks_up_to_break_away(R):
    assert law.step(P, 1.0, np.zeros(0), 100.0, R, 1e-3, 1.0) == (0.0, R)


@pytest.mark.parametrize("S", [9.0, 50.0, 5e3])
@pytest.mark.parametrize("R", [1.5 + 1e-9, -1.6, 2.5, -30.0, 1e4])
def test_the_step_equation_against_scipy(S, R):
    def residual(w):
        return S * w + math.copysign(1.0 + 0.5 * math.exp(-((w / 0.05) ** 2)), w) + 0.2 * w - R

    expected = brentq(residual, math.copysign(1e-300, R), R / S, xtol=1e-16, rtol=1e-14)
    w, T = law.step(P, 1.0, np.zeros(0), S, R, 1e-3, 0.0)
    assert w == pytest.approx(expected, rel=1e-12, abs=1e-16)
    assert T == R - S * w


def test_steepest_fall_is_that_of_the_curve():
    v = np.linspace(1e-6, 0.3, 100_001)
    curve = np.array([law.torque(P, 2.0, np.zeros(0), each) for each in v])
    assert stribeck.steepest_fall(P, 2.0, 1e-3) == pytest.approx(-np.diff(curve).min() / (v[1] - v[0]), rel=1e-6)
    assert stribeck.steepest_fall(P._replace(F_s=1.0), 1.0, 1e-3) == 0.0


def test_without_a_branch_the_exponential_spring_is_dahl_to_the_bit():
    x = np.cumsum(np.random.default_rng(2).normal(0.0, 3e-3, 500))
    spring, dahl = friction.make("exponential_spring", k_m=0.0), friction.make("dahl")
    np.testing.assert_array_equal(friction.response(spring, x, 1e-3, 1.3), friction.response(dahl, x, 1e-3, 1.3))
    memory, other, w = np.zeros(2), np.zeros(1), 0.0
    for R in np.random.default_rng(3).normal(0.0, 2.0, 300):
        found = law.step(spring, 1.1, memory, 60.0, R, 1e-3, w)
        assert found == law.step(dahl, 1.1, other, 60.0, R, 1e-3, w)
        w = found[0]


def test_the_branch_relaxes_at_rest_and_the_spring_holds():
    p = friction.make("exponential_spring", k_m=50.0, tau_m=0.1)
    memory = memory_after(p, [(0.5, 0.01)])
    before = memory.copy()
    law.advance(p, 2.0, memory, 0.0, 0.3)
    assert memory.tolist() == [before[0], pytest.approx(before[1] * math.exp(-0.3 / 0.2), rel=1e-14)]


def test_the_branch_in_sliding_is_a_viscous_friction():
    p = friction.make("exponential_spring", k_m=50.0, tau_m=0.1)
    assert law.torque(p, 1.5, memory_after(p, [(0.4, 100.0)], 1.5), 0.4) == pytest.approx(
        1.5 * (0.9 + 50.0 * 0.1 * 0.4), rel=1e-12
    )
