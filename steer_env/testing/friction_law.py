"""What every friction law has to keep: one function ``check_<contract>(p)`` each, for one parameter set.

The histories are the same at every run, so a failure is shrunk and comes back in the next. The distances and speeds
that are drawn are those of a steering column in rad: a law whose pre-sliding distance is far from 0.01 needs a
parameter set of that size.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from hypothesis import Phase, example, given, settings, target
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from steer_env.friction import law, ode, resolve
from steer_env.friction.numerics.kernel import bind
from steer_env.testing.histories import (
    Array,
    at_rest,
    both_signs,
    extent,
    log,
    mean_by_quadrature,
    memory_after,
    mirror,
    moves,
    odd,
    rate,
    size,
    speeds,
    steps,
    torque_scales,
)
from steer_env.testing.plain_python import check_plain_python

# One failure is enough, and an AssertionError; several would be a group of exceptions.
# The smallest example that fails is what is asserted; which of its parts do not matter would take most of the time.
examples = settings(
    max_examples=40,
    derandomize=True,
    deadline=None,
    database=None,
    report_multiple_bugs=False,
    phases=[phase for phase in Phase if phase is not Phase.explain],
)


FASTEST = 30.0  # of a column, about the largest of ``speeds`` [rad/s]


class Tolerances(NamedTuple):
    """What the results of a law are good to, relative to the largest torque, energy or memory [1]."""

    energy: float  # of work and stored energy
    solved: float  # of the step equation
    parts: float  # of two steps against one
    scaled: float  # of torques at stretched times
    slope: float  # of the difference of two mean torques at almost one speed


# Closed forms: a few to a hundred roundings.
EXACT = Tolerances(energy=1e-12, solved=1e-13, parts=1e-13, scaled=1e-12, slope=1e-13)
# An equation that is integrated: 1e-10 in a substep, summed over the substeps, and more across a jump of the rate.
INTEGRATED = Tolerances(energy=1e-8, solved=1e-8, parts=1e-8, scaled=1e-8, slope=3e-8)


def _tolerances(p: Any) -> Tolerances:
    return INTEGRATED if law.law_of(p).mean_torque is ode.mean_torque else EXACT


def _require_entries(p: Any, found: Array, expected: Array, what: str) -> None:
    """Every float of a memory, or of its rate, is to the bit what is expected."""
    for i in np.flatnonzero(found != expected):
        kind = "odd" if odd(p, found)[i] else "even"
        hint = "; parity has to say that it is even" if kind == "odd" and found[i] == -expected[i] else ""
        raise AssertionError(f"{what}[{i}], which is {kind}, must be {expected[i]:.17g}, found {found[i]:.17g}{hint}")


def _fall(p: Any, torque_scale: float, h: float) -> float:
    """What S of a step equation has to exceed for one solution [N m s/rad]."""
    return law.law_of(p).steepest_fall(p, torque_scale, h)


def _limit_for_even(p: Any, value: float, most: float) -> float:
    """A speed or load, no larger than ``most`` for a law with even entries.

    Ages and temperatures have times of their own: far beyond the distances of a column in those times, an integration
    takes too many substeps.
    """
    return min(max(value, -most), most) if "even" in law.law_of(p).parity(p) else value


def check_passivity(p: Any) -> None:
    """The work done on the law is never less than the energy that it stores, however the torque scale changes."""

    @settings(examples, max_examples=300)
    @given(moves, steps, torque_scales, torque_scales)
    def holds(history, driven, torque_scale, other):
        memory, w_guess = memory_after(p, history, torque_scale), 0.0
        energy = law.stored_energy(p, memory)
        for S, R, h in driven:
            torque_scale, other = other, torque_scale
            S += _fall(p, torque_scale, h)
            w_guess, T = law.step(p, torque_scale, memory, S, R, h, _limit_for_even(p, w_guess, 1.0 / h))
            stored = law.stored_energy(p, memory)
            # T comes from R - S w, so it carries the rounding of R
            rounding = _tolerances(p).energy * (abs(R * w_guess * h) + stored + energy)
            work = T * w_guess * h
            assert work - (stored - energy) >= -rounding, (
                f"the stored energy must grow by the work of {work:g} J at most, found {stored - energy:g} J"
            )
            assert stored >= 0.0, f"the stored energy must not be negative, found {stored:g} J"
            energy = stored

    holds()


def check_odd_symmetry(p: Any) -> None:
    """The mirrored history gives the mirrored memory and torque, to the bit: no branch may prefer a side.

    An odd entry of the memory changes its sign and an even one does not.
    """

    @examples
    @given(moves, steps, torque_scales)
    def holds(history, driven, torque_scale):
        memory = memory_after(p, history, torque_scale)
        image = memory_after(p, [(-w, h) for w, h in history], torque_scale)
        _require_entries(p, image, mirror(p, memory), "memory")
        stored = law.stored_energy(p, memory), law.stored_energy(p, image)
        assert stored[0] == stored[1], f"the stored energy must be {stored[0]:.17g} J, found {stored[1]:.17g} J"
        w_guess = 0.0
        for S, R, h in driven:
            S += _fall(p, torque_scale, h)
            w, T = law.step(p, torque_scale, memory, S, R, h, w_guess)
            found = law.step(p, torque_scale, image, S, -R, h, -w_guess)
            assert found == (-w, -T), f"speed and torque of a step must be {(-w, -T)}, found {found}"
            _require_entries(p, image, mirror(p, memory), "memory")
            expected, found = -law.torque(p, torque_scale, memory, w), law.torque(p, torque_scale, image, -w)
            assert found == expected, f"the torque must be {expected:.17g} N m, found {found:.17g} N m"
            expected = mirror(p, rate(p, torque_scale, memory, w))
            _require_entries(p, rate(p, torque_scale, image, -w), expected, "rate of memory")
            w_guess = _limit_for_even(p, w, 1.0 / h)

    holds()


def check_rest(p: Any) -> None:
    """Without a push nothing moves, exactly; a load that the memory balances is held without creep, or only relaxes.

    Even entries of the memory, as an age, may change at rest.
    """
    relaxes = law.law_of(p).relaxes

    @examples
    @given(moves, log(-6, 6), log(-6, -2), speeds, torque_scales)
    def holds(history, S, h, w_guess, torque_scale):
        memory = at_rest(p)
        found = law.step(p, torque_scale, memory, S, 0.0, h, w_guess)
        assert found == (0.0, 0.0), f"speed and torque of a step without a push must be zero, found {found}"
        found = law.torque(p, torque_scale, memory, 0.0), law.stored_energy(p, memory)
        assert found == (0.0, 0.0), f"torque and stored energy at rest must be zero, found {found}"
        _require_entries(p, memory, np.where(odd(p, memory), 0.0, memory), "memory")

        memory = memory_after(p, history, torque_scale)
        load = law.torque(p, torque_scale, memory, 0.0)
        held = memory.copy()
        if relaxes:
            law.advance(p, torque_scale, held, 0.0, h)
            stored, left = law.stored_energy(p, memory), law.stored_energy(p, held)
            assert left <= stored, f"the stored energy must not grow at rest, found {left:g} J after {stored:g} J"
            return
        slope = rate(p, torque_scale, memory, 0.0)
        expected = np.where(odd(p, memory), 0.0, slope)
        _require_entries(p, slope, expected, "rate at rest, where the law does not relax, of memory")
        found = law.step(p, torque_scale, held, S, load, h, w_guess)
        assert found == (0.0, load), f"speed and torque of a step under the load must be {(0.0, load)}, found {found}"
        _require_entries(p, held, np.where(odd(p, memory), memory, held), "memory after a held step")
        found = law.torque(p, torque_scale, held, 0.0)
        assert found == load, (
            f"the torque of a held step must stay at {load:.17g} N m unless the law relaxes, found {found:.17g}"
        )

    holds()


def _mean(p: Any, torque_scale: float, memory: Array, w: float, h: float) -> float:
    """Mean torque over a step, by the law's own kernel or else by quadrature [N m]."""
    if law.law_of(p).mean_torque is None:
        return mean_by_quadrature(p, torque_scale, memory, w, h)
    return law.mean_torque(p, torque_scale, memory, w, h)[0]


def check_step_equation(p: Any) -> None:
    """``S w + mean torque = R`` is solved for any inertia, load, step, fall of the torque scale and guess of w."""
    exact = law.law_of(p).mean_torque is not None

    @settings(examples, max_examples=150 if exact else 50)
    @given(
        moves, torque_scales, log(-4, 6), both_signs(log(-9, 9)), log(-6, -2), both_signs(log(-12, 6)), torque_scales
    )
    def holds(history, before, S, R, h, w_guess, torque_scale):
        memory = memory_after(p, history, before)
        S += _fall(p, torque_scale, h)
        R, w_guess = _limit_for_even(p, R, FASTEST * S), _limit_for_even(p, w_guess, FASTEST)
        w = law.solve(p, torque_scale, memory.copy(), S, R, h, w_guess)
        if w == 0.0:  # a set-valued law may stick anywhere between its limits from both sides
            assert law.torque(p, torque_scale, memory, -1e-300) <= R <= law.torque(p, torque_scale, memory, 1e-300)
            return
        mean = _mean(p, torque_scale, memory, w, h)
        # solvers go down to rounding, a hundred of them in the largest term; quadrature is good to 1e-9 of the torque
        scale = abs(S * w) + abs(R) + abs(mean) + size(p, torque_scale)
        left = S * w + mean - R
        assert abs(left) <= (_tolerances(p).solved if exact else 1e-8) * scale, (
            f"the step equation must hold, found {left:g} N m at w = {w:.17g}{_uncut(p, before, torque_scale)}"
        )

    holds()


def check_steepest_fall(p: Any) -> None:
    """The mean torque falls with the speed nowhere more steeply than ``steepest_fall`` says, at any scale and step.

    A step equation with more inertia than that has one solution, from whatever guess.
    """

    @settings(examples, max_examples=200 if law.law_of(p).mean_torque else 20)
    @given(moves, torque_scales, log(-4, 1.5), log(-4, -0.3), log(-6, 0), torque_scales)
    def holds(history, before, w, rise, h, torque_scale):
        memory = memory_after(p, history, before)
        faster = w * (1.0 + rise)
        low, high = (_mean(p, torque_scale, memory, each, h) for each in (w, faster))
        fall = _fall(p, torque_scale, h)
        # the grid or the series of a bound may be off by a thousandth; quadrature is good to 1e-9 of the torque
        rounding = 1e-8 * (abs(low) + abs(high) + size(p, torque_scale))
        seen = (low - high) / (faster - w) / max(fall, 1e-9)
        target(seen if math.isfinite(seen) else 0.0)  # a fall is seen in few of the sets that are drawn
        assert high - low >= -1.001 * fall * (faster - w) - rounding, (
            f"the mean torque must fall by {fall:g} N m s/rad at most, found {(low - high) / (faster - w):g} between "
            f"{w:g} and {faster:g} rad/s{_uncut(p, before, torque_scale)}"
        )
        S = 1.01 * fall + 1e-3
        R = S * w + low
        guesses = 0.0, 1e-3 * w, _limit_for_even(p, 1e3 * w, FASTEST), -w
        found = [law.solve(p, torque_scale, memory.copy(), S, R, h, guess) for guess in guesses]
        assert_allclose(found, found[0], rtol=1e-7, atol=rounding / S)

    holds()


def _uncut(p: Any, before: float, torque_scale: float) -> str:
    """Which float of the memory a fall of the torque scale leaves beyond that of a slide, and what cuts it back."""
    slide = [(1.0, 100.0)]
    left = memory_after(p, [(1.0, 1e-12)], torque_scale, memory_after(p, slide, before))
    slid = memory_after(p, slide, torque_scale)
    beyond = np.flatnonzero(odd(p, left) & (abs(left) > 1.000001 * abs(slid)))
    if torque_scale >= before or not beyond.size:
        return ""
    i, equation = beyond[0], ode.EQUATIONS.get(type(p))
    cause = "the law has no cut_back" if equation and equation.own_cut is ode.no_cut else "it is not cut back enough"
    return (
        f"; where the torque scale falls from {before:g} to {torque_scale:g}, memory[{i}] must not stay beyond the "
        f"{slid[i]:g} of a slide, found {left[i]:g}: {cause}"
    )


def check_mean_torque(p: Any) -> None:
    """``mean_torque`` is the mean of ``torque`` along ``advance``, and its slope is its derivative."""
    if law.law_of(p).mean_torque is None:
        return
    set_valued = law.torque(p, 1.0, at_rest(p), 1e-300) > 0.0

    @settings(examples, max_examples=30)
    @given(moves, speeds, log(-5, -1), torque_scales)
    @example([(1.0, 1.0)], 0.0, 0.1, 10**0.03125)  # a slider that is at its limit but for rounding
    def holds(history, w, h, torque_scale):
        memory = memory_after(p, history, torque_scale)
        if law.law_of(p).continuous:
            rest = law.rest_torque(p, torque_scale, memory, h)
            assert all(law.mean_torque(p, torque_scale, memory, zero, h)[0] == rest for zero in (0.0, -0.0))
        mean, slope = law.mean_torque(p, torque_scale, memory, w, h)
        if w == 0.0 and set_valued:
            expected = law.torque(p, torque_scale, memory, math.copysign(1e-300, w))  # where motion begins
        else:
            expected = mean_by_quadrature(p, torque_scale, memory, w, h)
        rounding = 1e-8 * (abs(mean) + size(p, torque_scale))  # the quadrature is good to 1e-9
        assert abs(mean - expected) <= rounding, f"the mean torque must be {expected:.17g} N m, found {mean:.17g} N m"
        # Central difference: 1e-6 of w loses ten digits of the torque to rounding and w**2 F''' 1e-12 to curvature.
        # At w = 0, where |w| has its kink, and a slider at its limit has one, the difference is that of either side,
        # over a speed that changes the torque by at most 1e-6 of its size.
        near = 1e-6 / max(1e3, abs(slope) / (size(p, torque_scale) or 1.0))
        spans = ((0.0, near), (-near, 0.0)) if w == 0.0 else ((w * (1 - 1e-6), w * (1 + 1e-6)),)

        def difference(low, high):
            above = law.mean_torque(p, torque_scale, memory, high, h)[0]
            return (above - law.mean_torque(p, torque_scale, memory, low, h)[0]) / (high - low)

        rounding = _tolerances(p).slope * (abs(mean) + size(p, torque_scale)) / abs(spans[0][1] - spans[0][0])
        errors = [abs(difference(low, high) - slope) for low, high in spans]
        assert min(errors) <= 1e-5 * abs(slope) + rounding, (
            f"the slope must be {difference(*spans[0]):.17g} N m s/rad, found {slope:.17g}"
        )

    holds()


def check_semigroup(p: Any) -> None:
    """Two steps at one speed are one longer step, also just after the torque scale has changed."""

    @examples
    @given(moves, torque_scales, speeds, log(-5, -1), st.floats(0.0, 1.0), torque_scales)
    def holds(history, before, w, h, part, torque_scale):
        memory = memory_after(p, history, before)
        split = memory_after(p, [(w, part * h), (w, (1.0 - part) * h)], torque_scale, memory)
        scale = extent(p, max(before, torque_scale))  # a few roundings of the largest memory
        whole, good = memory_after(p, [(w, h)], torque_scale, memory), _tolerances(p).parts
        for i in np.flatnonzero(~(abs(split - whole) <= good * abs(whole) + 0.1 * good * scale)):
            raise AssertionError(
                f"memory[{i}] must be {whole[i]:.17g} as after one step, found {split[i]:.17g} after two"
            )

    holds()


def check_rate(p: Any) -> None:
    """``advance`` is the solution of ``rate``: what a plain ODE solver makes of the law."""

    @settings(examples, max_examples=30)
    @given(moves, both_signs(log(-3, 0)), log(-3, -1), torque_scales)
    def holds(history, w, h, torque_scale):
        memory = memory_after(p, history, torque_scale)
        scale = np.maximum(extent(p, torque_scale), 1e-12)
        if memory.size:
            solution = solve_ivp(
                lambda t, m: rate(p, torque_scale, m, w), (0.0, h), memory, rtol=1e-9, atol=1e-10 * scale
            )
            # the solver's tolerance, summed over its steps and over its passing of kinks
            found, continuous = memory_after(p, [(w, h)], torque_scale, memory), memory.size - law.law_of(p).modes(p)
            expected = solution.y[:, -1]
            allowed = 1e-6 * scale + 1e-7 * abs(expected)
            for i in np.flatnonzero(~(abs(found - expected) <= allowed)[:continuous]):
                raise AssertionError(f"memory[{i}] must be {expected[i]:g} by its rate, found {found[i]:g} by advance")

    holds()


def check_torque_scale(p: Any) -> None:
    """At equal speeds and times stretched by the torque scale, the torque is affine in that scale.

    Displacements then stretch with the scale too, which leaves the part in proportion to it (dry friction) and the
    part without it (damping). Ages and temperatures have times of their own, which do not stretch: a law with even
    entries need only have a larger torque at a larger scale.
    """

    @examples
    @given(moves, speeds, log(-1, 0.3))
    def holds(history, w, torque_scale):
        torques = []
        for stretch in (torque_scale, 2.0 * torque_scale, 3.0 * torque_scale):
            memory = memory_after(p, [(speed, stretch * h) for speed, h in history], stretch)
            torques.append(law.torque(p, stretch, memory, w))
        largest = max(map(abs, torques)) + size(p)
        assert abs(torques[0] - 2.0 * torques[1] + torques[2]) <= _tolerances(p).scaled * largest

    if "even" not in law.law_of(p).parity(p):
        holds()
    assert size(p, 2.0) >= size(p, 1.0) >= 0.0


def check_convergence(p: Any) -> None:
    """The step frame is of second order: errors fall 64-fold from 1 ms to 0.125 ms."""
    I, K, frequency = 0.05, 8.0, 0.7  # a column on the tyres' spring [kg m2, N m/rad, Hz]

    def positions(load: float, h: float) -> Array:
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
    # Summed over the loads; the swings reach 0.2 to 0.5 rad.
    assert errors[0] < 2e-4, f"the error at 1 ms must be below 2e-4 rad, found {errors[0]:g} rad"
    # Kinks of a law scatter the error; stiff ones are not resolved at 1 ms: order 4/3 at least.
    assert errors[0] > 16.0 * errors[1], f"an eighth of the step leaves {errors[1] / errors[0]:.2g} of the error"


CHECKS = (
    check_passivity,
    check_odd_symmetry,
    check_rest,
    check_step_equation,
    check_steepest_fall,
    check_mean_torque,
    check_semigroup,
    check_rate,
    check_torque_scale,
    check_convergence,
)


def check_friction_law(friction: Any) -> None:
    """Every check of a parameter set, among them that plain Python equals compiled code.

    Parameters
    ----------
    friction : str, mapping or parameters
        A form of ``friction.resolve``: the name of a law for its defaults, or a parameter set.

    Raises
    ------
    AssertionError
        Naming the first contract that the law does not keep; the history that shows it is printed.
    ValueError
        The law is unknown, or its class stands in the script that runs.
    """
    p = resolve(friction)
    for check in CHECKS:
        try:
            check(p)
        except AssertionError as error:
            contract = (check.__doc__ or "").partition("\n")[0]
            raise AssertionError(f"{p} fails {check.__name__}: {contract} {error}") from error
    check_plain_python([p])
