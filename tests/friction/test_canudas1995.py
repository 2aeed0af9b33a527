"""The experiments of the LuGre paper, run in the project's own step frame with a mass of 1 kg in place of the column.

Canudas de Wit, Olsson, Åström, Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419-425: table I and section III.
Expected numbers come from the same equations in an adaptive solver at 1e-9, to the digits given. The parameter set is
not passive, so the class is used directly.
"""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from steer_env.friction import law
from steer_env.friction.models.lugre import LuGre
from steer_env.friction.numerics.kernel import bind

P = LuGre(sigma_0=1e5, sigma_1=math.sqrt(1e5), sigma_2=0.4, F_c=1.0, F_s=1.5, v_s=1e-3)  # N/m, N s/m, N, m/s


def run(duration, h, force, stiffness=0.0):
    """Times, positions, step-mean speeds and friction of the mass under ``force(t)`` and a spring to the ground."""
    memory, n = np.zeros(1), round(duration / h)
    u = force(h * (np.arange(n) + 0.5))
    S = 2.0 / h + 0.5 * stiffness * h
    step = bind(law.step, P, 1.0, memory, S, 0.0, h, 0.0)
    x = v = w = 0.0
    rows = np.empty((n, 3))
    for i in range(n):
        w, F = step(P, 1.0, memory, S, 2.0 * v / h - stiffness * x + u[i], h, w)
        x += h * w
        v = 2.0 * w - v
        rows[i] = x, w, F
    return h * np.arange(1, n + 1), *rows.T


def solve_ode(duration, force, stiffness=0.0):
    """The paper's equations as they stand, in scipy: a dense solution of ``x, v, z`` and the friction along it."""

    def slip(v, z):
        return v - P.sigma_0 * abs(v) * z / (P.F_c + (P.F_s - P.F_c) * np.exp(-((v / P.v_s) ** 2)))

    def friction(y):
        return P.sigma_0 * y[2] + P.sigma_1 * slip(y[1], y[2]) + P.sigma_2 * y[1]

    def derivative(t, y):
        return [y[1], force(t) - stiffness * y[0] - friction(y), slip(y[1], y[2])]

    solution = solve_ivp(derivative, (0.0, duration), np.zeros(3), "LSODA", rtol=1e-9, atol=1e-13, dense_output=True)
    return solution.sol, friction


def first_peak(t, F):
    i = np.argmax(np.diff(F) < 0.0)
    return t[i], F[i]


def upward_crossings(t, signal, level):
    return t[1:][(signal[:-1] < level) & (signal[1:] >= level)]


def test_presliding_displacement():
    times, forces = [0.0, 15.0, 20.0, 45.0, 50.0, 75.0], [0.0, 1.425, 1.425, -1.425, -1.425, 1.425]
    t, x, _, _ = run(75.0, 2e-4, lambda t: np.interp(t, times, forces))
    reached = 1e6 * np.interp(times[1:], t, x)
    # the digits printed; creep near break-away leaves 3e-3 um to the step of 0.2 ms
    np.testing.assert_allclose(reached, [44.88, 45.18, -9.71, -10.07, 44.82], atol=0.006)


@pytest.mark.parametrize(
    ("omega", "falling", "rising"), [(1.0, 1.05270, 1.05392), (10.0, 1.04831, 1.06109), (25.0, 1.04347, 1.07956)]
)
def test_frictional_lag(omega, falling, rising):
    """Friction is lower on the way down than on the way up, the more so the faster the speed changes."""
    n = 20_000
    h = 2.0 * math.pi / omega / n
    memory = np.zeros(1)
    found = {}
    for i in range(2 * n):  # the first cycle settles
        law.advance(P, 1.0, memory, 1e-3 * (1.5 + math.cos(omega * h * (i + 0.5))), h)
        if (i + 1) % (n // 2) == n // 4:
            found["rising" if (i + 1) % n > n // 2 else "falling"] = law.torque(P, 1.0, memory, 1.5e-3)
    assert found["falling"] == pytest.approx(falling, abs=0.6e-5)  # the digits printed
    assert found["rising"] == pytest.approx(rising, abs=0.6e-5)


def test_static_friction_between_the_lags():
    memory = np.zeros(1)
    law.advance(P, 1.0, memory, 1.5e-3, 10.0)
    assert law.torque(P, 1.0, memory, 1.5e-3) == pytest.approx(1.05330, abs=0.6e-5)


def test_hunting_under_pid_control():
    """Unit step with K_v 6, K_p 3, K_i 4: the integrator winds up in stick, the mass jumps past the target."""
    K_v, K_p, K_i, h = 6.0, 3.0, 4.0, 1e-3
    S = 2.0 / h + K_v + 0.5 * K_p * h + 0.25 * K_i * h**2
    memory = np.zeros(1)
    step = bind(law.step, P, 1.0, memory, S, 0.0, h, 0.0)
    x = v = w = integral = 0.0
    path = []
    for _ in range(200_000):
        error = x - 1.0
        R = 2.0 * v / h - K_p * error - K_i * (integral + 0.5 * h * error)
        w, _ = step(P, 1.0, memory, S, R, h, w)
        x += h * w
        v = 2.0 * w - v
        integral += h * (error + 0.5 * h * w)
        path.append(x)
    t = h * np.arange(1, 200_001)
    late = np.array(path)[t > 50.0]
    assert late.min() == pytest.approx(0.936, abs=0.0006)  # the digits printed
    assert late.max() == pytest.approx(1.064, abs=0.0006)
    periods = np.diff(upward_crossings(t[t > 50.0], late, 1.0))
    np.testing.assert_allclose(periods, 24.4, atol=0.06)
    assert np.ptp(periods) < 3 * h  # a limit cycle


def test_break_away_force_falls_with_the_force_rate():
    peaks = []
    for rate in (1.0, 2.0, 5.0, 10.0, 20.0, 50.0):  # [N/s]
        t, _, _, F = run(1.6 / rate, 2e-4 / rate, lambda t: rate * t)  # noqa: B023
        time, peak = first_peak(t, F)
        solution, friction = solve_ode(1.6 / rate, lambda t: rate * t)  # noqa: B023
        fine = np.linspace(0.0, 1.6 / rate, 40_001)
        expected_time, expected = first_peak(fine, friction(solution(fine)))
        # second order at 1/7000 of the ramp, and the peak lies between samples
        assert peak == pytest.approx(expected, rel=2e-6)
        assert time == pytest.approx(expected_time, rel=1e-3)
        peaks.append(peak)
    assert np.all(np.diff(peaks) < 0.0)
    assert P.F_c < min(peaks)
    assert max(peaks) < P.F_s


def test_stick_slip():
    """A spring of 2 N/m drawn at 0.1 m/s: the mass sticks until the spring breaks it away, and again."""
    k, speed = 2.0, 0.1
    t, x, w, F = run(40.0, 5e-4, lambda t: k * speed * t, k)
    slips = upward_crossings(t, w, 0.01)
    periods = np.diff(slips)
    assert len(slips) == 6
    assert np.ptp(periods) < 2e-3  # four steps
    # between slips the spring gathers what a slip lets go
    advance = np.interp(slips[1:] - 0.1, t, x) - np.interp(slips[:-1] - 0.1, t, x)
    np.testing.assert_allclose(advance, speed * periods, rtol=1e-3)
    # a slip lasts half a swing, pi/sqrt(k) = 2.2 s, and the draw; then only the bristles bend, within -F_s..F_s
    stuck = (t > slips[0] + 3.5) & (t < slips[1] - 0.5)
    assert np.ptp(x[stuck]) < 2.0 * P.F_s / P.sigma_0
    assert F[t > 5.0].max() == pytest.approx(first_peak(t, F)[1], rel=1e-3)

    solution, friction = solve_ode(15.0, lambda t: k * speed * t, k)
    fine = np.linspace(0.0, 15.0, 60_001)
    y = solution(fine)
    # the instant of a slip hangs on creep just before it; two steps of the sampling
    np.testing.assert_allclose(slips[:2], upward_crossings(fine, y[1], 0.01), atol=1e-3)
    assert F.max() == pytest.approx(friction(y).max(), rel=1e-5)
    assert w.max() == pytest.approx(y[1].max(), rel=1e-4)
