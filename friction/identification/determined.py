"""Which parameters a record determines: found from the fit, not declared (F34)."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.intervals import half_widths, samples_per_count
from steer_env.friction.identification.problem import Optimum, Problem, Sought, Space, descended, refined

WIDEST = np.log(2.0)  # half the width of the interval of a logarithm that counts as determined [1]
SHARE = 0.5  # half the width of the interval of another parameter, of its value [1] ...
SMALL = 0.05  # ... or, where it is small, of its scale [1]
FLOOR = 1e-3  # deviation of the residuals at least, of the level [1]: what noise-free records are judged by
WORSE = 6.6  # growth of the sum of squares, in deviations squared: quantile of 99 % of chi square, one degree


EDGE = 1e-3  # distance from the neutral value, in the record's scales, that is none [1]


class Estimate(NamedTuple):
    """The end of the search, with what the record does not determine held at neutral values."""

    parameters: Any  # of the law, in the record's scales
    space: Space  # of what is left
    optimum: Optimum
    half: NDArray[np.float64]  # half the widths of the intervals of the coordinates [1]
    undetermined: list[str]
    edges: dict[str, float]  # half the widths of the intervals of what is held at a neutral value that it reached [1]

    @property
    def factors(self) -> NDArray[np.float64]:
        """Of the problem's columns: offset [1]."""
        return self.optimum.q[len(self.space.sought) :]


def determined(problem: Problem, space: Space, optimum: Optimum) -> Estimate:
    """Hold one parameter after the other at its neutral value, as long as that leaves the fit as good (F34).

    As long as one has a wide interval, those go first that zero or the law itself makes neutral, and the last of the
    law's fields before the others. One without which the fit is worse keeps its estimate, and is told if it is wide.
    """
    undetermined: list[str] = []
    stays: set[str] = set()
    while True:
        half = _half_widths(optimum, FLOOR)
        excess = {
            s.name: _excess(s.logarithmic, q, h) for s, q, h in zip(space.sought, optimum.q.tolist(), half.tolist())
        }
        if all(each <= 1.0 for each in excess.values()):
            break
        spare = [s.name for s in space.sought if s.neutral in (0.0, None) and s.name not in stays]
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
    kept = [s.name for s in space.sought if s.name in stays and excess[s.name] > 1.0]
    for name in kept:
        i = [s.name for s in space.sought].index(name)
        parameters, _ = space.made(optimum.q[: len(space.sought)])
        space = space.without(name, optimum.q[: len(space.sought)], float(getattr(parameters, name)))
        optimum = optimum._replace(q=np.delete(optimum.q, i))
    edges = {}
    for s, h in zip(space.sought, half.tolist()):
        neutral = _at_neutral(space, optimum, s)
        if neutral is not None:
            space, optimum = neutral
            edges[s.name] = h
    optimum = refined(problem, space, optimum, final=True)
    parameters, _ = space.made(optimum.q[: len(space.sought)])
    return Estimate(parameters, space, optimum, _half_widths(optimum, 0.0), undetermined + kept, edges)


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
        near = descended(
            problem, smaller, np.append(smaller.inside, optimum.q[n:]), 0.1 * float(np.ptp(problem.torque))
        )
        end = refined(problem, smaller, near)
    except ValueError:
        return None
    before, after = np.sum(optimum.residual**2), np.sum(end.residual**2)
    variance = before / optimum.residual.size + FLOOR**2
    return (smaller, end) if after - before <= WORSE * variance * samples_per_count(optimum.residual) else None


def _at_neutral(space: Space, optimum: Optimum, s: Sought) -> tuple[Space, Optimum] | None:
    """Space and optimum without a parameter that has reached its neutral value, where the search would only chatter."""
    names = [each.name for each in space.sought]
    if s.neutral not in (0.0, None) or s.name not in names:
        return None
    i, q = names.index(s.name), optimum.q[: len(names)]
    try:
        smaller = space.without(s.name, q, s.neutral)
        other = getattr(smaller.made(np.delete(q, i))[0], s.name)
    except ValueError:
        return None
    if abs(other - getattr(space.made(q)[0], s.name)) > EDGE:
        return None
    return smaller, optimum._replace(q=np.delete(optimum.q, i))


def linear(estimate: Estimate) -> dict[str, tuple[float, float]]:
    """95 % intervals from the derivatives at the optimum (F35), in the record's scales."""
    result = {}
    for s, q, h in zip(estimate.space.sought, estimate.optimum.q.tolist(), estimate.half.tolist()):
        if s.name in estimate.undetermined:
            continue
        with np.errstate(over="ignore"):
            low, high = (float(np.exp(q - h)), float(np.exp(q + h))) if s.logarithmic else (q - h, q + h)
        result[s.name] = (max(low, 0.0), high) if s.neutral == 0.0 else (low, high)
    for name, h in estimate.edges.items():
        value = float(getattr(estimate.parameters, name))
        result[name] = (value, value + h * max(value, 1.0) if value else h)
    return result
