"""Which parameters a record determines, found from the fit and not declared (F34), and their intervals (F35, F37).

The intervals allow for residuals that are not independent of each other.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.periods import period
from steer_env.friction.identification.problem import Optimum, Problem, descended, refined, searched
from steer_env.friction.identification.space import EDGE, Space
from steer_env.friction.level import Level

FLOOR = 1e-3  # deviation of the residuals at least, of the level [1]: what noise-free records are judged by
WORSE = 6.6  # growth of the sum of squares, in deviations squared: quantile of 99 % of chi square, one degree ...
HARDLY = 0.02  # ... and of the residual at most [1]: residuals that last for long allow much growth
FAR_OUT = 3.0  # of the scale of the loss: larger residuals say nothing of a parameter, as of a late reversal; assumed
NEARLY = 2.0  # of the growth that is allowed, within which a search from elsewhere may gain enough; assumed [1]
STARTS = 3  # of the search without a break-away ...
# ... of so many times the largest torque of the record, which does not show it then; assumed [1]
BREAK_AWAY_EXCESS = 1.5
STRETCHES = 10  # parts of a record without equal periods ...
LEAST_PERIODS = 5  # ... or with fewer of them
SPEEDS = 1.5  # over each other, of the 95th and the 5th percentile of the way: less is one speed; assumed [1]
LONG_SLIDE_TRAVELS = 20.0  # travels of the record, after which a law slides; assumed [1]
FLAT = 1e-8  # of the steepest column: a flatter one is rounding of a difference quotient, which may follow another [1]
ROUNDING = 1e-6  # deviation of the residuals that an interval allows for at least, of the level; assumed [1]
DAMPING = "N m s/rad"
NORMAL_QUANTILE = 1.96  # deviations of the normal distribution: 95 %


class Estimate(NamedTuple):
    """The end of the search, with what the record does not determine held at neutral values."""

    parameters: Any  # of the law, in the record's scales
    space: Space  # of what is left
    optimum: Optimum
    undetermined: list[str]  # of which the space still has those without which the fit is worse
    shift: NDArray[np.float64] | None = None  # of the coordinates, by which noise of x had moved them [1]

    @property
    def level(self) -> Level:
        """In the record's scales."""
        return self.space.level(self.optimum.q[: self.space.size])

    @property
    def beside_level(self) -> NDArray[np.float64]:
        """Derivatives of the residuals by all that is no field of the level."""
        of_level = np.flatnonzero([s.of_level for s in self.space.sought])
        return np.delete(self.optimum.jacobian, of_level, axis=1)

    @property
    def factors(self) -> NDArray[np.float64]:
        """Of the problem's columns: offset [1]."""
        return self.optimum.q[self.space.size :]

    @property
    def slid(self) -> list[NDArray[np.float64]]:
        """Levels, yields and slopes of sliders [1]."""
        return self.space.slid(self.optimum.q[: self.space.size])


def samples_per_count(residual: NDArray) -> float:
    """How many samples count as one, ``1 + 2 sum r_k``, where the residuals are not independent (F35).

    r_k is the autocorrelation of the residuals, summed up to the first lag where it is not positive.

    Source: Bayley, Hammersley, J. R. Statistical Society Suppl. 8 (1946) 184-197.
    """
    n = residual.size
    power = np.abs(np.fft.rfft(residual, 2 * n)) ** 2  # padded to twice the length, so that the end does not wrap
    r = np.fft.irfft(power)[:n]
    if not r[0] > 0.0:
        return 1.0
    return float(1.0 + (2.0 * np.sum(r[1 : np.argmax(r <= 0.0)]) / r[0] if (r <= 0.0).any() else n))


def half_widths(J: NDArray, residual: NDArray, rows: NDArray, floor: float = 0.0) -> NDArray[np.float64]:
    """Half the widths of the 95 % intervals of the combinations ``rows @ parameters``, by Student's t (F35).

    The covariance ``s^2 inv(J'J)`` of independent residuals is multiplied by :func:`samples_per_count`.

    Parameters
    ----------
    J : (n, m) array
        Derivatives of the residuals by the parameters.
    residual : (n,) array
        Residuals at the estimate, in order of time.
    rows : (k, m) array
        Combinations of parameters.
    floor : float
        Least standard deviation that the residuals count with.

    Returns
    -------
    (k,) array
        In the units of the combinations; very large where the residuals do not depend on a parameter.
    """
    from scipy.special import stdtrit  # imported here, because that takes longer than the import of all laws

    n, m = J.shape
    freedom = max(n / samples_per_count(residual) - m, 1.0)
    size = np.linalg.norm(J, axis=0)
    flat = size <= FLAT * size.max()
    J, size = np.where(flat, 0.0, J), np.where(flat, 1e-12 * (size.max() or 1.0), size)
    w, V = np.linalg.eigh((J / size).T @ (J / size))
    inverse = V / np.maximum(w, 1e-14) @ V.T  # parameters without influence get a very large variance
    variance = max(residual @ residual / freedom, floor**2)  # (F35)
    C = variance * inverse / np.outer(size, size)
    return stdtrit(freedom, 0.975) * np.sqrt(np.einsum("ki,ij,kj->k", rows, C, rows))


def determined(problem: Problem, space: Space, optimum: Optimum) -> Estimate:
    """Hold one parameter after the other at its neutral value, as long as that leaves the fit as good (F34).

    As long as one has a wide interval, those go first that zero or the law itself makes neutral, and the last of the
    law's fields before the others. One without which the fit is worse keeps its estimate, and is told if it is wide.
    A break-away far beyond all torques of the record, wide or at the end of its range, goes even where the fit is
    worse: it trades with the sliding torque, and the level that the record shows would go with both. At one speed, what
    damps the sliding goes, however well it seems to fit: there it is a part of the level, and what tells the two apart
    is the misfit of the law.
    """
    undetermined: list[str] = []
    while True:
        space, optimum, excess = _spared(problem, space, optimum, undetermined)
        name = _break_away_not_shown(problem, space, optimum, excess) or _damping(problem, space, optimum)
        if name is None:
            break
        undetermined.append(name)
        space = space.without(name, optimum.q[: space.size], 0.0)
        optimum = searched(problem, space, STARTS, 0, False)
    kept = [s.name for s in space.sought if excess[s.name] > 1.0]
    optimum = refined(problem, space, optimum, final=True)
    parameters, _ = space.made(optimum.q[: space.size])
    return Estimate(parameters, space, optimum, undetermined + kept)


def one_speed(problem: Problem) -> bool:
    """Whether the weighed motion has one speed, but for a twentieth of the way at either end (F34)."""
    steps = np.sort(np.abs(np.diff(problem.x))[problem.weighed[1:]])
    way = np.cumsum(steps)
    low, high = steps[np.searchsorted(way, np.array([0.05, 0.95]) * way[-1])]
    return bool(high < SPEEDS * low)


def far_slide(problem: Problem) -> Problem:
    """The problem of a long way in one direction at the record's median speed."""
    steps = np.abs(np.diff(problem.x))
    step = float(np.median(steps[steps > 0.0]))
    way = step * np.arange(math.ceil(LONG_SLIDE_TRAVELS * float(np.ptp(problem.x)) / step), dtype=float)
    return problem._replace(x=way, levels=np.ones(way.size))


def _damping(problem: Problem, space: Space, optimum: Optimum) -> str | None:
    """Name of a sought damping that changes the sliding torque at one speed, where a level is sought too; else None.

    At one speed such a damping cannot be told from the level.
    """
    units = {s.name: space.law.units.get(s.name) for s in space.sought}
    spare = [i for i, s in enumerate(space.sought) if s.neutral == 0.0 and units[s.name] == DAMPING]
    if not spare or not ("N m" in units.values() or space.sliders) or not one_speed(problem):
        return None
    far, q = far_slide(problem), optimum.q[: space.size]

    def sliding(each: NDArray) -> float:
        return float(far.response(space.law, space.made(each)[0])[-1])

    for i in spare:
        more, name = q + 0.1 * np.eye(q.size)[i], space.sought[i].name
        if abs(sliding(more) - sliding(q)) > FLOOR and _may_go(space, name, q):
            return name
    return None


def _may_go(space: Space, name: str, q: NDArray) -> bool:
    """Whether the law allows zero for a parameter beside the others."""
    try:
        space.without(name, q, 0.0)
    except ValueError:
        return False
    return True


def _spared(
    problem: Problem, space: Space, optimum: Optimum, undetermined: list[str]
) -> tuple[Space, Optimum, dict[str, float]]:
    """What is left where all have gone that may, with how wide it is; adds to the names of what has gone."""
    stays: set[str] = set()
    while True:
        half = half_widths(optimum.jacobian, optimum.residual, np.eye(optimum.q.size), FLOOR)
        excess = {s.name: s.excess(q, h) for s, q, h in zip(space.sought, optimum.q.tolist(), half.tolist())}
        squares = float(np.mean(optimum.residual**2))
        if all(each <= 1.0 for each in excess.values()) and squares > problem.own**2:
            break
        spare = [s.name for s in space.sought if s.spare and s.name not in stays]
        wide = [s.name for s in space.sought if excess[s.name] > 1.0 and s.name not in stays]
        if not (spare or wide):
            break
        name = (spare or wide)[-1]
        smaller = _without_parameter(problem, space, optimum, name)
        if smaller is None:
            stays.add(name)
        else:
            undetermined.append(name)
            space, optimum = smaller
            stays.clear()
    return space, optimum, excess


def _break_away_not_shown(problem: Problem, space: Space, optimum: Optimum, excess: dict[str, float]) -> str | None:
    """A break-away above ``BREAK_AWAY_EXCESS`` times the record's torque that is not determined; None without."""
    n = space.size
    values = space.values(optimum.q[:n])
    levels = problem.at(space.level(optimum.q[:n])).levels
    shown = (np.abs(problem.torque - problem.columns @ optimum.q[n:]) / levels)[problem.weighed]
    for s, q in zip(space.sought, optimum.q.tolist()):
        unsure = excess[s.name] > 1.0 or q > s.highest - EDGE
        if s.base is not None and unsure and values[s.name] > BREAK_AWAY_EXCESS * float(np.max(shown)):
            return s.name
    return None


def _without_parameter(problem: Problem, space: Space, optimum: Optimum, name: str) -> tuple[Space, Optimum] | None:
    """Space and optimum with a parameter at its neutral value; None where that is not allowed or fits worse."""
    n = space.size
    i = [s.name for s in space.sought].index(name)
    try:
        smaller = space.without(name, optimum.q[:n], space.sought[i].neutral)
    except ValueError:
        return None
    n_e = optimum.residual.size / samples_per_count(optimum.residual)
    growth = min(WORSE / n_e, (1.0 + HARDLY) ** 2 - 1.0)  # (F34)
    spare = problem.own**2 * optimum.residual.size - float(np.sum(optimum.residual**2))  # it describes the noise of x
    again = np.where(smaller.lowest == 0.0, smaller.start, smaller.inside)  # what was zero may replace it
    part, coarse, least = problem.thinned(), 0.1 * float(np.ptp(problem.torque)), math.inf
    for q in (smaller.inside, again, None):
        if q is None and least > NEARLY:
            break
        if q is None:  # far from here, where others take its place
            end = searched(problem, smaller, STARTS, 0, False)
        else:
            end = refined(problem, smaller, descended(part, smaller, np.append(q, optimum.q[n:]), coarse))
        inside = np.abs(optimum.residual) < FAR_OUT * end.loss_scale  # without what would allow much
        before, after = (float(np.sum(each.residual[inside] ** 2)) for each in (optimum, end))
        allowed = max(growth * (before + FLOOR**2 * inside.sum()), spare)
        if after - before <= allowed:
            return smaller, end
        least = min(least, (after - before) / allowed)
    return None


def parameter_intervals(problem: Problem, estimate: Estimate) -> dict[str, tuple[float, float]]:
    """95 % intervals of the parameters (F37), in the record's scales.

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
            elif space.sliders:
                rows[i] += level_row(estimate)  # the base is their sum
    result = {}
    for s, h in zip(space.sought, widths(problem, estimate, rows).tolist()):
        if s.of_level or s.name in estimate.undetermined:
            continue
        value = float(getattr(estimate.parameters, s.name))
        if s.logarithmic or s.base is not None:
            result[s.name] = (value * math.exp(-h), value * math.exp(min(h, 700.0)))
        else:
            result[s.name] = (max(value - h, 0.0) if s.bounded else value - h, value + h)
    return result


def half_widths_of_level(estimate: Estimate) -> dict[str, float]:
    """Half the widths of the 95 % intervals of what is sought of the level (F35), in the record's scales."""
    end = estimate.optimum
    half = half_widths(end.jacobian, end.weakened, np.eye(end.q.size), FLOOR)
    return {s.name: h for s, h in zip(estimate.space.sought, half.tolist()) if s.of_level}


def level_row(estimate: Estimate) -> NDArray[np.float64]:
    """Derivatives of the logarithm of the level of all sliders by the coordinates (m,)."""
    space, row = estimate.space, np.zeros(estimate.optimum.q.size)
    F = estimate.slid[0]
    row[len(space.sought) : len(space.sought) + F.size] = F / F.sum()
    return row


def widths(problem: Problem, estimate: Estimate, rows: NDArray) -> NDArray[np.float64]:
    """Half the widths (k,) of the 95 % intervals of combinations (k, m) of the coordinates (F37).

    They are those of the scatter of the record's periods, or of ``STRETCHES`` parts of it where it has none. The
    jackknife's pseudo-values, from one step of the search without each period, scatter about the estimate, by
    Student's t. What a wrong law leaves alike in every period does not widen them, and a contact that changes from one
    to the next does.
    """
    from scipy.special import stdtrit  # imported here, because that takes longer than the import of all laws

    optimum, at = estimate.optimum, np.flatnonzero(problem.weighed)
    length = period(problem.x) or (at[-1] + 1 - at[0]) // STRETCHES
    if (at[-1] + 1 - at[0]) // length < LEAST_PERIODS:
        length = (at[-1] + 1 - at[0]) // STRETCHES
    block = (at - at[0]) // length
    n = int((at[-1] + 1 - at[0]) // length)  # whole ones
    space, q = estimate.space, optimum.q[: estimate.space.size]
    free = np.ones(optimum.q.size, bool)  # but for yields and slopes of sliders at their ends, which stay there
    free[len(space.sought) : q.size] = (np.minimum(space.highest - q, q - space.lowest) > EDGE)[len(space.sought) :]
    J, e, rows = optimum.jacobian[:, free], optimum.weakened, rows[:, free]
    parts = [(J[block == b], e[block == b]) for b in range(n)]
    steps = np.array([(1 - n) * np.linalg.pinv(J.T @ J - K.T @ K) @ (K.T @ r) for K, r in parts])  # (F37)
    scatter = (steps - steps.mean(axis=0)) @ rows.T
    counts = [max(n / samples_per_count(each), 2.0) for each in scatter.T]
    scatter_half = np.array([stdtrit(c - 1.0, 0.975) * np.std(s, ddof=1) / c**0.5 for c, s in zip(counts, scatter.T)])
    half = np.hypot(scatter_half, half_widths(J, np.zeros(e.size), rows, ROUNDING))
    return half if estimate.shift is None else np.hypot(half, np.abs(rows @ estimate.shift[free]))
