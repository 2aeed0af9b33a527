"""Laws that give their differential equation only: the integration against closed forms and against scipy."""

import importlib
import re
import sys
from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from steer_env import friction
from steer_env.friction import law, ode
from steer_env.friction.numerics.kernel import plainly
from steer_env.testing import CHECKS, check_plain_python, friction_law
from steer_env.testing.histories import at_rest, memory_after

STRIBECK = {"sigma_1": 1.0, "sigma_2": 0.6, "F_c": 0.9, "F_s": 1.35, "v_s": 0.02}


@pytest.fixture(scope="module", autouse=True)
def toys():
    """The toy laws, registered for this module's tests only."""
    with law.LAWS.restored():
        module = importlib.import_module("tests.friction.toy_equations")
        yield module
        del sys.modules[module.__name__]


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
@pytest.mark.parametrize(
    "given",
    ["toy_jenkins_dahl", "toy_thermal", {"law": "toy_thermal", "tau": 60.0, "heating": 0.03}],
    ids=["two bristles", "bristle and temperature", "slow temperature"],
)
def test_contract(given, check):
    check(friction.resolve(given))


def test_plain_python_equals_compiled():
    check_plain_python([friction.make("toy_jenkins_dahl"), friction.make("toy_thermal")])


@pytest.mark.parametrize("T_0", [0.0, 293.0, -1e3])
def test_the_temperature_of_rest_changes_no_torque(T_0):
    """What is kept is the difference from rest, with the rounding of a temperature."""
    x = 0.05 * np.sin(np.linspace(0.0, 20.0, 400))
    found, expected = (friction.response({"law": "toy_thermal", "T_0": each}, x, 1e-2) for each in (T_0, 1.0))
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_a_temperature_rises_in_motion_and_falls_at_rest_as_its_closed_form():
    p, w, t = friction.make("toy_thermal"), 2.0, 0.013
    memory = memory_after(p, [(w, t)])
    warm = p.heating * w * p.tau * (1.0 - np.exp(-t / p.tau))
    assert memory[1] == pytest.approx(warm, rel=1e-8)
    law.advance(p, 1.0, memory, 0.0, t)
    assert memory[1] == pytest.approx(warm * np.exp(-t / p.tau), rel=1e-8)


@pytest.fixture
def changed(toys, request):
    """The law with a temperature under another name, for one test, with other functions."""

    def register(given, without=()):
        kind = re.sub(r"\W", "_", request.node.name)  # of its own, by which what is compiled is kept
        parameters = NamedTuple(kind, [(name, float) for name in toys.Thermal._fields])
        functions = toys.THERMAL | {"make": lambda: parameters(*toys.make_thermal())} | given
        law.register("changed", parameters, **{key: functions[key] for key in functions.keys() - {*without}})
        return friction.make("changed")

    with law.LAWS.restored():
        yield register


def second(value):
    return lambda p, memory: memory.__setitem__(1, value)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"parity": lambda p: ("odd",)}, r"parity must be .* each of the 2 floats of memory_size, got \('odd',\)"),
        ({"parity": lambda p: ("odd", "both")}, r"parity must be 'odd' or 'even' .*got \('odd', 'both'\)"),
        ({"parity": ("odd", "even")}, "parity must be a function of the parameters, got"),
        (
            {"parity": None},
            r"rest\(p, memory\): memory\[1\] is odd and must be 0 at rest, got 293; parity says",
        ),
        ({"rest": second(np.nan)}, r"rest\(p, memory\) is not finite at w = 0: memory\[1\] is nan"),
        ({"rest": lambda p, memory: memory.__setitem__(2, 1.0)}, r"rest\(p, memory\) raises at w = 0: IndexError"),
        ({"rest": lambda p, memory: 1.0}, r"rest\(p, memory\) must return no numbers, got 1.0"),
        ({"rate": lambda p, L, memory, w, out: out.__setitem__(1, np.inf)}, r"is not finite at w = 0: out\[1\] is inf"),
        (
            {"mean_torque": lambda p, L, memory, w, h: (0.0, 0.0), "advance": ode.advance, "cut_back": None},
            "rest is for laws that are integrated; the memory of others is zero at rest",
        ),
    ],
)
def test_a_bad_parity_or_rest_is_refused(changed, given, message):
    with pytest.raises(ValueError, match=f"^friction law 'changed': .*{message}"):
        changed(given)
    assert "changed" not in friction.available()


def test_functions_are_tried_with_the_memory_of_rest(changed):
    """A rate that divides by the temperature is finite at rest."""
    changed({"rate": lambda p, L, memory, w, out: out.__setitem__(1, w / memory[1])})
    with pytest.raises(ValueError, match=r"rate\(.* is not finite at w = 0: out\[1\] is nan"):
        changed({"rate": lambda p, L, memory, w, out: out.__setitem__(1, w / memory[1])}, without=["rest"])


UNCUT = r"memory\[0\] must not stay beyond the .* of a slide, found .*: the law has no cut_back"


def test_two_bristles_without_cut_back_are_told_that_it_is_missing(toys):
    with law.LAWS.restored():
        parameters = NamedTuple("Uncut", [(name, float) for name in toys.JenkinsDahl._fields])
        functions = {"torque": toys.torque, "rate": toys.rate, "stored_energy": toys.stored_energy}
        p = parameters(*toys.make_jenkins_dahl())
        law.register("uncut", parameters, make=lambda: p, memory_size=lambda p: 2, **functions)
        with pytest.raises(AssertionError, match=f"(?s)the mean torque must fall by 0 N m s/rad at most.*{UNCUT}"):
            friction_law.check_steepest_fall(p)


@pytest.mark.parametrize(
    ("parity", "message"),
    [
        (("odd", "odd"), r"memory\[1\], which is odd, must be -.*; parity has to say that it is even"),
        (("even", "even"), r"memory\[0\], which is even, must be "),
    ],
)
def test_a_parity_that_a_law_does_not_keep_names_the_entry_of_its_memory(monkeypatch, parity, message):
    p = friction.make("toy_thermal")
    monkeypatch.setitem(law.LAWS._by_class, type(p), law.law_of(p)._replace(parity=lambda p: parity))
    with pytest.raises(AssertionError, match=message):
        friction_law.check_odd_symmetry(p)


def test_a_loaded_memory_that_gives_way_at_rest_is_named(monkeypatch):
    p = friction.make("exponential_spring", k_m=50.0, tau_m=0.2)
    monkeypatch.setitem(law.LAWS._by_class, type(p), law.law_of(p)._replace(relaxes=False))
    with pytest.raises(AssertionError, match=r"rate at rest, .* of memory\[1\], which is odd, must be 0, found "):
        friction_law.check_rest(p)


def test_a_torque_that_gives_way_at_rest_is_refused_where_the_law_does_not_say_so(changed, toys):
    """A bristle whose stiffness falls as the temperature does."""
    p = changed({"torque": toys.stiffened_torque, "stored_energy": toys.stiffened_energy})
    with pytest.raises(AssertionError, match=r"the torque of a held step must stay at .* N m unless the law relaxes"):
        friction_law.check_rest(p)


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
    with pytest.raises(ValueError, match="torque of friction law 'toy_wheel' is nan at sample 1, 1 rad/s"):
        friction.response(p, [0.0, 1.0], 1.0)


def test_a_memory_that_is_not_finite_ends_the_integration():
    p = friction.make("toy_lugre")
    memory = at_rest(p)
    memory[0] = np.nan
    law.advance(p, 1.0, memory, 1.0, 1.0)
    assert np.isnan(memory[0])
