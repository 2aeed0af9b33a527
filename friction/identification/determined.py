"""Which parameters a record determines: found from the fit, not declared (F34)."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.intervals import half_widths, samples_per_count
from steer_env.friction.identification.problem import Optimum, Problem, Space, descended, refined

WIDEST = np.log(2.0)  # half the width of the interval of a logarithm that counts as determined [1]
SHARE = 0.5  # half the width of the interval of another parameter, of its value [1] ...
SMALL = 0.05  # ... or, where it is small, of its scale [1]
FLOOR = 1e-3  # deviation of the residuals at least, of the level [1]: what noise-free records are judged by
WORSE = 6.6  # growth of the sum of squares, in deviations squared: quantile of 99 % of chi square, one degree


class Estimate(NamedTuple):
    """The end of the search, with what the record does not determine held at neutral values."""

    parameters: Any  # of the law, in the record's scales
    space: Space  # of what is left
    optimum: Optimum
    half: NDArray[np.float64]  # half the widths of the intervals of the coordinates [1]
    undetermined: list[str]

    @property
    def factors(self) -> NDArray[np.float64]:
        """Of the problem's columns: offset [1]."""
        return self.optimum.q[len(self.space.sought) :]


def determined(problem: Problem, space: Space, optimum: Optimum) -> Estimate:
    """Hold one parameter after the other at its neutral value, as long as that leaves the fit as good (F34).

    Of several with a wide interval, those go first that zero or the law itself makes neutral, and the last of the law's
    fields before the others. One without which the fit is worse keeps its estimate and is told all the same.
    """
    undetermined: list[str] = []
    stays: set[str] = set()
    while True:
        half = _half_widths(optimum, FLOOR)
        excess = {
            s.name: _excess(s.logarithmic, q, h) for s, q, h in zip(space.sought, optimum.q.tolist(), half.tolist())
        }
        wide = {s.name: s for s in space.sought if excess[s.name] > 1.0 and s.name not in stays}
        if not wide:
            break
        name = max(wide, key=lambda each: (wide[each].neutral in (0.0, None), list(wide).index(each)))
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
    optimum = refined(problem, space, optimum, final=True)
    parameters, _ = space.made(optimum.q[: len(space.sought)])
    return Estimate(parameters, space, optimum, _half_widths(optimum, 0.0), undetermined + kept)


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


def linear(estimate: Estimate) -> dict[str, tuple[float, float]]:
    """95 % intervals from the derivatives at the optimum (F35), in the record's scales."""
    result = {}
    for s, q, h in zip(estimate.space.sought, estimate.optimum.q.tolist(), estimate.half.tolist()):
        if s.name in estimate.undetermined:
            continue
        with np.errstate(over="ignore"):
            low, high = (float(np.exp(q - h)), float(np.exp(q + h))) if s.logarithmic else (q - h, q + h)
        result[s.name] = (max(low, 0.0), high) if s.neutral == 0.0 else (low, high)
    return result
