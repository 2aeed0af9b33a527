"""Masing: step equation, constructors, comparison with Dahl; ``tests.friction.oracles`` has the closed forms."""

import math

import numpy as np
import pytest

from steer_env import friction
from steer_env.friction import law
from steer_env.friction.models.masing import Masing, from_virgin_curve, virgin_torque
from steer_env.testing.histories import at_rest
from tests.friction.oracles import DYADIC, exponential


def mean_torque(p, memory, w, h):
    """Step-mean torque at constant speed, element by element: the spring's part of the step, then the slider's."""
    D, side = abs(w) * h, math.copysign(1.0, w)
    gap = np.maximum(p.y - side * memory, 0.0)
    springs = np.where(gap > D, side * memory + 0.5 * D, p.y - 0.5 * gap**2 / D)
    damper = p.sigma_1 * np.minimum(gap, D) / (h * p.k.sum())
    return side * np.sum(p.k * (springs + damper))


def test_virgin_branch():
    x = np.arange(64) / 1024
    np.testing.assert_array_equal(friction.response(DYADIC, x, 1 / 1024), virgin_torque(DYADIC, x))


def test_step_equation_is_solved_exactly():
    """Over stiff and soft elements, inertias and steps: the residual is rounding of the largest torque."""
    rng = np.random.default_rng(2)
    for _ in range(3000):
        n = rng.integers(1, 33)
        p = Masing(10.0 ** rng.uniform(-3, 5, n), np.sort(10.0 ** rng.uniform(-6, 0, n)), rng.choice([0.0, 2.0]))
        memory = p.y * np.clip(rng.uniform(-2, 2, n), -1, 1)
        S, h = 10.0 ** rng.uniform((-6, -6), (6, -2))
        R = 10.0 ** rng.uniform(-9, 9) * rng.choice([-1, 1])
        w = law.solve(p, 1.0, memory, S, R, h, 0.0)
        residual = S * w + mean_torque(p, memory, w, h) - R
        assert abs(residual) <= 1e-14 * (abs(S * w) + abs(R) + np.sum(p.k * p.y))


def test_step_that_ends_its_first_pass_on_a_yield():
    """One gap equals the first guess of the march to the bit and still has to be counted in the second pass."""
    p = Masing(np.array([1.0, 1.0]), np.array([0.5, 1.0]), 0.0)
    w = law.solve(p, 1.0, np.zeros(2), 1.0, 2.0, 1.0, 0.0)
    assert w > 1.0
    assert w + mean_torque(p, np.zeros(2), w, 1.0) == pytest.approx(2.0, rel=1e-15)


def test_micro_damper_leaves_the_saturated_torque_alone():
    p = friction.make("masing", sigma_1=2.0)
    memory = at_rest(p)
    law.advance(p, 1.0, memory, 1.0, 1.0)
    assert law.torque(p, 1.0, memory, 1.0) == pytest.approx(0.9, rel=1e-15)
    assert law.torque(p, 1.0, memory, -1.0) == pytest.approx(0.9 - 2.0, rel=1e-14)


# Constructors


def test_virgin_curve_passes_through_its_points():
    x, T = np.array([0.001, 0.004, 0.01, 0.03]), np.array([0.2, 0.6, 0.8, 0.9])
    p = from_virgin_curve(x, T)
    np.testing.assert_allclose(virgin_torque(p, [*x, 1.0, -0.004]), [*T, 0.9, -0.6], rtol=1e-15)
    straight = from_virgin_curve(0.03 * x, 7.0 * x)  # points on one line, up to rounding, are concave
    assert virgin_torque(straight, 0.0001) == pytest.approx(7.0 / 0.03 * 0.0001, rel=1e-12)


@pytest.mark.parametrize("elements", [1, 3, 10, 32])
def test_exponential_virgin_curve(elements):
    p = friction.make("masing", F_c=2.0, x_c=0.01, elements=elements)
    assert p.k.size == elements
    assert virgin_torque(p, 1.0) == pytest.approx(2.0, rel=1e-14)
    x = np.linspace(0.0, 0.2, 5001)
    error = np.abs(virgin_torque(p, x) - 2.0 * -np.expm1(-x / 0.01))
    # the chords and the end, which is the worst, stay within exp(-u) at the last knot
    assert error.max() <= 2.0 / (elements + 1) ** 2 * (1 + 1e-9)


# Beside Dahl, on the same virgin curve F_c (1 - exp(-x/z_c))


def saturated_branches(p, z_c):
    x = np.r_[0.0, 20.0 * z_c * np.r_[1.0, np.cos(np.linspace(0.0, 2.0 * np.pi, 2001))]]
    return friction.response(p, x, 1e-3)[2:]


def test_saturated_loops_coincide_when_masing_is_half_as_long():
    dahl = saturated_branches(friction.make("dahl", sigma_0=1.0, F_c=1.0), 1.0)
    tail = np.linspace(0.0, 1.0, 4001)[1:-1]
    many = saturated_branches(exponential(0.5, -0.5 * np.log(tail[::-1])), 1.0)
    np.testing.assert_allclose(many, dahl, atol=3e-4)  # twice the last knot's tail, 1/4000


def test_defaults_share_the_saturated_loop():
    """Ten elements leave a hundredth of the saturated torque, twice the virgin curve's 1/11^2 at the worst."""
    dahl = saturated_branches(friction.make("dahl"), 0.009)
    masing = saturated_branches(friction.make("masing"), 0.009)
    assert np.abs(masing - dahl).max() <= 0.9 * 2.0 / 121 * (1 + 1e-6)
    lugre = saturated_branches(friction.make("lugre", sigma_1=0.0), 0.009)
    np.testing.assert_allclose(lugre, dahl, rtol=1e-13, atol=1e-15)
