"""Mean torque and memory of a law that is given by its ordinary differential equation alone, integrated numerically.

    dm/dt = rate(m, w),    mean T = (1/h) times the integral of torque(m, w) over the step

at the constant speed w over the step h, by the explicit Runge-Kutta pair of orders 5 and 4 of Dormand and Prince, with
the result of order 5. The difference of the two orders is kept, in every substep, below TOLERANCE of the larger of an
entry of the memory and of its change, and below TOLERANCE of the torque. Across a jump of the rate it shows an
eightieth of the error at least. The rate at the end of a substep is that at the start of the next. The derivative by
the speed is a difference quotient of two runs in the same substeps.
Nothing prefers a side, so the mirrored history gives the mirrored results to the bit, and a rate of zero leaves the
memory as it is.

Friction that slides at constant speed becomes steady. Where the rate of every entry of the memory, over its change with
that entry in a substep, is below TOLERANCE of the entry, no more than that is left to change. Where two substeps in a
row say so (one of them may be a jump of the rate), the remainder of the step is taken as steady: long steps cost no
more than the way there. After MOST_SUBSTEPS, which no law with a fading memory needs, memory and torque become NaN, and
the plant reports it.

The memory of such a law holds its ``memory_size`` floats, less their values at rest, and behind them the space that the
integration works in, which is zero between the steps: all of it is zero where a motion starts. The law's own functions
receive their own floats only, with the values at rest.

Source: Dormand, Prince, J. Computational and Applied Mathematics 6 (1980) 19-26.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from steer_env.friction.numerics.kernel import dispatch, kernel

TOLERANCE = 1e-10  # of the local error, relative [1]
MOST_SUBSTEPS = 100_000
STEP_OF_SPEED = 1e-6  # for the derivative, relative to the speed [1]
LEAST_STEP_OF_SPEED = 1e-9  # for the derivative at rest, assumed small beside every speed of the law [rad/s]
STAGES = 7
# Memory, its course and that at another speed, the ends of a substep of both, and the rates of the stages of both.
BLOCKS = 5 + 2 * STAGES

# Row i: weights of the rates of the stages before stage i; the last row is the result of order 5.
A = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
ORDER_5 = np.append(A[-1], 0.0)
# Order 5 less order 4.
DIFFERENCE = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


class Equation(NamedTuple):
    """The functions of a law as its file gives them; :func:`steer_env.friction.law.register` explains them."""

    memory_size: Callable[[Any], int]
    own_rate: Callable
    own_torque: Callable
    own_energy: Callable
    own_cut: Callable
    own_rest: Callable


EQUATIONS: dict[type, Equation] = {}  # by the class of the parameters


# Dispatch points, as those of steer_env.friction.law.


def own_rate(p, torque_scale, memory, w, out):
    """Write the time derivative of the law's own memory into ``out``."""
    EQUATIONS[type(p)].own_rate(p, torque_scale, memory, w, out)


def own_torque(p, torque_scale, memory, w):
    """Torque at this moment from the law's own memory [N m]."""
    return EQUATIONS[type(p)].own_torque(p, torque_scale, memory, w)


def own_energy(p, memory):
    """Energy that the law's own memory can give back [J]."""
    return EQUATIONS[type(p)].own_energy(p, memory)


def own_cut(p, torque_scale, memory):
    """Cut the law's own memory back to what break-away allows."""
    EQUATIONS[type(p)].own_cut(p, torque_scale, memory)


def own_rest(p, memory):
    """Write the values at rest that are not zero into the law's own memory."""
    EQUATIONS[type(p)].own_rest(p, memory)


for _point in (own_rate, own_torque, own_energy, own_cut, own_rest):
    dispatch(_point, lambda parameters, name: getattr(EQUATIONS.get(parameters), name, None))


@kernel
def no_cut(p, torque_scale, memory):
    """For a law that leaves its memory as it is when the torque scale falls."""


@kernel
def no_rest(p, memory):
    """For a law whose memory is zero at rest."""


def memory_size(p: Any) -> int:
    """Floats of memory of a law with an equation, with the space to work in."""
    return BLOCKS * EQUATIONS[type(p)].memory_size(p)


@kernel
def _copy_memory(p, memory, own):
    """Write the law's own memory, with the values at rest."""
    for j in range(own.size):
        own[j] = 0.0
    own_rest(p, own)
    for j in range(own.size):
        own[j] += memory[j]


@kernel
def _stage(p, torque_scale, i, start, end, rates, w, h):
    """Torque of a stage [N m]; its memory goes into ``end``, its rate into ``rates``, which hold that of the first."""
    n = start.size
    for j in range(n):
        change = 0.0
        for k in range(i):
            change += A[i, k] * rates[k * n + j]
        end[j] = start[j] + h * change
    if i > 0:
        _write_rate(p, torque_scale, end, w, rates[i * n : (i + 1) * n])
    return own_torque(p, torque_scale, end, w)


@kernel
def _largest_error(start, end, rates, error, size, h):
    """The largest error of a substep over its tolerance, NaN where something is not finite; whether it is steady.

    ``error`` and ``size`` are those of the torque [N m].
    """
    n = start.size
    worst = _larger(0.0, error, size)
    steady = True
    for j in range(n):
        size = max(abs(start[j]), abs(end[j]))
        bend = abs(rates[(STAGES - 1) * n + j] - rates[j])
        steady = steady and abs(rates[j] * (end[j] - start[j])) <= TOLERANCE * size * bend
        error = 0.0
        for i in range(STAGES):
            error += DIFFERENCE[i] * rates[i * n + j]
        worst = _larger(worst, h * error, size + h * abs(rates[j]))
    return worst, steady


@kernel
def _write_rate(p, torque_scale, memory, w, out):
    for j in range(out.size):
        out[j] = 0.0  # a law may leave out what is zero
    own_rate(p, torque_scale, memory, w, out)


@kernel
def _larger(worst, error, size):
    """The largest error over its tolerance, with one more error and the size that it is relative to."""
    if error == 0.0:
        return worst
    excess = abs(error) / (TOLERANCE * size)
    return worst if excess <= worst or math.isnan(worst) else excess


@kernel
def _course(p, torque_scale, memory, w, step_of_speed, h):
    """Integrate over ``h`` into the second block of the memory.

    Returns the integrals of the torque [N m s] at ``w`` and at ``w + step_of_speed``; the latter only where that is
    another speed.
    """
    n = memory.size // BLOCKS
    course, other, end, end_other = (
        memory[n : 2 * n],
        memory[2 * n : 3 * n],
        memory[3 * n : 4 * n],
        memory[4 * n : 5 * n],
    )
    rates, rates_other = memory[5 * n : (5 + STAGES) * n], memory[(5 + STAGES) * n :]
    _copy_memory(p, memory, course)
    own_cut(p, torque_scale, course)
    for j in range(n):
        other[j] = course[j]
    T = T_other = 0.0
    faster = w + step_of_speed
    _write_rate(p, torque_scale, course, w, rates[:n])
    if step_of_speed != 0.0:
        _write_rate(p, torque_scale, other, faster, rates_other[:n])
    left = dt = h
    before = False
    for _ in range(MOST_SUBSTEPS):
        mean = mean_other = error = error_other = size = size_other = 0.0
        for i in range(STAGES):  # of both courses in turns: a processor works on one while a power of the other is due
            at = _stage(p, torque_scale, i, course, end, rates, w, dt)
            mean += ORDER_5[i] * at
            error += DIFFERENCE[i] * at
            size = max(size, abs(at))
            if step_of_speed != 0.0:
                at = _stage(p, torque_scale, i, other, end_other, rates_other, faster, dt)
                mean_other += ORDER_5[i] * at
                error_other += DIFFERENCE[i] * at
                size_other = max(size_other, abs(at))
        excess, steady = _largest_error(course, end, rates, error, size, dt)
        if step_of_speed != 0.0:
            excess_other, too = _largest_error(other, end_other, rates_other, error_other, size_other, dt)
            excess = excess if excess_other <= excess else excess_other
            steady = steady and too
        if excess <= 1.0:
            T += dt * mean
            T_other += dt * mean_other
            for j in range(n):
                course[j] = end[j]
                other[j] = end_other[j]
                rates[j] = rates[(STAGES - 1) * n + j]
                rates_other[j] = rates_other[(STAGES - 1) * n + j]
            left -= dt  # exactly zero in the last substep
            if steady and before:
                T += left * own_torque(p, torque_scale, course, w)
                return T, T_other + left * own_torque(p, torque_scale, other, faster)
            if left == 0.0:
                return T, T_other
            before = steady
        if math.isnan(excess):  # a substep too long for numbers, or a memory that is not finite, which ends it
            finite = True
            for j in range(n):
                finite = finite and abs(course[j]) < math.inf
            if not (finite and abs(w) < math.inf):
                break
            dt *= 0.2
        else:
            dt *= min(5.0, max(0.2, 0.9 * excess**-0.2)) if excess > 0.0 else 5.0
        dt = min(dt, left)
    for j in range(n):
        course[j] = math.nan
    return math.nan, math.nan


@kernel
def _clear(memory):
    for j in range(memory.size // BLOCKS, memory.size):
        memory[j] = 0.0


@kernel
def mean_torque(p, torque_scale, memory, w, h):
    """Mean torque over ``h`` at constant ``w`` [N m], and its derivative by ``w`` [N m s/rad]."""
    step = math.copysign(STEP_OF_SPEED * abs(w) + LEAST_STEP_OF_SPEED, w)
    T, T_other = _course(p, torque_scale, memory, w, step, h)
    _clear(memory)
    return T / h, (T_other - T) / (step * h)


@kernel
def rest_torque(p, torque_scale, memory, h):
    """Mean torque over ``h`` at rest [N m], without another speed, which would prefer its side."""
    T, _ = _course(p, torque_scale, memory, 0.0, 0.0, h)
    _clear(memory)
    return T / h


@kernel
def advance(p, torque_scale, memory, w, h):
    """Advance the memory over ``h`` [s] at constant speed ``w`` [rad/s]."""
    _course(p, torque_scale, memory, w, 0.0, h)
    n = memory.size // BLOCKS
    own_cut(p, torque_scale, memory[n : 2 * n])  # of what it passes break-away by, within the tolerance
    for j in range(n):
        memory[j] = 0.0
    own_rest(p, memory[:n])
    for j in range(n):
        memory[j] = memory[n + j] - memory[j]
    _clear(memory)


@kernel
def torque(p, torque_scale, memory, w):
    """Torque at this moment [N m]."""
    n = memory.size // BLOCKS
    cut = memory[n : 2 * n]
    _copy_memory(p, memory, cut)
    own_cut(p, torque_scale, cut)
    T = own_torque(p, torque_scale, cut, w)
    _clear(memory)
    return T


@kernel
def rate(p, torque_scale, memory, w, out):
    """Write the time derivative of the memory at speed ``w`` [rad/s] into ``out``."""
    n = memory.size // BLOCKS
    own = memory[n : 2 * n]
    _copy_memory(p, memory, own)
    own_rate(p, torque_scale, own, w, out[:n])
    _clear(memory)


@kernel
def stored_energy(p, memory):
    """Energy that the memory can give back [J]."""
    n = memory.size // BLOCKS
    own = memory[n : 2 * n]
    _copy_memory(p, memory, own)
    energy = own_energy(p, own)
    _clear(memory)
    return energy
