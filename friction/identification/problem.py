"""A record in its own scales, and the search for the parameters of a law that describe it (F31)."""

import math
from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.space import Space
from steer_env.friction.law import Law
from steer_env.friction.level import Level
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.response import follow

PRIOR = 3e-4  # weight of a coordinate's distance from its start, where nothing else tells it [1]
EQUAL = 1e-3  # cost of the first search beyond the best one, within which the first one counts [1]
COARSE = 4000  # samples of a record for such a search
TRIES = 40  # steps of a search that only has to come near [1]
SCREENED_SETS = 48  # sets drawn at random, of which the best are starts too
PENALTY = 10.0  # on the way out of the range that the law allows [1]


class Problem(NamedTuple):
    """A record in its own scales, and the samples that count."""

    x: NDArray[np.float64]  # displacement [1]
    torque: NDArray[np.float64]  # [1]
    dt: float  # time between samples [1]
    load: NDArray[np.float64]  # over its mean; 0 where none is known [1]
    levels: NDArray[np.float64]  # factor on the saturated friction at each sample [1]
    weighed: NDArray[np.bool_]  # the samples that count
    columns: NDArray[np.float64]  # (T, K) what adds to the torque in proportion: offset, acceleration [1]
    own: float = 0.0  # deviation of the torque that the noise of a smoothed x explains [1]

    def thinned(self) -> "Problem":
        """Every so manieth sample, so that about ``COARSE`` are left, for a search that only has to come near."""
        k = max(self.x.size // COARSE, 1)
        part = self._replace(x=self.x[::k], torque=self.torque[::k], dt=self.dt * k, load=self.load[::k])
        return part._replace(levels=self.levels[::k], weighed=self.weighed[::k], columns=self.columns[::k])

    def at(self, level: Level) -> "Problem":
        """With this level, in the record's scales."""
        wave = level.position * np.cos(level.order * (self.x - level.peak))
        return self._replace(levels=(1.0 + level.load * self.load) * (1.0 + wave))  # (F38), (F42)

    def response(self, law: Law, parameters: Any) -> NDArray[np.float64]:
        """Torque of the law along the record [1]."""
        out = np.zeros(self.x.size)
        p = frozen(parameters)
        scales = np.column_stack([self.levels, self.levels])  # both directions alike
        follow(p, scales, np.zeros(law.memory_size(p)), self.x, self.dt, out)
        return out


class Optimum(NamedTuple):
    """The end of a search."""

    q: NDArray[np.float64]  # coordinates, then the factors of the problem's columns [1]
    cost: float  # half the sum of the robust loss [1]
    residual: NDArray[np.float64]  # at the weighed samples [1]
    jacobian: NDArray[np.float64]  # of the residual, with the weights of the loss [1]
    loss_scale: float  # where the loss turns from square to linear [1]

    @property
    def weakened(self) -> NDArray[np.float64]:
        """Residuals whose squares are the loss [1]."""
        return weakened(self.residual, self.loss_scale)

    @property
    def weight(self) -> NDArray[np.float64]:
        """Derivatives of the weakened residuals by the residuals [1]."""
        return _slope(self.residual, self.loss_scale)


class Course:
    """Torque of a law along a record (T,) [1] at coordinates, and how far those are from what the law allows.

    The last ones are kept: a search asks again for where it is, and the factors of columns do not move the law.
    """

    def __init__(self, problem: Problem, space: Space) -> None:
        self._kept = lru_cache(maxsize=space.size + 2)(partial(self._follow, problem, space))

    def __call__(self, q: NDArray) -> tuple[NDArray[np.float64], float]:
        return self._kept(q.tobytes())

    @staticmethod
    def _follow(problem: Problem, space: Space, q: bytes) -> tuple[NDArray[np.float64], float]:
        at = np.frombuffer(q)
        parameters, outside = space.made(at)
        return problem.at(space.level(at)).response(space.law, parameters), outside


def residuals(
    problem: Problem, space: Space, q: NDArray, prior: float, course: Course | None = None
) -> NDArray[np.float64]:
    """Residuals at the weighed samples (F31), and rows that keep the search near.

    One row draws it back into the range that the law allows; the others, of weight ``prior``, hold a coordinate at its
    start that the record does not determine.
    """
    n = space.size
    torque, outside = (course or Course(problem, space))(q[:n])
    model = torque + problem.columns @ q[n:]
    e = np.nan_to_num(model - problem.torque, nan=1e6, posinf=1e6, neginf=-1e6)[problem.weighed]  # (F31)
    return np.concatenate([e, [PENALTY * math.sqrt(e.size) * outside], prior * (q[:n] - space.start)])


def descended(problem: Problem, space: Space, q: NDArray, loss_scale: float, *, final: bool = False) -> Optimum:
    """The end of robust least squares from ``q``, close to it with ``final``.

    Raises
    ------
    ValueError
        If a final search does not converge.
    """
    from scipy.optimize import least_squares  # imported here, because that takes longer than the import of all laws

    prior, n = PRIOR, np.count_nonzero(problem.weighed)
    free = np.full(q.size - space.size, math.inf)
    bounds = np.append(space.lowest, -free), np.append(space.highest, free)

    course = Course(problem, space)

    def losses(each: NDArray) -> NDArray[np.float64]:
        e = residuals(problem, space, each, prior, course)
        e[:n] = weakened(e[:n], loss_scale)
        return e

    def slopes(each: NDArray) -> NDArray[np.float64]:
        return _slopes(losses, space, each, losses(each))

    tolerance = 1e-9 if final else 1e-6
    steps = 10 * TRIES if final else TRIES
    found = least_squares(
        losses, np.clip(q, *bounds), slopes, bounds, xtol=tolerance, ftol=tolerance, gtol=1e-15, max_nfev=steps
    )
    if final and not found.success:  # along an edge of what the law allows; a second search that gains little is enough
        cost = found.cost
        found = least_squares(losses, found.x, slopes, bounds, xtol=1e-6, ftol=1e-6, max_nfev=steps)
        found.success = found.success or found.cost > (1.0 - 1e-3) * cost
    if not np.isfinite(found.cost) or (final and not found.success):
        at = space.edges(space.nearest(found.x[: space.size]))
        edge = f": it runs along the edge of what the law allows for {', '.join(at)}" if at else f" ({found.message})"
        remedy = "the record may be of another law; " if at else "try more starts, global_search=True, or "
        raise ValueError(
            f"the search for the parameters of {space.law.name!r} did not converge{edge}: {remedy}give what is known "
            "with fixed="
        )
    q = found.x.copy()
    q[: space.size] = space.nearest(q[: space.size])
    e = residuals(problem, space, q, prior, course)[:n]
    slope = _slopes(lambda each: residuals(problem, space, each, 0.0, course)[:n], space, q, e)
    return Optimum(q, float(found.cost), e, _slope(e, loss_scale)[:, None] * slope, loss_scale)


def _slopes(residual: Callable[[NDArray], NDArray], space: Space, q: NDArray, here: NDArray) -> NDArray[np.float64]:
    """Derivatives of residuals, which are ``here`` at ``q``, to the side that the law allows."""
    n, columns = space.size, []
    for i in range(q.size):
        step = np.zeros(q.size)
        step[i] = 1e-6 * max(1.0, abs(q[i]))
        if i < n and space.made((q + step)[:n])[1] > space.made((q - step)[:n])[1]:
            step = -step
        columns.append((residual(q + step) - here) / step[i])
    return np.column_stack(columns)


def weakened(e: NDArray, scale: float) -> NDArray[np.float64]:
    """Residuals whose squares are the loss soft L1, ``2 s^2 (sqrt(1 + (e/s)^2) - 1)``; small ones are unchanged."""
    return e * np.sqrt(2.0 / (1.0 + np.sqrt(1.0 + (e / scale) ** 2)))


def _slope(e: NDArray, scale: float) -> NDArray[np.float64]:
    """Derivative of :func:`weakened`."""
    root = np.sqrt(1.0 + (e / scale) ** 2)
    return np.sqrt(0.5 * (1.0 + root)) / root


def searched(problem: Problem, space: Space, starts: int, seed: int, global_search: bool) -> Optimum:
    """The best of several searches: from the record's own scales, and from the best of sets drawn at random."""
    K = problem.columns.shape[1]
    middle = np.append(np.median(problem.torque[problem.weighed]), np.zeros(K))[:K]
    coarse, part = 0.1 * float(np.ptp(problem.torque)), problem.thinned()
    first = np.append(space.inside, middle)
    others: list[NDArray] = []
    if starts > 1 and space.sought and not space.sliders:  # sliders begin near their optimum
        rng = np.random.default_rng(seed)
        drawn = [
            np.append(_draw_set(space, rng.normal(0.0, 1.5, len(space.sought))), middle) for _ in range(SCREENED_SETS)
        ]
        costs = [np.sum(np.abs(residuals(part, space, q, PRIOR))) for q in drawn]
        others = [drawn[i] for i in np.argsort(costs)[: starts - 1]]
    if global_search:
        others.append(_evolved(part, space, middle, coarse, seed))
    free = space._replace(relaxed=True)  # the way to the optimum may lead through sets that the law refuses
    ends = [descended(part, free, q, coarse) for q in [first, *others]]
    best = min(ends, key=lambda end: end.cost)
    best = ends[0] if ends[0].cost < (1.0 + EQUAL) * best.cost else best  # at one speed, two parts may change places
    best = refined(problem, free, best)
    n = space.size
    return refined(problem, space, best._replace(q=np.append(space.nearest(best.q[:n]), best.q[n:])))


def _draw_set(space: Space, steps: NDArray) -> NDArray[np.float64]:
    """A set at steps of a standard normal from the inside: e-fold in logarithms and in what may be zero."""
    q = space.inside.copy()
    for i, s in enumerate(space.sought):
        q[i] = q[i] + steps[i] if s.logarithmic else q[i] * math.exp(steps[i])
    return q


def refined(problem: Problem, space: Space, end: Optimum, *, final: bool = False) -> Optimum:
    """The optimum with a loss that turns linear at three standard deviations of the residuals."""
    deviation = 1.4826 * float(np.median(np.abs(end.residual)))
    scale = max(3.0 * deviation, 1e-6 * float(np.ptp(problem.torque)))
    return descended(problem, space, end.q, scale, final=final)


def _evolved(problem: Problem, space: Space, middle: NDArray, loss_scale: float, seed: int) -> NDArray[np.float64]:
    """The best set that differential evolution finds within three decades about the inside."""
    from scipy.optimize import differential_evolution  # imported here, as above

    reach = np.array([math.log(1e3) if s.logarithmic else 10.0 for s in space.sought])
    low = [q - r if s.logarithmic else min(0.0, q) for q, r, s in zip(space.inside, reach, space.sought)]
    bounds = [*zip(low, space.inside + reach), *((m - 1.0, m + 1.0) for m in middle)]

    def cost(q: NDArray) -> float:
        z = (residuals(problem, space, q, PRIOR) / loss_scale) ** 2
        return float(np.sum(np.sqrt(1.0 + z) - 1.0))

    return differential_evolution(cost, bounds, seed=seed, tol=1e-6, maxiter=300, polish=False).x
