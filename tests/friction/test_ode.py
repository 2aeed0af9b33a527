"""Laws that give their differential equation only: the integration against closed forms and against scipy."""

import importlib
import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from steer_env import friction
from steer_env.friction import law, ode
from steer_env.friction.numerics.kernel import plainly
from steer_env.testing import CHECKS, check_plain_python
from steer_env.testing.histories import at_rest

STRIBECK = {"sigma_1": 1.0, "sigma_2": 0.6, "F_c": 0.9, "F_s": 1.35, "v_s": 0.02}


@pytest.fixture(scope="module", autouse=True)
def toys():
    """The toy laws, registered for this module's tests only."""
    with law.LAWS.restored():
        module = importlib.import_module("tests.friction.toy_equations")
        yield module
        del sys.modules[module.__name__]


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_contract(check):
    check(friction.make("toy_jenkins_dahl"))


def test_plain_python_equals_compiled():
    check_plain_python([friction.make("toy_jenkins_dahl")])


@pytest.mark.parametrize("values", [{}, STRIBECK])
@pytest.mark.parametrize("h", [1e-5, 1e-3, 0.1, 10.0])
def test_lugre_is_that_of_the_closed_form(values, h):
    exact, integrated = friction.make("lugre", **values), friction.make("toy_lugre", **values)
    z_c = exact.F_c / exact.sigma_0
    for w in (1e-6, -1e-3, 0.03, 1.0, -30.0):
        for z in (0.0, 0.5 * z_c, -0.9 * z_c, z_c):
            a, b = np.array([z]), np.array([z, *np.zeros(ode.BLOCKS - 1)])
            (T, slope), (expected, expected_slope) = (
                law.mean_torque(integrated, 1.0, b, w, h),
                law.mean_torque(exact, 1.0, a, w, h),
            )
            largest = abs(expected) + exact.F_c + exact.sigma_1 * abs(w)
            assert abs(T - expected) <= 2e-9 * largest
            # 1e-10 of the torque, divided by a step of 1e-6 of the speed
            assert abs(slope - expected_slope) <= 1e-4 * largest / abs(w) + 1e-5 * abs(expected_slope)
            law.advance(exact, 1.0, a, w, h)
            law.advance(integrated, 1.0, b, w, h)
            assert abs(a[0] - b[0]) <= 2e-9 * z_c
            assert not b[1:].any()


def test_several_memories_against_scipy():
    """Both parts of a law whose first rate jumps within the step."""
    p, w = friction.make("toy_jenkins_dahl"), 0.7
    memory = at_rest(p)
    law.advance(p, 1.0, memory, -0.2, 0.03)

    def derivative(t, m):
        held = np.concatenate([m, np.zeros(memory.size - 2)])
        out = np.zeros_like(memory)
        law.rate(p, 1.0, held, w, out)
        return out[:2]

    solution = solve_ivp(derivative, (0.0, 0.05), memory[:2], "DOP853", rtol=1e-12, atol=1e-15, max_step=1e-5)
    law.advance(p, 1.0, memory, w, 0.05)
    np.testing.assert_allclose(memory[:2], solution.y[:, -1], rtol=1e-6)  # scipy steps over the jump by up to 1e-5 s


@pytest.mark.parametrize("share", [0.01, 0.5, 10.0, 100.0])
def test_a_jump_of_the_rate_is_not_taken_as_steady(share):
    """The memory after 1 s at 0.1 rad/s: up to the jump at full rate, then at the share."""
    for jump in np.random.default_rng(0).uniform(1e-3, 5e-2, 300):
        p = friction.make("toy_jump", y=float(jump), share=share)
        memory = at_rest(p)
        law.advance(p, 1.0, memory, 0.1, 1.0)
        # the error across a jump is up to eighty times that which the two orders show; twice, for safety
        assert memory[0] == pytest.approx(jump + share * (0.1 - jump), rel=2 * 80 * ode.TOLERANCE)


def test_a_substep_begins_with_the_rate_at_the_end_of_the_last(monkeypatch):
    """Six rates for a substep of seven stages, and one at the beginning, in each course of both."""
    p, counts = friction.make("toy_lugre"), {"own_rate": 0, "own_torque": 0}
    own = ode.EQUATIONS[type(p)]

    def counted(name):
        def function(*arguments):
            counts[name] += 1
            return getattr(own, name)(*arguments)

        return function

    monkeypatch.setitem(ode.EQUATIONS, type(p), own._replace(**{name: counted(name) for name in counts}))
    plainly(ode.mean_torque)(p, 1.0, at_rest(p), 0.1, 3e-3)
    substeps = counts["own_torque"] // ode.STAGES
    assert substeps > 2
    assert counts == {"own_rate": 6 * substeps + 2, "own_torque": 7 * substeps}


def test_what_never_becomes_steady_is_not_a_number_after_the_largest_number_of_substeps():
    p = friction.make("toy_wheel")
    memory = at_rest(p)
    T, _ = law.mean_torque(p, 1.0, memory, 1.0, 1.0)
    law.advance(p, 1.0, memory, 1.0, 1.0)
    assert np.isnan(T)
    assert np.isnan(memory[:2]).all()
    assert not memory[2:].any()


def test_a_memory_that_is_not_finite_ends_the_integration():
    p = friction.make("toy_lugre")
    memory = at_rest(p)
    memory[0] = np.nan
    law.advance(p, 1.0, memory, 1.0, 1.0)
    assert np.isnan(memory[0])
