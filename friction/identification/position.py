"""The order and the size of a level over the position, sought beside the parameters of a law (F42).

    L = 1 + p cos(n u) + q sin(n u),   b = sqrt(p^2 + q^2),   x_b = x_m + atan2(q, p)/n,   u = x - x_m    (F42)

with the middle x_m of the travel D. The profile over the order n is linear in p and q, about the law that was found
before at its mean level: it costs no search, and shows every order that describes the record as well. Where even a
period of eight travels does, within which the level is a parabola over the travel, the record tells the level along its
travel and no order. The largest order that is as good then stands for it, because its level differs least from one
elsewhere.

An asymmetry a is not sought: in sliding it is a zero T_0 = a F_c of the torque sensor, with Masing before sliding too.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.determined import (
    FLOOR,
    HARDLY,
    SHARE,
    SIZE,
    SMALL,
    Estimate,
    half_widths,
    samples_per_count,
)
from steer_env.friction.identification.problem import Problem
from steer_env.friction.law import Law
from steer_env.friction.level import MOST

FITTED = "fitted"  # in place of an order that is known
LONGEST = 8.0  # period over the travel: within an eighth of it the level is a parabola [1]
SHORTEST = 4.0  # period over the displacement in which the torque follows a reversal, at least; assumed [1]
MOST_PERIODS = 20.0  # in the travel; assumed [1]
STEP = 0.5 * math.pi  # phase over the travel, from one order of the profile to the next [rad]
FINE = 0.2  # of that, up to one and a half periods in the travel [1]
SURE = 9.2  # fall of the sum of squares, in deviations squared: quantile of 99 % of chi square, two degrees
LINEAR = 2.0  # of that, from one order to another, as the profile is linear; assumed [1]
APART = 1.4  # ends of the interval of an order that is determined, over each other; assumed [1]
STEPS = 8  # corrections by the columns at most
ENOUGH, NEAR = 1e-4, 0.05  # correction of p and q that ends them [1], and of the interval of b [1]
SHARES = (1.0, 0.4, 0.1)  # of a correction that are tried, until one leaves less
DIFFERENCE = 1e-4  # of the level, for derivatives [1]


class Position(NamedTuple):
    """What a record tells of the level over the position, in its scales."""

    b: float = 0.0  # relative increase at the peak [1]
    order: float = 1.0  # n: periods in 2 pi of the displacement [1]
    peak: float = 0.0  # x_b, the one next to the middle of the travel [1]
    intervals: tuple[tuple[float, float], ...] = ()  # 95 %, of NAMES; none of what is not determined [1]
    sought: int = 0  # of NAMES, beside the parameters of the law
    undetermined: tuple[str, ...] = ()  # of NAMES
    along: tuple[float, ...] = ()  # excess over L = 1 at the low end, the middle and the high end of the travel [1]
    most: float = math.nan  # b that the record would still hide, where none is shown [1]


NAMES = ("position", "peak", "order")  # as in steer_env.friction.level.Level


class _Wave(NamedTuple):
    """A level over the position."""

    p: float  # [1]
    q: float  # [1]
    n: float  # [1]

    def levels(self, u: NDArray) -> NDArray[np.float64]:
        """Factor (T,) on the saturated friction [1]."""
        return 1.0 + self.p * np.cos(self.n * u) + self.q * np.sin(self.n * u)  # (F42)

    def moved(self, change: NDArray) -> "_Wave":
        """The level after a change of its first numbers; b stays within ``MOST``, as no level may be negative."""
        p, q, n = (np.array(self) + np.pad(change, (0, 3 - change.size))).tolist()
        share = MOST / max(math.hypot(p, q), MOST)
        return _Wave(share * p, share * q, n)


def with_position(
    problem: Problem, law: Law, order: float | None, estimated: Callable[[Problem], tuple[Problem, Estimate]]
) -> tuple[Problem, Position]:
    """The problem at the level over the position that describes it best, and what the record tells of it.

    Parameters
    ----------
    problem : Problem
        With the same level everywhere.
    law : Law
    order : float or None
        Of the level, in the record's scales; None where it is sought [1].
    estimated : callable
        The search for the parameters at one level; with the columns of what is sought beside them.
    """
    ends = _ends(problem)
    u = problem.x - 0.5 * (ends[0] + ends[1])
    orders = _orders(ends[1] - ends[0]) if order is None else np.array([order])

    def at(wave: _Wave) -> Problem:
        return problem._replace(levels=wave.levels(u))

    part, estimate = estimated(problem)
    squares, waves = _profile(part, law, estimate, u, orders)
    wave = waves[int(np.argmin(squares[:-1]))]
    sure = SURE + 2.0 * math.log(orders.size)
    least = squares[-1] - sure * _deviation(estimate) ** 2
    alone = float(np.sum(estimate.optimum.residual**2)) - squares[-1] + least
    if np.min(squares) >= least:
        one = np.array([2.0 * math.pi / (ends[1] - ends[0])]) if order is None else orders
        (wave,) = _profile(part, law, estimate, u, one)[1]
        _, half = _judged(part, law, wave, u, estimate, len(NAMES) - 1)
        return problem, Position(order=wave.n, most=math.hypot(wave.p, wave.q) + float(half[0]))
    sought = len(NAMES) if order is None else len(NAMES) - 1
    part, estimate, wave = _approached(at, law, wave, u, sought, estimated)
    left = float(np.sum(estimate.optimum.residual**2))
    if left >= alone:
        return problem, Position(order=wave.n)
    near = [wave]
    if order is None:
        orders = np.unique(np.append(orders, wave.n))
        squares, waves = _profile(part, law, estimate, u, orders)
        more = (squares[:-1] - squares[:-1][orders == wave.n]) / _deviation(estimate) ** 2
        near += [each for each, m in zip(waves, more) if m <= SIZE**2]
        alike = more <= LINEAR * sure
        if alike[0]:  # the first orders are no waves over the travel
            sought = len(NAMES) - 1
            (start,) = _profile(part, law, estimate, u, orders[[np.argmin(alike) - 1]])[1]
            longer = _approached(at, law, start, u, sought, estimated)
            if np.sum(longer[1].optimum.residual ** 2) <= (1.0 + HARDLY) ** 2 * left:
                part, estimate, wave = longer
    return at(wave), _found(part, law, wave, u, estimate, sought, near, order is None)


def joint(problem: Problem, law: Law, found: Position, estimate: Estimate) -> tuple[Problem, Estimate]:
    """Problem and estimate with columns for the level, after the others, so that all intervals allow for it."""
    ends, end = _ends(problem), estimate.optimum
    middle = 0.5 * (ends[0] + ends[1])
    phase = found.order * (found.peak - middle)
    wave = _Wave(found.b * math.cos(phase), found.b * math.sin(phase), found.order)
    columns = _beside(problem, law, wave, problem.x - middle, estimate, found.sought)
    jacobian = np.column_stack([end.jacobian, end.weight[:, None] * columns[problem.weighed]])
    end = end._replace(q=np.append(end.q, np.zeros(columns.shape[1])), jacobian=jacobian)
    return problem._replace(columns=np.column_stack([problem.columns, columns])), estimate._replace(optimum=end)


def _ends(problem: Problem) -> tuple[float, float]:
    x = problem.x[problem.weighed]
    return float(x.min()), float(x.max())


def _orders(travel: float) -> NDArray[np.float64]:
    """Orders of the profile, from a period of ``LONGEST`` travels on."""
    lowest = 2.0 * math.pi / (LONGEST * travel)
    highest = 2.0 * math.pi * min(MOST_PERIODS / travel, 1.0 / SHORTEST)
    fine = np.arange(lowest, 3.0 * math.pi / travel, FINE * STEP / travel)  # where neighbours differ least
    return np.append(fine, np.arange(fine[-1] + STEP / travel, highest, STEP / travel))


def _deviation(estimate: Estimate) -> float:
    """Standard deviation that the residuals count with, where they depend on each other [1]."""
    e = estimate.optimum.residual
    return math.sqrt((float(np.mean(e**2)) + FLOOR**2) * samples_per_count(e))


def _columns(problem: Problem, law: Law, estimate: Estimate, changes: NDArray, step: float) -> NDArray[np.float64]:
    """Derivatives (T, k) of the torque by numbers of which ``step`` gives the ``changes`` (T, k) of the level."""
    here = problem.response(law, estimate.parameters)
    there = [problem._replace(levels=problem.levels + each).response(law, estimate.parameters) for each in changes.T]
    return (np.column_stack(there) - here[:, None]) / step


def _beside(
    problem: Problem, law: Law, wave: _Wave, u: NDArray, estimate: Estimate, number: int
) -> NDArray[np.float64]:
    """Derivatives (T, number) of the torque by the first of p, q and n, the level of the problem."""
    steps = np.array([1.0, 1.0, wave.n])[:number]
    near = [wave._replace(**{name: value + DIFFERENCE * step}) for name, value, step in zip(wave._fields, wave, steps)]
    changes = np.column_stack([each.levels(u) for each in near]) - wave.levels(u)[:, None]
    return _columns(problem, law, estimate, changes, DIFFERENCE) / steps


def _profile(
    problem: Problem, law: Law, estimate: Estimate, u: NDArray, orders: NDArray
) -> tuple[NDArray[np.float64], list[_Wave]]:
    """Sums of squares that a level of each order leaves and that a constant one leaves (N + 1,), and the levels (F42).

    They are linear about the law at the mean level of the travel, and all parameters of the law are moved along: it is
    the level beside its mean that counts.
    """
    mean, end = float(np.mean(problem.levels[problem.weighed])), estimate.optimum
    flat = problem._replace(levels=np.full(u.size, mean))
    torque = flat.response(law, estimate.parameters) + flat.columns @ estimate.factors - flat.torque
    U, size, _ = np.linalg.svd(end.jacobian, full_matrices=False)
    U = U[:, size > 1e-9 * size[0]]
    e = end.weight * torque[problem.weighed]
    e -= U @ (U.T @ e)
    squares, waves = [], []
    for n in orders.tolist():
        shapes = np.column_stack([np.cos(n * u), np.sin(n * u)])  # (F42)
        middle = np.mean(shapes[problem.weighed], axis=0)
        A = _columns(flat, law, estimate, DIFFERENCE * (shapes - middle), DIFFERENCE)[problem.weighed]
        A *= end.weight[:, None]
        A -= U @ (U.T @ A)
        change = np.linalg.lstsq(A, -e, rcond=None)[0]
        squares.append(float(np.sum((e + A @ change) ** 2)))
        beside = change / mean
        base = max(1.0 - float(middle @ beside), 1.0 - MOST)
        waves.append(_Wave(float(beside[0]) / base, float(beside[1]) / base, n).moved(np.zeros(2)))
    return np.append(squares, e @ e), waves


def _approached(
    at: Callable[[_Wave], Problem],
    law: Law,
    wave: _Wave,
    u: NDArray,
    sought: int,
    estimated: Callable[[Problem], tuple[Problem, Estimate]],
) -> tuple[Problem, Estimate, _Wave]:
    """Problem, law and level after corrections by the columns of all that is sought."""
    found = estimated(at(wave))
    for _ in range(STEPS):
        change, half = _judged(found[0], law, wave, u, found[1], sought)
        if np.max(np.abs(change[:2])) < max(ENOUGH, NEAR * half[0]):
            break
        for share in SHARES:
            further = wave.moved(share * change)
            there = estimated(at(further))
            if np.sum(np.abs(there[1].optimum.residual)) < np.sum(np.abs(found[1].optimum.residual)):
                wave, found = further, there
                break
        else:
            break
    return *found, wave


def _judged(
    problem: Problem, law: Law, wave: _Wave, u: NDArray, estimate: Estimate, sought: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The change of p, q and n that a linear step suggests, and half the widths of the intervals of b, x_b and n."""
    end, A = estimate.optimum, _beside(problem, law, wave, u, estimate, sought)
    J, e = np.column_stack([end.jacobian, end.weight[:, None] * A[problem.weighed]]), end.weakened
    change = np.linalg.lstsq(J, -e, rcond=None)[0]
    b, n = math.hypot(wave.p, wave.q) or 1.0, wave.n
    rows = np.zeros((sought, J.shape[1]))
    rows[0, -sought : J.shape[1] - sought + 2] = wave.p / b, wave.q / b
    rows[1, -sought : J.shape[1] - sought + 2] = -wave.q / (b**2 * n), wave.p / (b**2 * n)
    if sought == len(NAMES):
        rows[1, -1] = -math.atan2(wave.q, wave.p) / n**2
        rows[2, -1] = 1.0
    return np.asarray(change[-sought:]), half_widths(J, e + J @ change, rows, FLOOR)


def _found(
    problem: Problem,
    law: Law,
    wave: _Wave,
    u: NDArray,
    estimate: Estimate,
    sought: int,
    near: list[_Wave],
    free: bool,
) -> Position:
    """What the record tells of a level; ``near`` are those of other orders that are as good."""
    half = _judged(problem, law, wave, u, estimate, sought)[1]
    low, high = _ends(problem)
    middle = 0.5 * (low + high)
    values = np.array([(math.hypot(e.p, e.q), math.atan2(e.q, e.p) / e.n, e.n) for e in (wave, *near)])[:, :sought]
    least, most = np.minimum(values[0] - half, values.min(axis=0)), np.maximum(values[0] + half, values.max(axis=0))
    b = float(values[0, 0])
    wide = max(most[0] - b, b - least[0]) > max(SHARE * b, SMALL)
    unsure = wide or (free and (sought < len(NAMES) or most[2] > APART * least[2]))
    intervals = [(max(float(least[0]), 0.0), min(float(most[0]), MOST))]
    intervals += [(middle + float(least[1]), middle + float(most[1]))]
    intervals += [(float(least[2]), float(most[2]))] if sought == len(NAMES) else []
    return Position(
        b,
        wave.n,
        middle + math.atan2(wave.q, wave.p) / wave.n,
        () if unsure else tuple(intervals),
        sought,
        NAMES[: 2 + free] if unsure else (),
        tuple((wave.levels(np.array([low, middle, high]) - middle) - 1.0).tolist()),
    )


def told(found: Position) -> list[str]:
    """What a user has to know of it, in whole sentences."""
    if not found.b and math.isnan(found.most):
        return ["no level over the position describes the record better: it is taken as the same everywhere"]
    if not found.b:
        return [f"the record shows no influence of the position on the level (at most {found.most:.2g} of it)"]
    texts = []
    if found.b == MOST:
        texts.append(f"position = {MOST:g} ends at the largest value of the search: the level would be negative beyond")
    if found.undetermined:
        low, middle, high = (f"{1.0 + each:.3g}" for each in found.along)
        texts.append(
            f"the record does not determine {', '.join(found.undetermined)}: they stand for a level of {low} at the "
            f"low end, {middle} in the middle and {high} at the high end of its travel, and say nothing of other "
            "positions; record longer strokes, or give the order"
        )
    return texts
