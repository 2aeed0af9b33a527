"""Describing functions against closed forms and against the work of the loops."""

import math

import numpy as np
import pytest

from steer_env import friction
from steer_env.friction.describing_function import describing_function
from tests.friction.oracles import masing_loop_work


@pytest.mark.parametrize("A", [1e-3, 0.05])
def test_coulomb(A):
    """j 4 F_c/(pi A), third harmonic 1/3."""
    found = describing_function(friction.make("coulomb", F_c=0.8), A)
    assert found.value == pytest.approx(4j * 0.8 / (math.pi * A), rel=2e-3)
    assert found.third == pytest.approx(1.0 / 3.0, rel=1e-3)


def test_viscous():
    """j omega sigma_2."""
    found = describing_function(friction.make("viscous", sigma_2=0.3), 0.02, 2.0)
    assert found.value == pytest.approx(0.3 * 4j * math.pi, rel=2e-3)
    assert found.third < 1e-6


@pytest.mark.parametrize("ratio", [1.5, 3.0, 10.0])
def test_one_spring_with_a_slider(ratio):
    """The hysteresis of Prandtl's element: real part by the angle at which it yields, imaginary part by its work."""
    k, y = 100.0, 0.01
    A = ratio * y
    beta = math.acos(1.0 - 2.0 / ratio)
    found = describing_function(friction.make("masing", k=[k], y=[y]), A)
    assert found.value.real == pytest.approx(k / math.pi * (beta - 0.5 * math.sin(2.0 * beta)), rel=2e-3)
    assert found.value.imag == pytest.approx(4.0 * k * y * (A - y) / (math.pi * A**2), rel=2e-3)


@pytest.mark.parametrize("law", friction.available())
def test_imaginary_part_is_the_work(law):
    """Every law: the imaginary part is the work of a cycle over pi A^2, and it is not negative."""
    A, n = 0.02, 2000
    found = describing_function(law, A)
    x = A * np.sin(2.0 * np.pi * np.arange(20 * n + 1) / n)
    torque = friction.response(law, x, 1.0 / n)[-n - 1 :]
    work = float(np.trapezoid(torque, x[-n - 1 :]))
    assert found.value.imag >= 0.0
    assert found.settled
    assert found.value.imag == pytest.approx(work / (math.pi * A**2), rel=0.01, abs=1e-9)


@pytest.mark.parametrize("law", ["lugre", "dahl"])
def test_ends_of_bristles(law):
    """Far below the distance of pre-sliding a spring, far above Coulomb friction."""
    p = friction.make(law)
    assert describing_function(p, 1e-6, 1e-3).value.real == pytest.approx(p.sigma_0, rel=1e-2)
    large = describing_function(p, 3.0, 1e-3).value
    assert large.imag == pytest.approx(4.0 * p.F_c / (3.0 * math.pi), rel=0.02)


def test_work_of_masing():
    A = 0.012
    p = friction.make("masing")
    assert describing_function(p, A).value.imag == pytest.approx(masing_loop_work(p, A) / (math.pi * A**2), rel=2e-3)


def test_refusals():
    with pytest.raises(ValueError, match="amplitude"):
        describing_function("lugre", 0.0)
    with pytest.raises(ValueError, match="frequency"):
        describing_function("lugre", 0.1, -1.0)
