"""Closed forms of Coulomb, viscous, Dahl and LuGre friction; Masing's are in ``test_masing``.

Work is summed from exact step means, so only rounding is left where a tolerance is 1e-11 or less.
"""

import math

import numpy as np
import pytest

import friction
from friction import law
from friction.models.lugre import LuGre, saturation
from tests.friction.contracts import at_rest

STRIBECK = friction.make("lugre", sigma_1=1.0, sigma_2=0.6, F_c=0.9, F_s=1.35, v_s=0.02)
ACTIVE = LuGre(sigma_0=100.0, sigma_1=2.0, sigma_2=0.1, F_c=0.9, F_s=1.5, v_s=0.05)  # not passive: a formula only


def cycle(p, memory, displacements, speed):
    """Work over a closed path, advanced in place [J]."""
    work = 0.0
    for dx in displacements:
        w, h = math.copysign(speed, dx), abs(dx) / speed
        work += law.mean_torque(p, 1.0, memory, w, h)[0] * w * h
        law.advance(p, 1.0, memory, w, h)
    return work


def triangle(A, pieces=8):
    """Displacements of one cycle between ``-A`` and ``A``, from ``-A``."""
    return np.repeat([2.0 * A / pieces, -2.0 * A / pieces], pieces)


# Coulomb and viscous


@pytest.mark.parametrize("R", [0.3, -0.3, 0.9, -0.9])
def test_coulomb_sticks_exactly(R):
    assert law.step(friction.make("coulomb", F_c=0.9), 1.0, np.zeros(0), 100.0, R, 1e-3, 1.0) == (0.0, R)


def test_coulomb_response():
    torque = friction.response("coulomb", [0.0, 0.1, 0.3, 0.3, 0.2], 1e-3)
    assert torque.tolist() == [0.0, 0.9, 0.9, 0.0, -0.9]


def test_coulomb_oscillator_loses_two_F_over_k_per_half_cycle():
    m, k, F, x_0 = 0.05, 8.0, 0.1, 0.51
    p = friction.make("coulomb", F_c=F)
    h = 1e-4
    x, v, w = x_0, 0.0, 0.0
    turns, last = [x_0], 0.0
    for _ in range(60_000):
        w, _ = law.step(p, 1.0, np.zeros(0), 2.0 * m / h + 0.5 * k * h, 2.0 * m * v / h - k * x, h, w)
        x, v = x + h * w, (2.0 * w - v if w else 0.0)  # a stuck step ends at rest
        if w * last < 0.0 or (w == 0.0 and last != 0.0):
            turns.append(x)
        last = w
    # Until |x| <= F/k, where it sticks. A step across a turning point covers at most a h^2/2 = 4e-7 rad.
    expected = [(-1) ** n * (x_0 - n * 2.0 * F / k) for n in range(len(turns))]
    assert len(turns) == 21
    np.testing.assert_allclose(turns, expected, atol=2e-6)
    assert w == 0.0


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


# LuGre


@pytest.mark.parametrize("v", [1e-3, -0.02, 0.5, -20.0])
@pytest.mark.parametrize("p", [friction.make("lugre"), STRIBECK, ACTIVE], ids=["default", "Stribeck", "active"])
def test_lugre_constant_speed_from_rest(p, v):
    G = p.F_c + (p.F_s - p.F_c) * math.exp(-((v / p.v_s) ** 2))
    assert saturation(p, 1.0, v)[0] == pytest.approx(G, rel=1e-15)
    dt = 0.05 * G / (p.sigma_0 * abs(v))
    t = dt * np.arange(200)
    e = np.exp(-p.sigma_0 * abs(v) * t / G)
    expected = G * math.copysign(1.0, v) * (1.0 - e) + p.sigma_1 * v * e + p.sigma_2 * v
    torque = friction.response(p, v * t, dt)
    # 200 steps of a few roundings, the displacements' among them
    np.testing.assert_allclose(torque[1:], expected[1:], rtol=0.0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("v", [2e-3, 0.05, 1.0])
@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("p", [friction.make("lugre"), STRIBECK], ids=["default", "Stribeck"])
def test_lugre_triangle(p, ratio, v):
    G = saturation(p, 1.0, v)[0]
    z_g = G / p.sigma_0
    A = ratio * z_g
    tip = z_g * math.tanh(ratio)
    memory = at_rest(p)
    for _ in range(1 + math.ceil(10.0 / ratio)):  # a transient of exp(-4 ratio) per cycle
        work = cycle(p, memory, triangle(A), v)
    assert memory[0] == pytest.approx(-tip, rel=1e-12)
    expected = 4.0 * (G * (A - tip) + p.sigma_1 * v * tip + p.sigma_2 * v * A)
    # at small amplitudes the works of both branches cancel down to A^3: relative to the torque at work
    assert abs(work - expected) <= 1e-12 * 4.0 * A * (G + (p.sigma_1 + p.sigma_2) * v)


@pytest.mark.parametrize("v_0", [0.005, 0.02, 0.04])
@pytest.mark.parametrize("pace", [0.1, 1.0, 10.0])
def test_lugre_sliding_linearisation(v_0, pace):
    p = STRIBECK
    g, slope = (value / p.sigma_0 for value in saturation(p, 1.0, v_0))
    omega = pace * v_0 / g
    expected = p.sigma_2 + (p.sigma_0 + p.sigma_1 * 1j * omega) * (v_0 * slope / g) / (1j * omega + v_0 / g)
    n, ripple = 1000, 1e-4 * v_0
    h = 2.0 * math.pi / omega / n
    waves = np.exp(1j * omega * h * (np.arange(n) + 0.5))
    memory = np.array([g])
    for _ in range(2 + math.ceil(3.0 * pace)):  # transients die as exp(-t v_0/g): 18 time constants
        F = []
        for wave in waves:
            w = v_0 + ripple * wave.real
            F.append(law.mean_torque(p, 1.0, memory, w, h)[0])
            law.advance(p, 1.0, memory, w, h)
    gain = 2.0 * np.mean(np.array(F) * waves.conj()) / ripple
    # speed held over a step: (omega h)^2/24 = 2e-6; ripple squared: 1e-8; both relative to the branches' sizes
    assert abs(gain - expected) < 1e-5 * (abs(expected - p.sigma_2) + p.sigma_2)


# Dahl


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0])
def test_dahl_work_of_any_waveform(ratio):
    p = friction.make("dahl", sigma_0=100.0, F_c=0.9)
    z_c = p.F_c / p.sigma_0
    A = ratio * z_c
    rng = np.random.default_rng(3)
    up, down = (np.diff(np.r_[0.0, np.sort(rng.uniform(0.0, 2.0 * A, 30)), 2.0 * A]) for _ in range(2))
    memory = at_rest(p)
    for _ in range(1 + math.ceil(10.0 / ratio)):
        work = cycle(p, memory, np.r_[up, -down], speed=rng.uniform(0.01, 10.0))
    # cancellation at small amplitudes, as for LuGre
    assert abs(work - 4.0 * p.F_c * (A - z_c * math.tanh(ratio))) <= 1e-11 * 4.0 * A * p.F_c


@pytest.mark.parametrize(("f_1", "f_2"), [(-0.3, 0.8), (0.2, 0.9), (0.5, 0.6)])
def test_dahl_drifts_under_a_force_cycle_and_masing_does_not(f_1, f_2):
    dahl = friction.make("dahl", sigma_0=100.0, F_c=0.9)
    z_c = 0.009
    # inverse of F = F_c (1 - (1 - f) exp(-+dx/z_c)) up and down
    up, down = z_c * math.log((1 - f_1) / (1 - f_2)), z_c * math.log((1 + f_2) / (1 + f_1))
    drift = z_c * math.log((1.0 - f_1**2) / (1.0 - f_2**2))
    start = z_c * math.log(1.0 / (1.0 - f_1)) if f_1 > 0 else -z_c * math.log(1.0 / (1.0 + f_1))
    path = np.cumsum([0.0, start] + 5 * [up, -(up - drift)])
    torque = friction.response(dahl, path, 1e-3) / dahl.F_c
    assert up - down == pytest.approx(drift, rel=1e-13)
    np.testing.assert_allclose(torque[1::2], f_1, rtol=1e-13)
    np.testing.assert_allclose(torque[2::2], f_2, rtol=1e-13)

    masing = friction.make("masing")
    x_1, x_2 = 0.004, 0.011  # a force cycle is a displacement cycle: the loop closes
    torque = friction.response(masing, [0.0, x_2, x_1, x_2, x_1, x_2, x_1], 1e-3)
    np.testing.assert_allclose(torque[1::2], torque[1], rtol=1e-15)
    np.testing.assert_allclose(torque[2::2], torque[2], rtol=4e-15)
