"""The growth of the level with the load, sought beside the parameters of a law (F38)."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.determined import (
    FLOOR,
    SHARE,
    SMALL,
    WORSE,
    Estimate,
    half_widths,
    samples_per_count,
)
from steer_env.friction.identification.problem import Problem
from steer_env.friction.law import Law

HEAVIEST = 0.95  # share of the level that is in proportion to the load, at the mean load [1]
STEPS = 6  # corrections of the rate by its column at most
ENOUGH = 1e-4  # correction that ends them, of the level [1]
DIFFERENCE = 1e-4  # of the rate, for its derivative, of the level [1]


class Rate(NamedTuple):
    """What a record tells of the rate c_F, here times the mean load [1]."""

    value: float = 0.0
    half: float = math.nan  # half the width of its 95 % interval; NaN without a load
    joint: bool = False  # whether the intervals of the other parameters allow for it
    undetermined: bool = False
    falls: bool = False  # whether the level falls with the load, which no rate describes


def with_rate(
    problem: Problem, law: Law, load: NDArray, estimated: Callable[[Problem], Estimate]
) -> tuple[Problem, Rate]:
    """The problem at the rate that describes it best, and that rate.

    Parameters
    ----------
    problem : Problem
    law : Law
    load : (T,) array
        Load over its mean [1].
    estimated : callable
        The search for the parameters at one rate.
    """
    from scipy.optimize import minimize_scalar  # imported here, because that takes longer than the import of all laws

    def at(rate: float) -> Problem:
        return problem._replace(levels=1.0 + rate * load)  # (F38)

    def cost(share: float) -> float:
        return float(np.sum(np.abs(estimated(at(share / (1.0 - share))).optimum.residual)))

    share = float(minimize_scalar(cost, bounds=(0.0, HEAVIEST), method="bounded", options={"xatol": 0.01}).x)
    share = share if cost(share) < cost(0.0) else 0.0
    rate = share / (1.0 - share)
    estimate = estimated(at(rate))
    half, change = _judged(at(rate), law, load, rate, estimate)
    if _wide(rate, half) and rate + change > -2.0 * half and not _worse(estimated(at(0.0)), estimate):
        return at(0.0), Rate(half=half, undetermined=True)
    for _ in range(STEPS):
        rate = max(rate + change, 0.0)
        estimate = estimated(at(rate))
        half, change = _judged(at(rate), law, load, rate, estimate)
        if rate + change <= 0.0 and rate == 0.0:
            return at(0.0), Rate(half=half, falls=change < -2.0 * half)
        if abs(change) < ENOUGH * (1.0 + rate):
            break
    return at(rate), Rate(rate, half, joint=True, undetermined=_wide(rate, half))


def joint(problem: Problem, law: Law, load: NDArray, rate: Rate, estimate: Estimate) -> tuple[Problem, Estimate]:
    """Problem and estimate with a column for the rate, after the others, so that all intervals allow for it."""
    column, end = _column(problem, law, load, rate.value, estimate), estimate.optimum
    jacobian = np.column_stack([end.jacobian, end.weight * column[problem.weighed]])
    end = end._replace(q=np.append(end.q, 0.0), jacobian=jacobian)
    columns = np.column_stack([problem.columns, column])
    return problem._replace(columns=columns), estimate._replace(optimum=end)


def _wide(rate: float, half: float) -> bool:
    """Whether the interval is wider than that of what counts as determined (F34)."""
    return half > max(SHARE * rate, SMALL)


def _worse(without: Estimate, best: Estimate) -> bool:
    """Whether an estimate without influence of the load fits worse (F34)."""
    e = best.optimum.residual
    allowed = WORSE * (np.mean(e**2) + FLOOR**2) * samples_per_count(e)
    return bool(np.sum(without.optimum.residual**2) - np.sum(e**2) > allowed)


def _column(problem: Problem, law: Law, load: NDArray, rate: float, estimate: Estimate) -> NDArray[np.float64]:
    """Derivative of the torque by the rate."""
    step = DIFFERENCE * (1.0 + rate)
    ends = [problem._replace(levels=1.0 + (rate + d) * load).response(law, estimate.parameters) for d in (-step, step)]
    return (ends[1] - ends[0]) / (2.0 * step)


def _judged(problem: Problem, law: Law, load: NDArray, rate: float, estimate: Estimate) -> tuple[float, float]:
    """Half the width of the interval of the rate beside the parameters, and the change that a linear step suggests."""
    column, end = _column(problem, law, load, rate, estimate), estimate.optimum
    J, e = np.column_stack([end.jacobian, end.weight * column[problem.weighed]]), end.weakened
    change = np.linalg.lstsq(J, -e, rcond=None)[0]
    half = half_widths(J, e + J @ change, np.eye(J.shape[1])[-1:], FLOOR)
    return float(half[0]), float(change[-1])


def told(rate: Rate) -> list[str]:
    """What a user has to know of it, in whole sentences."""
    if rate.undetermined:
        kept = f"kept at {rate.value:.3g} of the level at the mean load" if rate.value else "taken as none"
        return [f"the record does not determine the influence of the load: {kept}; record loads that differ more"]
    if rate.falls:
        return [
            "the friction falls with the load, which the level does not describe (its rate stands at its bound 0): "
            "check the load's channel, or fit parts of equal load"
        ]
    if rate.value == 0.0 and not math.isnan(rate.half):
        most = f"at most {rate.half:.2g} of the level at the mean load"
        return [f"the record shows no growth of the friction with the load ({most})"]
    return []
