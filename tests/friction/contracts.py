"""What every friction law has to keep: one function ``check_<contract>(p)`` each, for one parameter set.

A check draws histories with hypothesis, derandomised, so a failure is shrunk and comes back in the next run. A law
from outside proves itself with ``for check in CHECKS: check(p)`` and ``check_plain_python([p])``.
"""

import math
import os
import pickle
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from steer_env import friction
from steer_env.friction import law
from steer_env.friction.numerics.kernel import bind

ROOT = Path(__file__).parents[2]

examples = settings(max_examples=40, derandomize=True, deadline=None, database=None)


def log(low, high):
    """Floats between two powers of ten, even in the exponent."""
    return st.floats(low, high).map(lambda exponent: 10.0**exponent)


def signed(magnitudes):
    """Both signs, and zero."""
    return st.tuples(st.sampled_from([1.0, -1.0, 0.0]), magnitudes).map(lambda pair: pair[0] * pair[1])


def move(w, distance):
    """Speed and duration."""
    return w, distance / abs(w) if w else distance


speeds = signed(log(-3, 1.5))  # [rad/s]
torque_scales = log(-1, 1)
# Friction follows displacements, so durations are drawn as distances [rad].
moves = st.lists(st.builds(move, speeds, log(-5, 0)), max_size=8)
# S, R, h of step equations; the load R would give the drawn speed without friction.
steps = st.lists(
    st.builds(lambda S, motion: (S, S * motion[0], motion[1]), log(-2, 4), st.builds(move, speeds, log(-5, 0))),
    min_size=1,
    max_size=8,
)


def at_rest(p):
    return np.zeros(law.law_of(p).memory_size(p))


def after(p, history, torque_scale=1.0, memory=None):
    """Memory after a history of constant speeds."""
    memory = at_rest(p) if memory is None else memory.copy()
    for w, h in history:
        law.advance(p, torque_scale, memory, w, h)
    return memory


def size(p, torque_scale=1.0):
    """Torque of a long slide at 1 rad/s: what rounding is compared with [N m]."""
    return law.torque(p, torque_scale, after(p, [(1.0, 100.0)], torque_scale), 1.0)


def mean_by_quadrature(p, torque_scale, memory, w, h):
    """Mean over the step of ``torque`` along ``advance``: adaptive Simpson, good to about 1e-9 of the torque."""

    def f(t):
        return law.torque(p, torque_scale, after(p, [(w, t)], torque_scale, memory), w)

    def integral(a, b, f_a, f_m, f_b):
        m = 0.5 * (a + b)
        f_l, f_r = f(0.5 * (a + m)), f(0.5 * (m + b))
        whole = (f_a + 4.0 * f_m + f_b) / 6.0 * (b - a)
        halves = (f_a + 4.0 * f_l + 2.0 * f_m + 4.0 * f_r + f_b) / 12.0 * (b - a)
        if abs(halves - whole) <= tolerance:
            return halves + (halves - whole) / 15.0
        return integral(a, m, f_a, f_l, f_m) + integral(m, b, f_m, f_r, f_b)

    # an element may yield at any fraction of the step, so the pieces shrink towards its start
    edges = [0.0, *(h * 10.0**k for k in range(-8, 1))]
    tolerance = (
        1e-11 * h * (size(p, torque_scale) + abs(f(h)))
    )  # of a piece; a jump of the torque ends in one this small
    return sum(integral(a, b, f(a), f(0.5 * (a + b)), f(b)) for a, b in pairwise(edges)) / h


def check_passivity(p):
    """The work done on the law is never less than the energy that it stores, however the torque scale changes."""

    @settings(examples, max_examples=300)
    @given(moves, steps, torque_scales, torque_scales)
    def holds(history, driven, torque_scale, other):
        memory, w_guess = after(p, history, torque_scale), 0.0
        energy = law.stored_energy(p, memory)
        for S, R, h in driven:
            torque_scale, other = other, torque_scale
            w_guess, T = law.step(p, torque_scale, memory, S, R, h, w_guess)
            stored = law.stored_energy(p, memory)
            # T comes from R - S w, so it carries the rounding of R
            assert T * w_guess * h - (stored - energy) >= -1e-12 * (abs(R * w_guess * h) + stored + energy)
            assert stored >= 0.0
            energy = stored

    holds()


def check_odd_symmetry(p):
    """The mirrored history gives the mirrored torque, to the bit: no branch may prefer a side."""

    @examples
    @given(moves, steps, torque_scales)
    def holds(history, driven, torque_scale):
        memory = after(p, history, torque_scale)
        mirrored = after(p, [(-w, h) for w, h in history], torque_scale)
        np.testing.assert_array_equal(mirrored, -memory)
        assert law.stored_energy(p, mirrored) == law.stored_energy(p, memory)
        w_guess = 0.0
        for S, R, h in driven:
            w, T = law.step(p, torque_scale, memory, S, R, h, w_guess)
            assert law.step(p, torque_scale, mirrored, S, -R, h, -w_guess) == (-w, -T)
            np.testing.assert_array_equal(mirrored, -memory)
            assert law.torque(p, torque_scale, mirrored, -w) == -law.torque(p, torque_scale, memory, w)
            np.testing.assert_array_equal(_rate(p, torque_scale, mirrored, -w), -_rate(p, torque_scale, memory, w))
            w_guess = w

    holds()


def check_rest(p):
    """Without a push nothing moves, exactly; a load that the memory balances is held without creep, or only relaxes."""
    relaxes = law.law_of(p).relaxes

    @examples
    @given(moves, log(-6, 6), log(-6, -2), speeds, torque_scales)
    def holds(history, S, h, w_guess, torque_scale):
        memory = at_rest(p)
        assert law.step(p, torque_scale, memory, S, 0.0, h, w_guess) == (0.0, 0.0)
        assert law.torque(p, torque_scale, memory, 0.0) == law.stored_energy(p, memory) == 0.0
        assert not memory.any()

        memory = after(p, history, torque_scale)
        load = law.torque(p, torque_scale, memory, 0.0)
        held = memory.copy()
        if relaxes:
            law.advance(p, torque_scale, held, 0.0, h)
            assert law.stored_energy(p, held) <= law.stored_energy(p, memory)
            return
        assert law.step(p, torque_scale, held, S, load, h, w_guess) == (0.0, load)
        np.testing.assert_array_equal(held, memory)
        assert not _rate(p, torque_scale, memory, 0.0).any()

    holds()


def check_step_equation(p):
    """``S w + mean torque = R`` is solved for any inertia, load, step, fall of the torque scale and guess of w."""
    exact = law.law_of(p).mean_torque is not None

    @settings(examples, max_examples=150 if exact else 50)
    @given(moves, torque_scales, log(-4, 6), signed(log(-9, 9)), log(-6, -2), signed(log(-12, 6)), torque_scales)
    def holds(history, before, S, R, h, w_guess, torque_scale):
        memory = after(p, history, before)
        w = law.solve(p, torque_scale, memory.copy(), S, R, h, w_guess)
        if w == 0.0:  # a set-valued law may stick anywhere between its limits from both sides
            assert law.torque(p, torque_scale, memory, -1e-300) <= R <= law.torque(p, torque_scale, memory, 1e-300)
            return
        if exact:
            mean, _ = law.mean_torque(p, torque_scale, memory, w, h)
        else:
            mean = mean_by_quadrature(p, torque_scale, memory, w, h)
        # solvers go down to rounding, a hundred of them in the largest term; quadrature is good to 1e-9 of the torque
        scale = abs(S * w) + abs(R) + abs(mean) + size(p, torque_scale)
        assert abs(S * w + mean - R) <= (1e-13 if exact else 1e-8) * scale

    holds()


def check_mean_torque(p):
    """``mean_torque`` is the mean of ``torque`` along ``advance``, and its slope is its derivative."""
    if law.law_of(p).mean_torque is None:
        return

    @settings(examples, max_examples=30)
    @given(moves, speeds, log(-5, -1), torque_scales)
    def holds(history, w, h, torque_scale):
        memory = after(p, history, torque_scale)
        mean, slope = law.mean_torque(p, torque_scale, memory, w, h)
        # the quadrature is good to 1e-9
        assert abs(mean - mean_by_quadrature(p, torque_scale, memory, w, h)) <= 1e-8 * (
            abs(mean) + size(p, torque_scale)
        )
        # Central difference: 1e-6 of w loses ten digits of the torque to rounding and w**2 F''' 1e-12 to curvature.
        # At w = 0, where |w| has its kink, the difference is one-sided.
        high, low = (1e-9, 0.0) if w == 0.0 else (w * (1 + 1e-6), w * (1 - 1e-6))
        rise = (
            law.mean_torque(p, torque_scale, memory, high, h)[0] - law.mean_torque(p, torque_scale, memory, low, h)[0]
        )
        rounding = 1e-14 * (abs(mean) + size(p, torque_scale)) / abs(high - low)
        assert abs(rise / (high - low) - slope) <= 1e-5 * abs(slope) + rounding

    holds()


def check_semigroup(p):
    """Two steps at one speed are one longer step, also just after the torque scale has changed."""

    @examples
    @given(moves, torque_scales, speeds, log(-5, -1), st.floats(0.0, 1.0), torque_scales)
    def holds(history, before, w, h, part, torque_scale):
        memory = after(p, history, before)
        split = after(p, [(w, part * h), (w, (1.0 - part) * h)], torque_scale, memory)
        # a few roundings of the largest memory
        scale = np.abs(after(p, [(1.0, 100.0)], max(before, torque_scale))).max(initial=0.0)
        np.testing.assert_allclose(split, after(p, [(w, h)], torque_scale, memory), rtol=1e-13, atol=1e-14 * scale)

    holds()


def check_rate(p):
    """``advance`` is the solution of ``rate``: what a plain ODE solver makes of the law."""

    @settings(examples, max_examples=30)
    @given(moves, signed(log(-3, 0)), log(-3, -1), torque_scales)
    def holds(history, w, h, torque_scale):
        memory = after(p, history, torque_scale)
        scale = np.abs(after(p, [(1.0, 100.0)], torque_scale)).max(initial=1e-12)
        if memory.size:
            solution = solve_ivp(
                lambda t, m: _rate(p, torque_scale, m, w), (0.0, h), memory, rtol=1e-9, atol=1e-10 * scale
            )
            # the solver's tolerance, summed over its steps and over its passing of kinks
            found, continuous = after(p, [(w, h)], torque_scale, memory), memory.size - law.law_of(p).modes(p)
            np.testing.assert_allclose(found[:continuous], solution.y[:continuous, -1], atol=1e-6 * scale)

    holds()


def check_torque_scale(p):
    """At equal speeds and times stretched by the torque scale, the torque is affine in that scale.

    Displacements then stretch with the scale too, which leaves the part in proportion to it (dry friction) and the
    part without it (damping).
    """

    @examples
    @given(moves, speeds, log(-1, 0.3))
    def holds(history, w, torque_scale):
        torques = []
        for stretch in (torque_scale, 2.0 * torque_scale, 3.0 * torque_scale):
            memory = after(p, [(speed, stretch * h) for speed, h in history], stretch)
            torques.append(law.torque(p, stretch, memory, w))
        assert abs(torques[0] - 2.0 * torques[1] + torques[2]) <= 1e-12 * (max(map(abs, torques)) + size(p))

    holds()
    assert size(p, 2.0) >= size(p, 1.0) >= 0.0


def check_convergence(p):
    """The step frame is of second order: errors fall 64-fold from 1 ms to 0.125 ms."""
    I, K, frequency = 0.05, 8.0, 0.7  # a column on the tyres' spring [kg m2, N m/rad, Hz]

    def positions(load, h):
        memory, S = at_rest(p), 2.0 * I / h + 0.5 * K * h
        step = bind(law.step, p, 1.0, memory, S, 0.0, h, 0.0)
        x = v = w = 0.0
        path = []
        for i in range(round(1.0 / h)):
            torque = load * math.sin(2.0 * math.pi * frequency * (i + 0.5) * h)
            w, _ = step(p, 1.0, memory, S, 2.0 * I * v / h - K * x + torque, h, w)
            x += h * w
            v = 2.0 * w - v
            path.append(x)
        return np.array(path)

    errors = np.zeros(2)
    for load in (0.5, 1.2, 2.0, 3.0):  # [N m]
        exact = positions(load, 1e-3 / 32)
        errors += [np.std(positions(load, 1e-3 / n)[n - 1 :: n] - exact[31::32]) for n in (1, 8)]
    assert errors[0] < 2e-4  # [rad], summed over the loads; the swings reach 0.2 to 0.5 rad
    # Kinks of a law scatter the error; stiff ones are not resolved at 1 ms: order 4/3 at least.
    assert errors[0] > 16.0 * errors[1]


CHECKS = (
    check_passivity,
    check_odd_symmetry,
    check_rest,
    check_step_equation,
    check_mean_torque,
    check_semigroup,
    check_rate,
    check_torque_scale,
    check_convergence,
)


def trace(p):
    """Speeds, torques and energies of a fixed random run, and the response to a random displacement."""
    rng = np.random.default_rng(7)
    memory, w, rows = at_rest(p), 0.0, []
    for _ in range(200):
        S, h, torque_scale = 10.0 ** rng.uniform((-1, -5, -0.5), (3, -2, 0.5))
        w, T = law.step(p, torque_scale, memory, S, rng.normal(0.0, 3.0), h, w)
        rows.append((w, T, law.torque(p, torque_scale, memory, w), law.stored_energy(p, memory)))
    x = np.cumsum(rng.normal(0.0, 3e-3, 200))
    return np.array(rows), friction.response(p, x, 1e-3)


def check_plain_python(sets):
    """The kernels mean the same to the interpreter as to the compiler, for a whole list of parameter sets."""
    command = [sys.executable, "-W", "error", "-m", __name__]
    run = subprocess.run(
        command,
        input=pickle.dumps(list(sets)),
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        cwd=ROOT,
        capture_output=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr.decode()
    for p, (rows, torques) in zip(sets, pickle.loads(run.stdout)):
        expected_rows, expected_torques = trace(p)
        # the compiler writes x**2 as x*x and may link another exp: an ulp each, carried on by 200 steps
        np.testing.assert_allclose(rows, expected_rows, rtol=1e-9, atol=1e-12, err_msg=repr(p))
        np.testing.assert_allclose(torques, expected_torques, rtol=1e-12, atol=1e-12, err_msg=repr(p))


def _rate(p, torque_scale, memory, w):
    out = np.zeros_like(memory)
    law.rate(p, torque_scale, memory, w, out)
    return out


if __name__ == "__main__":
    answers = [trace(p) for p in pickle.load(sys.stdin.buffer)]
    sys.stdout.buffer.write(pickle.dumps(answers))
