"""Straight running in balance: Newton's method on states whose rates vanish there.

Left and right are one unknown each time, whose rate is the mean of both: a mirrored car on a mirrored road begins
mirrored, to the bit, and one whose sides are alike is exactly symmetric.
"""

from typing import NamedTuple

from steer_env.friction.numerics import scratch
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.chassis.common.interface import INPUTS, separate_derivative

MOST_UNKNOWNS = 16  # unknowns
_MATRIX, _INPUTS = MOST_UNKNOWNS * MOST_UNKNOWNS, len(INPUTS)
ITERATIONS = 20  # a car that can hold its speed needs three to five
CLOSE = 1e-6  # change of every unknown, over its step, at which it is found [1]


class Unknowns(NamedTuple):
    """Unknown states, and the states whose rates vanish, each with the one on the other side and the sign there."""

    at: tuple[int, ...]
    mirrored: tuple[int, ...]
    signs: tuple[float, ...]  # [1]
    rates: tuple[int, ...]
    mirrored_rates: tuple[int, ...]
    steps: tuple[float, ...]  # of the differences that make the derivatives


@kernel
def _move(at, mirrored, signs, x, j, change):
    x[at[j]] += change
    if mirrored[j] != at[j]:
        x[mirrored[j]] = signs[j] * x[at[j]]


@kernel
def _rate(unknowns, dx, i):
    return 0.5 * (dx[unknowns.rates[i]] + unknowns.signs[i] * dx[unknowns.mirrored_rates[i]])


@kernel
def solve(J, r, n):
    """Solve J d = r (n,), J by rows of MOST_UNKNOWNS, by partial pivoting; d in place of r. False for a singular J."""
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(J[MOST_UNKNOWNS * i + k]) > abs(J[MOST_UNKNOWNS * pivot + k]):
                pivot = i
        if J[MOST_UNKNOWNS * pivot + k] == 0.0:
            return False
        if pivot != k:
            for j in range(k, n):
                J[MOST_UNKNOWNS * k + j], J[MOST_UNKNOWNS * pivot + j] = (
                    J[MOST_UNKNOWNS * pivot + j],
                    J[MOST_UNKNOWNS * k + j],
                )
            r[k], r[pivot] = r[pivot], r[k]
        for i in range(k + 1, n):
            factor = J[MOST_UNKNOWNS * i + k] / J[MOST_UNKNOWNS * k + k]
            for j in range(k, n):
                J[MOST_UNKNOWNS * i + j] -= factor * J[MOST_UNKNOWNS * k + j]
            r[i] -= factor * r[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            r[k] -= J[MOST_UNKNOWNS * k + j] * r[j]
        r[k] /= J[MOST_UNKNOWNS * k + k]
    return True


@kernel
def balance(p, strut, tyre, x, unknowns, n, dx, out):
    """Bring the first ``n`` unknowns of ``x`` to balance; whether it was found. ``dx`` and ``out`` are overwritten."""
    J, r, u = scratch.floats(_MATRIX), scratch.floats(MOST_UNKNOWNS), scratch.floats(_INPUTS)
    for i in range(_INPUTS):
        u[i] = 0.0
    for _ in range(ITERATIONS):
        for k in range(n + 1):  # at x, then beside it
            j = max(k - 1, 0)
            h, kept, other = unknowns.steps[j], x[unknowns.at[j]], x[unknowns.mirrored[j]]
            if k > 0:
                _move(unknowns.at, unknowns.mirrored, unknowns.signs, x, j, h)
            separate_derivative(p, strut, tyre, x, 0.0, 0.0, u, dx, out)
            x[unknowns.mirrored[j]], x[unknowns.at[j]] = other, kept
            for i in range(n):
                if k > 0:
                    J[MOST_UNKNOWNS * i + j] = (_rate(unknowns, dx, i) + r[i]) / h
                else:
                    r[i] = -_rate(unknowns, dx, i)
        if not solve(J, r, n):
            return False
        far = False
        for j in range(n):
            _move(unknowns.at, unknowns.mirrored, unknowns.signs, x, j, r[j])
            far |= not abs(r[j]) <= CLOSE * unknowns.steps[j]
        if not far:
            return True
    return False
