"""Which parameters a record determines, found from the fit and not declared (F34), and their intervals (F35, F37).

The intervals allow for residuals that are not independent of each other. Block bootstrap and profile of the loss do
without the linear theory.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.periods import period
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
STRETCHES = 10  # parts of a record without equal periods ...
LEAST = 5  # ... or with fewer of them
SPEEDS = 1.5  # over each other, of the 95th and the 5th percentile of the way: less is one speed; assumed [1]
FAR = 20.0  # travels of the record, after which a law slides; assumed [1]
DRAWS = 400  # resamplings
BLOCKS = 40  # of the weighed samples
DAMPING = "N m s/rad"
SIZE = 1.96  # deviations of the normal distribution: 95 %


class Estimate(NamedTuple):
    """The end of the search, with what the record does not determine held at neutral values."""

    parameters: Any  # of the law, in the record's scales
    space: Space  # of what is left
    optimum: Optimum
    undetermined: list[str]
    edges: dict[str, float]  # half the widths of the intervals of coordinates that ended at zero [1]
    wide: tuple[Space, Optimum] | None  # before estimates that are not determined were held; None: there are none

    @property
    def factors(self) -> NDArray[np.float64]:
        """Of the problem's columns: offset [1]."""
        return self.optimum.q[len(self.space.sought) :]


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
    size[size == 0.0] = 1e-12 * (size.max() or 1.0)
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
        space, optimum, excess, half = _spared(problem, space, optimum, undetermined)
        name = _beyond(problem, space, optimum, excess) or _damping(problem, space, optimum)
        if name is None:
            break
        undetermined.append(name)
        space = space.without(name, optimum.q[: len(space.sought)], 0.0)
        optimum = searched(problem, space, STARTS, 0, False)
    kept = [s.name for s in space.sought if excess[s.name] > 1.0]
    wide = (space, optimum) if kept else None
    at_zero = {s.name: h for s, q, h in zip(space.sought, optimum.q, half) if s.spare and s.bounded and q < EDGE}
    for name in [*kept, *(name for name in at_zero if name not in kept)]:  # where the search would only chatter
        i = [s.name for s in space.sought].index(name)
        q = optimum.q[: len(space.sought)]
        space = space.without(name, q, 0.0 if name in at_zero else float(q[i]))
        optimum = optimum._replace(q=np.delete(optimum.q, i))
    optimum = refined(problem, space, optimum, final=True)
    parameters, _ = space.made(optimum.q[: len(space.sought)])
    edges = {name: float(h) for name, h in at_zero.items() if name not in kept}
    return Estimate(parameters, space, optimum, undetermined + kept, edges, wide)


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
    way = step * np.arange(math.ceil(FAR * float(np.ptp(problem.x)) / step), dtype=float)
    return problem._replace(x=way, levels=np.ones(way.size))


def _damping(problem: Problem, space: Space, optimum: Optimum) -> str | None:
    """Name of a sought damping that changes the sliding torque at one speed, where a level is sought too; else None.

    At one speed such a damping cannot be told from the level.
    """
    units = {s.name: space.law.units.get(s.name) for s in space.sought}
    spare = [i for i, s in enumerate(space.sought) if s.neutral == 0.0 and units[s.name] == DAMPING]
    if not spare or "N m" not in units.values() or not one_speed(problem):
        return None
    far, q = far_slide(problem), optimum.q[: len(units)]

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


def linear(
    estimate: Estimate, widths: Callable[[NDArray], NDArray[np.float64]] | None = None
) -> dict[str, tuple[float, float]]:
    """95 % intervals from the derivatives at the optimum (F35), in the record's scales.

    ``widths`` gives half the widths of combinations (k, m) of the coordinates in another way.

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
    half = half_widths(optimum.jacobian, optimum.residual, rows) if widths is None else widths(rows)
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


def by_periods(problem: Problem, estimate: Estimate) -> dict[str, tuple[float, float]]:
    """95 % intervals from the scatter of the record's periods, or of ``STRETCHES`` parts of it where it has none (F37).

    The jackknife's pseudo-values, from one step of the search without each period, scatter about the estimate, by
    Student's t. What a wrong law leaves alike in every period does not widen them, and a contact that changes from one
    to the next does.
    """
    from scipy.special import stdtrit  # imported here, because that takes longer than the import of all laws

    optimum, at = estimate.optimum, np.flatnonzero(problem.weighed)
    length = period(problem.x) or (at[-1] + 1 - at[0]) // STRETCHES
    if (at[-1] + 1 - at[0]) // length < LEAST:
        length = (at[-1] + 1 - at[0]) // STRETCHES
    block = (at - at[0]) // length
    n = int((at[-1] + 1 - at[0]) // length)  # whole ones
    J, e = optimum.jacobian, optimum.weakened
    parts = [(J[block == b], e[block == b]) for b in range(n)]
    steps = np.array([(1 - n) * np.linalg.pinv(J.T @ J - K.T @ K) @ (K.T @ r) for K, r in parts])  # (F37)

    def widths(rows: NDArray) -> NDArray[np.float64]:
        scatter = (steps - steps.mean(axis=0)) @ rows.T
        counts = [max(n / samples_per_count(each), 2.0) for each in scatter.T]
        return np.array([stdtrit(c - 1.0, 0.975) * np.std(s, ddof=1) / c**0.5 for c, s in zip(counts, scatter.T)])

    return linear(estimate, widths)


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
