"""The order and the size of a level over the position, sought beside the parameters of a law (F42).

    L = 1 + p cos(n u) + q sin(n u) = 1 + b cos(n (x - x_b)),   u = x - x_m                       (F42)

with the middle x_m of the travel D. The search moves b, x_b and n together with the parameters of the law, from where a
profile is least. The profile over the order n is linear in p and q, about the law that was found
before at its mean level: it costs no search, and shows every order that describes the record as well. Where even a
period of eight travels does, within which the level is a parabola over the travel, the record tells the level along its
travel and no order. The largest order that is as good then stands for it, because its level differs least from one
elsewhere.

An asymmetry a is not sought: in sliding it is a zero T_0 = a F_c of the torque sensor, with Masing before sliding too.
"""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.determined import (
    FLOOR,
    HARDLY,
    NORMAL_QUANTILE,
    Estimate,
    determined,
    half_widths_of_level,
    samples_per_count,
)
from steer_env.friction.identification.elements import stroke_ends
from steer_env.friction.identification.problem import Problem, searched
from steer_env.friction.identification.space import DETERMINED_SCALE_SHARE, DETERMINED_SHARE, EDGE, Sought
from steer_env.friction.law import Law
from steer_env.friction.level import LARGEST_INCREASE, Level

FITTED = "fitted"  # in place of an order that is known
SOUGHT_FIELDS = ("position", "peak", "order")  # of the fields of a level that are sought
LONGEST = 8.0  # period over the travel: within an eighth of it the level is a parabola [1]
SHORTEST = 4.0  # period over the displacement in which the torque follows a reversal, at least; assumed [1]
MOST_PERIODS = 20.0  # in the travel; assumed [1]
PROFILE_PHASE_STEP = 0.5 * math.pi  # phase over the travel, from one order of the profile to the next [rad]
FINE_STEP_SHARE = 0.2  # of that, up to one and a half periods in the travel [1]
LOSS_FALL = 9.2  # fall of the sum of squares, in deviations squared: quantile of 99 % of chi square, two degrees
LINEAR = 2.0  # of that, from one order to another, as the profile is linear; assumed [1]
ORDER_INTERVAL_RATIO = 1.4  # ends of the interval of an order that is determined, over each other; assumed [1]
DIFFERENCE = 1e-4  # of the level, for derivatives [1]

Interval = tuple[float, float]


class Position(NamedTuple):
    """What a record tells of the level over the position, beside the estimate, in its scales."""

    free: bool  # whether the order was sought
    half: Mapping[
        str, float
    ] = {}  # half the widths of the intervals of ``SOUGHT_FIELDS``, none where no level is shown [1]
    near: tuple[Level, ...] = ()  # of other orders that describe the record as well
    places: tuple[float, ...] = ()  # the low end, the middle and the high end of the travel [1]
    most: float = math.nan  # b that the record would still hide, where none is shown [1]


class _Wave(NamedTuple):
    """What the profile has at an order."""

    left: float  # sum of squares
    level: Level
    half: float  # half the width of the interval of b [1]


def with_position(
    problem: Problem,
    law: Law,
    order: float | None,
    estimate: Estimate,
    estimated: Callable[[tuple[Sought, ...], Level], Estimate],
) -> tuple[Estimate, Position]:
    """The law with the level over the position that describes the record best, and what the record tells of it.

    Parameters
    ----------
    problem : Problem
    law : Law
    order : float or None
        Of the level, in the record's scales; None where it is sought [1].
    estimate : Estimate
        The law with the same level everywhere.
    estimated : callable
        The whole search for the law and these fields of the level, with the others given.
    """
    free, ends = order is None, stroke_ends(problem)
    travel = float(np.ptp(ends))
    orders = _orders(travel) if order is None else np.array([order])
    flat, waves = _profile(problem, law, estimate, orders)
    best = min(waves, key=lambda wave: wave.left)
    sure = LOSS_FALL + 2.0 * math.log(orders.size)
    shows = sure * _deviation(estimate) ** 2
    if best.left >= flat - shows:
        (wave,) = _profile(problem, law, estimate, np.array([2.0 * math.pi / travel]))[1] if free else waves
        return estimate, Position(free, most=wave.level.position + wave.half)

    def again(level: Level, free: bool) -> Estimate:
        """The law with this level; sliders are those found at the same level everywhere."""
        if not estimate.space.sliders:
            return estimated(*_start(level, free))
        space = estimate.space._replace(inside=estimate.optimum.q[: estimate.space.size])
        space = space.beside(*_start(level, free))
        return determined(problem, space, searched(problem, space, 1, 0, False))

    found = again(best.level, free)
    left = _sum_of_squares(found)
    if left >= _sum_of_squares(estimate) - shows:
        return estimate, Position(free)
    near: list[Level] = []
    if free:
        orders = np.unique(np.append(orders, found.level.order))
        _, waves = _profile(problem, law, found, orders)
        squares = np.array([wave.left for wave in waves])
        more = (squares - squares[orders == found.level.order]) / _deviation(found) ** 2
        near = [wave.level for wave, m in zip(waves, more) if m <= NORMAL_QUANTILE**2]
        alike = more <= LINEAR * sure
        if alike[0]:  # the first orders are no waves over the travel
            longer = again(waves[np.argmin(alike) - 1].level, False)
            found = longer if _sum_of_squares(longer) <= (1.0 + HARDLY) ** 2 * left else found
    half = half_widths_of_level(found)
    if estimate.space.sliders:  # as many as there are at the level that was found
        found = estimated(*_start(found.level, "order" in half))
    return found, Position(free, half, tuple(near), (ends[0], ends.mean(), ends[1]))


def _start(level: Level, free: bool) -> tuple[tuple[Sought, ...], Level]:
    """The fields of a level that are sought, from where they are, and the level with the others.

    What the record determines of them is told by the profile too, and not by their intervals alone.
    """
    bounds = {"position": (0.0, LARGEST_INCREASE), "peak": (-math.inf, math.inf), "order": (0.0, math.inf)}
    names = SOUGHT_FIELDS if free else SOUGHT_FIELDS[:-1]
    return tuple(
        Sought(name, False, None, getattr(level, name), *bounds[name], math.nan, of_level=True, small=math.inf)
        for name in names
    ), level


def _sum_of_squares(estimate: Estimate) -> float:
    return float(np.sum(estimate.optimum.residual**2))


def _orders(travel: float) -> NDArray[np.float64]:
    """Orders of the profile, from a period of ``LONGEST`` travels on."""
    lowest = 2.0 * math.pi / (LONGEST * travel)
    highest = 2.0 * math.pi * min(MOST_PERIODS / travel, 1.0 / SHORTEST)
    fine = np.arange(
        lowest, 3.0 * math.pi / travel, FINE_STEP_SHARE * PROFILE_PHASE_STEP / travel
    )  # where neighbours differ least
    return np.append(fine, np.arange(fine[-1] + PROFILE_PHASE_STEP / travel, highest, PROFILE_PHASE_STEP / travel))


def _deviation(estimate: Estimate) -> float:
    """Standard deviation that the residuals count with, where they depend on each other [1]."""
    e = estimate.optimum.residual
    return math.sqrt((float(np.mean(e**2)) + FLOOR**2) * samples_per_count(e))


def _profile(problem: Problem, law: Law, estimate: Estimate, orders: NDArray) -> tuple[float, list[_Wave]]:
    """The sum of squares that a constant level leaves, and what a level of each order does (F42).

    They are linear about the law at the mean level of the travel, and all parameters of the law are moved along: it is
    the level beside its mean that counts.
    """
    weighed, end = problem.weighed, estimate.optimum
    mean, middle = float(np.mean(problem.at(estimate.level).levels[weighed])), float(stroke_ends(problem).mean())
    flat = problem._replace(levels=np.full(problem.x.size, mean))
    here, u = flat.response(law, estimate.parameters), problem.x - middle
    U, size, _ = np.linalg.svd(estimate.beside_level, full_matrices=False)
    U = U[:, size > 1e-9 * size[0]]

    def apart(torque: NDArray) -> NDArray[np.float64]:
        """What the parameters of the law cannot take up."""
        weighted = (end.weight * torque[weighed].T).T
        return np.asarray(weighted - U @ (U.T @ weighted))

    e, waves = apart(here + flat.columns @ estimate.factors - flat.torque), []
    for n in orders.tolist():
        shapes = np.column_stack([np.cos(n * u), np.sin(n * u)])  # (F42)
        means = np.mean(shapes[weighed], axis=0)
        moved = [flat._replace(levels=mean + DIFFERENCE * each) for each in (shapes - means).T]
        A = apart(np.column_stack([each.response(law, estimate.parameters) - here for each in moved]) / DIFFERENCE)
        change = np.linalg.lstsq(A, -e, rcond=None)[0]
        p, q = change / max(mean - float(means @ change), (1.0 - LARGEST_INCREASE) * mean)
        b = float(math.hypot(p, q))
        row = np.array([p, q]) / max(b, 1e-9) / mean
        half = NORMAL_QUANTILE * _deviation(estimate) * math.sqrt(row @ np.linalg.pinv(A.T @ A) @ row)
        level = Level(position=min(b, LARGEST_INCREASE), order=n, peak=middle + math.atan2(q, p) / n)
        waves.append(_Wave(float(np.sum((e + A @ change) ** 2)), level, half))
    return float(e @ e), waves


def judged(found: Position, level: Level) -> tuple[dict[str, Interval], tuple[str, ...]]:
    """Intervals of ``SOUGHT_FIELDS`` (F42), in the scales of the record, and which of them it does not determine.

    They hold the values of other orders that are as good. None is told where the order, or b, has a wide one.
    """
    result = {}
    for name, half in found.half.items():
        value, others = getattr(level, name), [getattr(each, name) for each in found.near]
        result[name] = min([value - half, *others]), max([value + half, *others])
    if not result:
        return {}, ()
    low, high = result["position"]
    result["position"] = max(low, 0.0), min(high, LARGEST_INCREASE)
    unsure = max(high - level.position, level.position - low) > max(
        DETERMINED_SHARE * level.position, DETERMINED_SCALE_SHARE
    )
    if found.free:
        unsure |= "order" not in result or result["order"][1] > ORDER_INTERVAL_RATIO * result["order"][0]
    return ({}, SOUGHT_FIELDS[: 2 + found.free]) if unsure else (result, ())


def describe_position(found: Position, level: Level, undetermined: tuple[str, ...]) -> list[str]:
    """What a user has to know of it, in whole sentences."""
    if not level.position and math.isnan(found.most):
        return ["no level over the position describes the record better: it is taken as the same everywhere"]
    if not level.position:
        return [f"the record shows no influence of the position on the level (at most {found.most:.2g} of it)"]
    texts = []
    if level.position > LARGEST_INCREASE - EDGE:
        texts.append(
            f"position = {LARGEST_INCREASE:g} ends at the largest value of the search: the level would be negative "
            "beyond"
        )
    if undetermined:
        along = 1.0 + level.position * np.cos(level.order * (np.array(found.places) - level.peak))  # (F42)
        low, middle, high = (f"{each:.3g}" for each in along)
        texts.append(
            f"the record does not determine {', '.join(undetermined)}: they stand for a level of {low} at the "
            f"low end, {middle} in the middle and {high} at the high end of its travel, and say nothing of other "
            "positions; record longer strokes, or give the order"
        )
    return texts
