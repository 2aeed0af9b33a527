"""Which parameters a record determines: found from the fit, not declared (F34)."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.intervals import half_widths, samples_per_count
from steer_env.friction.identification.problem import Optimum, Problem, descended, refined, searched
from steer_env.friction.identification.space import Space

WIDEST = np.log(2.0)  # half the width of the interval of a logarithm that counts as determined [1]
SHARE = 0.5  # half the width of the interval of another parameter, of its value [1] ...
SMALL = 0.05  # ... or, where it is small, of its scale [1]
FLOOR = 1e-3  # deviation of the residuals at least, of the level [1]: what noise-free records are judged by
WORSE = 6.6  # growth of the sum of squares, in deviations squared: quantile of 99 % of chi square, one degree ...
HARDLY = 0.02  # ... and of the residual at most [1]: residuals that last for long allow much growth
EDGE = 1e-3  # coordinate that counts as zero, where it may not be negative [1]
STARTS = 3  # of the search without a break-away ...
BEYOND = 1.5  # ... of so many times the largest torque of the record, which does not show it then; assumed [1]


class Estimate(NamedTuple):
    """The end of the search, with what the record does not determine held at neutral values."""

    parameters: Any  # of the law, in the record's scales
    space: Space  # of what is left
    optimum: Optimum
    undetermined: list[str]
    edges: dict[str, float]  # half the widths of the intervals of coordinates that ended at zero [1]

    @property
    def factors(self) -> NDArray[np.float64]:
        """Of the problem's columns: offset [1]."""
        return self.optimum.q[len(self.space.sought) :]


def determined(problem: Problem, space: Space, optimum: Optimum) -> Estimate:
    """Hold one parameter after the other at its neutral value, as long as that leaves the fit as good (F34).

    As long as one has a wide interval, those go first that zero or the law itself makes neutral, and the last of the
    law's fields before the others. One without which the fit is worse keeps its estimate, and is told if it is wide.
    A break-away far beyond all torques of the record, wide or at the end of its range, goes even where the fit is
    worse: it trades with the sliding torque, and the level that the record shows would go with both.
    """
    undetermined: list[str] = []
    while True:
        space, optimum, excess, half = _spared(problem, space, optimum, undetermined)
        name = _beyond(problem, space, optimum, excess)
        if name is None:
            break
        undetermined.append(name)
        space = space.without(name, optimum.q[: len(space.sought)], 0.0)
        optimum = searched(problem, space, STARTS, 0, False)
    kept = [s.name for s in space.sought if excess[s.name] > 1.0]
    at_zero = {s.name: h for s, q, h in zip(space.sought, optimum.q, half) if s.spare and s.bounded and q < EDGE}
    for name in [*kept, *(name for name in at_zero if name not in kept)]:  # where the search would only chatter
        i = [s.name for s in space.sought].index(name)
        q = optimum.q[: len(space.sought)]
        space = space.without(name, q, 0.0 if name in at_zero else float(q[i]))
        optimum = optimum._replace(q=np.delete(optimum.q, i))
    optimum = refined(problem, space, optimum, final=True)
    parameters, _ = space.made(optimum.q[: len(space.sought)])
    edges = {name: float(h) for name, h in at_zero.items() if name not in kept}
    return Estimate(parameters, space, optimum, undetermined + kept, edges)


def _spared(
    problem: Problem, space: Space, optimum: Optimum, undetermined: list[str]
) -> tuple[Space, Optimum, dict[str, float], NDArray[np.float64]]:
    """What is left where all have gone that may, with how wide it is; adds to the names of what has gone."""
    stays: set[str] = set()
    while True:
        half = _half_widths(optimum, FLOOR)
        excess = {
            s.name: _excess(s.logarithmic, q, h) for s, q, h in zip(space.sought, optimum.q.tolist(), half.tolist())
        }
        squares = float(np.mean(optimum.residual**2))
        if all(each <= 1.0 for each in excess.values()) and squares > problem.own**2:
            break
        spare = [s.name for s in space.sought if s.spare and s.name not in stays]
        wide = [s.name for s in space.sought if excess[s.name] > 1.0 and s.name not in stays]
        if not (spare or wide):
            break
        name = (spare or wide)[-1]
        smaller = _without(problem, space, optimum, name)
        if smaller is None:
            stays.add(name)
        else:
            undetermined.append(name)
            space, optimum = smaller
            stays.clear()
    return space, optimum, excess, half


def _beyond(problem: Problem, space: Space, optimum: Optimum, excess: dict[str, float]) -> str | None:
    """A break-away that the record neither determines nor shows: ``BEYOND`` times its largest torque; None without."""
    n = len(space.sought)
    values = space.values(optimum.q[:n])
    shown = np.abs(problem.torque - problem.columns @ optimum.q[n:])[problem.weighed] / problem.levels[problem.weighed]
    for s, q in zip(space.sought, optimum.q.tolist()):
        unsure = excess[s.name] > 1.0 or q > s.highest - EDGE
        if s.base is not None and unsure and values[s.name] > BEYOND * float(np.max(shown)):
            return s.name
    return None


def _excess(logarithmic: bool, q: float, half: float) -> float:
    """Half the width of an interval over the largest that counts as determined [1]."""
    return half / WIDEST if logarithmic else half / max(SHARE * abs(q), SMALL)


def _half_widths(optimum: Optimum, floor: float) -> NDArray[np.float64]:
    return half_widths(optimum.jacobian, optimum.residual, np.eye(optimum.q.size), floor)


def _without(problem: Problem, space: Space, optimum: Optimum, name: str) -> tuple[Space, Optimum] | None:
    """Space and optimum with a parameter at its neutral value; None where that is not allowed or fits worse."""
    n = len(space.sought)
    i = [s.name for s in space.sought].index(name)
    try:
        smaller = space.without(name, optimum.q[:n], space.sought[i].neutral)
    except ValueError:
        return None
    n_e = optimum.residual.size / samples_per_count(optimum.residual)
    growth = min(WORSE / n_e, (1.0 + HARDLY) ** 2 - 1.0)  # (F34)
    squares = float(np.sum(optimum.residual**2))
    allowed = growth * (squares + FLOOR**2 * optimum.residual.size)
    allowed = max(allowed, problem.own**2 * optimum.residual.size - squares)  # else it describes the noise of x
    again = np.where([s.bounded for s in smaller.sought], smaller.start, smaller.inside)  # what was zero may replace it
    part, coarse = problem.thinned(), 0.1 * float(np.ptp(problem.torque))
    for q in (smaller.inside, again, None):
        if q is None:  # far from here, where others take its place
            end = searched(problem, smaller, STARTS, 0, False)
        else:
            end = refined(problem, smaller, descended(part, smaller, np.append(q, optimum.q[n:]), coarse))
        if np.sum(end.residual**2) - squares <= allowed:
            return smaller, end
    return None


def linear(estimate: Estimate) -> dict[str, tuple[float, float]]:
    """95 % intervals from the derivatives at the optimum (F35), in the record's scales.

    That of a parameter with a base is of its logarithm, so that both have their part.
    """
    space, optimum = estimate.space, estimate.optimum
    names = [s.name for s in space.sought]
    rows = np.eye(optimum.q.size)
    for i, s in enumerate(space.sought):
        if s.base is not None:
            rows[i, i] = 1.0 / (1.0 + optimum.q[i])
            if s.base in names:
                rows[i, names.index(s.base)] = 1.0
    half = half_widths(optimum.jacobian, optimum.residual, rows)
    result = {}
    for s, h in zip(space.sought, half.tolist()):
        value = float(getattr(estimate.parameters, s.name))
        if s.logarithmic or s.base is not None:
            result[s.name] = (value * math.exp(-h), value * math.exp(min(h, 700.0)))
        else:
            result[s.name] = (max(value - h, 0.0) if s.bounded else value - h, value + h)
    for name, h in estimate.edges.items():
        value = float(getattr(estimate.parameters, name))
        result[name] = (value, value * (1.0 + h) if name in space.tied else value + h)
    return result
