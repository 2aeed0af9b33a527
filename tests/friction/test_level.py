"""The level of friction by load, direction and temperature, for every law."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from steer_env import friction
from steer_env.friction import law, level
from steer_env.friction.numerics.kernel import plain
from steer_env.testing.histories import at_rest, both_signs, log, memory_after, moves, steps

LAWS = friction.available()
few = settings(max_examples=60, derandomize=True, deadline=None, database=None)
sides = st.builds(level.Scales, log(-0.5, 0.5), log(-0.5, 0.5))


def test_factors():
    """(F11) by hand: load, asymmetry, a tenth more friction where it is ten kelvin colder, and half a period away."""
    made = level.make(load=1e-3, asymmetry=0.2, temperature_rate=0.01, temperature_rise=-10.0)
    warm = 2.0 * (1.0 + 1e-3 * 400.0) * math.exp(0.1)
    assert level.scales(made, 2.0, -400.0, 3.0) == pytest.approx((1.2 * warm, 0.8 * warm), rel=1e-15)
    np.testing.assert_allclose(
        level.by_sample(made, [0.0, 400.0], [0.0, 1.0], 2.0),
        [[s * math.exp(0.1) for s in (2.4, 1.6)], [1.2 * warm, 0.8 * warm]],
    )
    assert level.scales(level.Level(), 1.7, 1e3, 0.4) == (1.7, 1.7)
    toothed = level.make(position=0.3, order=7.0, peak=0.1, asymmetry=-0.5)
    for x, factor in ((0.1, 1.3), (0.1 + math.pi / 7.0, 0.7), (0.1 + 0.5 * math.pi / 7.0, 1.0)):
        assert level.scales(toothed, 2.0, 0.0, x) == pytest.approx((factor, 3.0 * factor), rel=1e-15)
    beyond = toothed._replace(position=3.0, asymmetry=-5.0)  # as in a unit whose parameters nobody checks
    assert level.scales(beyond, 1.0, 0.0, 0.1 + math.pi / 7.0) == pytest.approx((0.01, 0.19), rel=1e-12)
    assert level.largest(toothed, 2.0, 0.0) == pytest.approx(3.9, rel=1e-15)
    assert level.largest(toothed._replace(position=-0.3), 2.0, 0.0) == pytest.approx(3.9, rel=1e-15)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"load": -1.0}, "load must be finite and at least 0, got -1"),
        ({"position": 1.0}, "position must be finite and at least -0.9 and at most 0.9, got 1"),
        ({"order": 0.0}, "order must be finite and at least 0.01 .* got 0"),
    ],
)
def test_bad_values(given, message):
    with pytest.raises(ValueError, match=message):
        level.make(**given)


def step(p, scales, memory, S, R, h, w_guess):
    return law.step(p, level.choose_scale(p, scales, memory, R, h), memory, S, R, h, w_guess)


@pytest.mark.parametrize("name", LAWS)
def test_passive_however_the_sides_change(name):
    p = friction.make(name)

    @few
    @given(moves, steps, sides, sides)
    def holds(history, driven, scales, other):
        memory, w = memory_after(p, history, scales.positive), 0.0
        energy = law.stored_energy(p, memory)
        for S, R, h in driven:
            scales, other = other, scales
            w, T = step(p, scales, memory, S, R, h, w)
            stored = law.stored_energy(p, memory)
            assert T * w * h - (stored - energy) >= -1e-12 * (abs(R * w * h) + stored + energy)
            energy = stored

    holds()


@pytest.mark.parametrize("name", LAWS)
def test_mirrored_with_exchanged_sides(name):
    p = friction.make(name)

    @few
    @given(moves, steps, sides)
    def holds(history, driven, scales):
        memory, mirrored = memory_after(p, history), memory_after(p, [(-w, h) for w, h in history])
        w = 0.0
        for S, R, h in driven:
            other, T_other = step(p, level.Scales(*scales[::-1]), mirrored, S, -R, h, -w)
            w, T = step(p, scales, memory, S, R, h, w)
            assert (other, T_other) == (-w, -T)
            np.testing.assert_array_equal(mirrored, -memory)

    holds()


@pytest.mark.parametrize("name", LAWS)
def test_the_motion_takes_the_side_of_its_scale(name):
    """No motion against the side whose scale was chosen, and a load at rest between the sides is held."""
    p = friction.make(name)

    @few
    @given(moves, sides, log(-2, 4), both_signs(log(-3, 2)), log(-4, -2))
    def holds(history, scales, S, R, h):
        memory = memory_after(p, history, max(scales))
        used = level.choose_scale(p, scales, memory, R, h)
        rest = law.rest_torque(p, used, memory, h)
        w, _ = law.step(p, used, memory, S, R, h, 0.0)
        assert w * (R - rest) >= 0.0
        assert used in scales

    holds()


@pytest.mark.parametrize("tau_m", [0.003, 0.01, 0.5])
@pytest.mark.parametrize("a", [0.5, -0.9])
def test_a_branch_that_relaxes_chooses_the_side_of_its_motion(tau_m, a):
    """3000 random steps: none goes to the other side, and the torque is continuous in R where the choice may change."""
    rng, scales, S, h = np.random.default_rng(3), level.Scales(1.0 + a, 1.0 - a), 100.0, 1e-3
    p = friction.make("exponential_spring", k_m=200.0, tau_m=tau_m)
    memory, jumps = at_rest(p), []
    for _ in range(3000):
        loaded = memory.copy()
        held = level.choose_scale(p, scales, loaded, 0.0, h)
        rests = [law.rest_torque(p, each, loaded, h) for each in (held, *scales)]
        for R in (law.torque(p, held, loaded, 0.0), *rests):
            near = [step(p, scales, memory.copy(), S, R + side * 1e-9, h, 0.0)[1] for side in (-1.0, 1.0)]
            jumps.append(abs(near[1] - near[0]))
        R = rests[0] + rng.normal() * 10.0 ** rng.uniform(-3, 1)
        used = level.choose_scale(p, scales, memory, R, h)
        rest = law.rest_torque(p, used, memory, h)
        w, _ = law.step(p, used, memory, S, R, h, 0.0)
        assert w * (R - rest) > 0.0
        assert (R > rest) == (R > rests[0])
    assert max(jumps) < 1e-8


def test_coulomb_sticks_between_its_two_limits():
    p, scales = friction.make("coulomb", F_c=1.0), level.Scales(1.5, 0.5)
    for R, w in ((1.5, 0.0), (-0.5, 0.0), (1.6, 0.01), (-0.7, -0.02), (0.0, 0.0)):
        assert step(p, scales, at_rest(p), 10.0, R, 1e-3, 0.0)[0] == pytest.approx(w, abs=1e-15)


@pytest.mark.parametrize("a", [0.1, -0.3])
def test_asymmetric_dahl_against_its_differential_equation(a):
    """dT/dx = sigma_0 (1 - T sgn v/(L F_c)) with the L of the direction; unloading keeps the L of the loading."""
    p = friction.make("dahl", sigma_0=100.0, F_c=1.0)
    x = np.concatenate(
        [np.linspace(0.0, 0.05, 501), np.linspace(0.05, -0.05, 1001)[1:], np.linspace(-0.05, 0.05, 1001)[1:]]
    )
    found = friction.response(p, x, 1e-3, np.tile([1.0 + a, 1.0 - a], (x.size, 1)))

    def slope(distance, T, side):
        own, other = 1.0 + side * a, 1.0 - side * a
        limit = other if own < other and -side * T > own else own
        return side * 100.0 * (1.0 - side * T / limit)

    T = 0.0
    expected = [T]
    for x0, x1 in ((0.0, 0.05), (0.05, -0.05), (-0.05, 0.05)):
        side = math.copysign(1.0, x1 - x0)
        at = np.linspace(0.0, abs(x1 - x0), round(abs(x1 - x0) / 1e-4) + 1)
        run = solve_ivp(slope, (0.0, at[-1]), [T], t_eval=at, args=(side,), rtol=1e-10, atol=1e-12, max_step=1e-4)
        expected += list(run.y[0, 1:])
        T = expected[-1]
    assert np.abs(found - expected).max() < 0.02 * abs(
        a
    )  # the scale changes at a sample, a hundredth of the stiffest rise
    assert (found.max(), found.min()) == pytest.approx((1.0 + a, -(1.0 - a)), rel=1e-3)
    assert np.abs(np.diff(found)).max() < 1e-4 * 100.0 * 2.5  # no jump at a reversal


def test_records_with_a_scale_for_each_sample():
    """One number, one for each sample and one for each sample and direction are the same where they are equal."""
    rng = np.random.default_rng(3)
    x = np.cumsum(rng.normal(0.0, 3e-3, 300))
    one = friction.response("lugre", x, 1e-3, 1.3)
    np.testing.assert_array_equal(friction.response("lugre", x, 1e-3, np.full(300, 1.3)), one)
    np.testing.assert_array_equal(friction.response("lugre", x, 1e-3, np.full((300, 2), 1.3)), one)


def test_sliding_record_follows_its_load():
    made = level.make(load=0.5, asymmetry=0.1)
    x, load = np.linspace(0.0, 1.0, 200), np.linspace(0.0, 2.0, 200)
    found = friction.response("masing", x, 1e-3, level.by_sample(made, load, x))
    np.testing.assert_allclose(found[20:], 0.9 * 1.1 * (1.0 + 0.5 * load[20:]), rtol=1e-12)


@pytest.mark.parametrize(
    ("scale", "message"),
    [
        (np.ones(3), r"one value for each of the 4 samples .* got shape \(3,\)"),
        ([[1.0, 1.0], [1.0, 0.0], [1.0, 1.0], [1.0, 1.0]], "must be positive, got 0 at sample 1"),
    ],
)
def test_bad_scales(scale, message):
    with pytest.raises(ValueError, match=message):
        friction.response("dahl", np.arange(4.0), 1e-3, scale)


def test_plain_python_chooses_alike():
    p, memory = friction.make("dahl"), np.array([0.02])
    other = memory.copy()
    scales = level.Scales(2.0, 0.5)
    assert (
        level.choose_scale(p, scales, memory, -1.0, 1e-3)
        == plain(level.choose_scale)(p, scales, other, -1.0, 1e-3)
        == 2.0
    )
    assert memory == other


def test_a_temperature_without_its_rate_is_told():
    with pytest.warns(UserWarning, match=r"temperature_rise 10 K has no effect: temperature_rate is 0"):
        level.make(temperature_rise=10.0)
