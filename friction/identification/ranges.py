"""Intervals that do without the linear theory: block bootstrap and profile of the loss (F37)."""

import math

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.determined import Estimate, linear
from steer_env.friction.identification.intervals import samples_per_count
from steer_env.friction.identification.problem import Problem, descended

DRAWS = 400  # resamplings
BLOCKS = 40  # of the weighed samples
SIZE = 1.96  # deviations of the normal distribution: 95 %


def bootstrapped(estimate: Estimate, seed: int) -> dict[str, tuple[float, float]]:
    """95 % intervals from blocks of samples drawn with replacement, one step of the search for each draw (F37).

    Blocks keep what neighbouring residuals share, also what a wrong law leaves: the intervals are then those of the law
    that fits best. Source: Künsch, Annals of Statistics 17 (1989) 1217-1241; one step: Davison, Hinkley, Bootstrap
    Methods, 1997, 2.7.
    """
    optimum, space = estimate.optimum, estimate.space
    J, e = optimum.jacobian, optimum.weakened
    blocks = np.array_split(np.arange(e.size), min(BLOCKS, e.size))
    H = np.array([J[b].T @ J[b] for b in blocks])
    g = np.array([J[b].T @ e[b] for b in blocks])
    counts = np.random.default_rng(seed).multinomial(len(blocks), np.full(len(blocks), 1.0 / len(blocks)), DRAWS)
    rows = []
    for drawn in counts:
        total = np.tensordot(drawn, H, 1)
        step = np.linalg.solve(total + 1e-12 * np.trace(total) * np.eye(len(total)), drawn @ g)  # (F37)
        rows.append(space.values((optimum.q - step)[: len(space.sought)]))
    result = linear(estimate)
    for s in space.sought:
        low, high = np.quantile([row[s.name] for row in rows], (0.025, 0.975))
        result[s.name] = (max(float(low), 0.0) if s.bounded else float(low), float(high))
    return result


def profiled(problem: Problem, estimate: Estimate) -> dict[str, tuple[float, float]]:
    """95 % intervals at whose ends the loss, with all else fitted anew, has grown by what the noise explains (F37).

    Source: Bates, Watts, Nonlinear Regression Analysis, 1988, 6.1. An end farther than ten linear half-widths counts as
    open.
    """
    optimum, space = estimate.optimum, estimate.space
    variance = float(np.mean(optimum.weakened**2)) * samples_per_count(optimum.residual)
    allowed = 0.5 * SIZE**2 * variance  # (F37)
    result = linear(estimate)
    n = len(space.sought)
    for i, s in enumerate(space.sought):
        high = result[s.name][1]
        value = float(getattr(estimate.parameters, s.name))
        step = math.log(high / value) if s.logarithmic else (high - value) / (1.0 if s.base is None else value)
        ends = []
        for side in (-1.0, 1.0):

            def excess(way: float, side: float = side, i: int = i, step: float = step) -> float:
                coordinate = optimum.q[i] + side * way * step
                smaller = space.without(space.sought[i].name, optimum.q[:n], coordinate)
                start = np.append(smaller.inside, optimum.q[n:])
                return descended(problem, smaller, start, optimum.loss_scale).cost - optimum.cost - allowed

            ends.append(optimum.q[i] + side * step * _crossing(excess))
        bounds = [space.values(_put(optimum.q[:n], i, end))[s.name] for end in np.clip(ends, s.lowest, s.highest)]
        result[s.name] = (float(bounds[0]), float(bounds[1]))
    return result


def _crossing(excess: object) -> float:
    """Where an excess turns positive, in linear half-widths; infinite beyond ten of them."""
    from scipy.optimize import brentq

    def at(way: float) -> float:
        try:
            return excess(way)  # type: ignore[operator]
        except ValueError:  # the law does not allow it: its bound is the end
            return 1.0

    for way in (1.5, 4.0, 10.0):
        if at(way) > 0.0:
            return float(brentq(at, 0.0, way, xtol=0.02))
    return math.inf


def _put(q: NDArray, i: int, value: float) -> NDArray[np.float64]:
    result = q.copy()
    result[i] = value
    return result
