"""A law and a record in the record's own scales: parameters that are sought, residuals, and the search (F31)."""

import inspect
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.law import Law
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.response import follow

PRIOR = 3e-4  # weight of a coordinate's distance from its start, where nothing else tells it [1]
TRIES = 30  # steps of a search that only has to come near [1]
SCREENED = 48  # sets drawn at random, of which the best are starts too
PENALTY = 100.0  # on the way out of the range that the law allows [1]


class Problem(NamedTuple):
    """A record in its own scales, and the samples that count."""

    x: NDArray[np.float64]  # displacement [1]
    torque: NDArray[np.float64]  # [1]
    dt: float  # time between samples [1]
    levels: NDArray[np.float64]  # factor on the saturated friction at each sample [1]
    weighed: NDArray[np.bool_]
    columns: NDArray[np.float64]  # (T, K) what adds to the torque in proportion: offset, acceleration [1]

    def response(self, law: Law, parameters: Any) -> NDArray[np.float64]:
        """Torque of the law along the record [1]."""
        out = np.zeros(self.x.size)
        p = frozen(parameters)
        scales = np.column_stack([self.levels, self.levels])  # both directions alike
        follow(p, scales, np.zeros(law.memory_size(p)), self.x, self.dt, out)
        return out


class Sought(NamedTuple):
    """A parameter that is sought, in scaled units [1]."""

    name: str
    logarithmic: bool  # the law allows positive values only
    start: float  # [1]
    lowest: float  # of the coordinate: 0 where the law refuses a negative value [1]
    neutral: float | None  # where the record does not determine it; None: the law derives it from the others [1]


def sought_of(law: Law, given: Mapping[str, Any]) -> tuple[Sought, ...]:
    """The scalar parameters of a law except those that are given; the law's constructor tells which may be zero."""
    default = law.make()
    signature = inspect.signature(law.make).parameters
    result = []
    for name, value in default._asdict().items():
        if name in given or isinstance(value, bool) or np.ndim(value) or value is None:
            continue
        derived = signature[name].default is None
        logarithmic = not _allowed(law, {name: 0.0})
        pure = law.units.get(name) == "1"
        if logarithmic:
            start = value if pure else 1.2 if derived else 1.0
            neutral = None if derived else value if pure else 1.0
        else:
            start, neutral = (value or 0.1 if pure else 0.1), 0.0
        lowest = -math.inf if logarithmic or _allowed(law, {name: -1e-6}) else 0.0
        result.append(Sought(name, logarithmic, float(start), lowest, neutral))
    return tuple(result)


def _allowed(law: Law, values: Mapping[str, Any]) -> bool:
    try:
        law.make(**values)
    except (ValueError, OverflowError):
        return False
    return True


class Space(NamedTuple):
    """Coordinates q of the parameters that are sought: logarithms, or values where zero is allowed (F31)."""

    law: Law
    sought: tuple[Sought, ...]
    held: Mapping[str, Any]  # the other parameters; what is in neither is left to the law's constructor
    start: NDArray[np.float64]  # (N,) about the record's own scales
    inside: NDArray[np.float64]  # (N,) a set that the law allows

    def values(self, q: NDArray) -> dict[str, Any]:
        """Keywords of the law's constructor."""
        found = {s.name: math.exp(min(v, 300.0)) if s.logarithmic else v for s, v in zip(self.sought, q.tolist())}
        return {**self.held, **found}

    def made(self, q: NDArray) -> tuple[Any, float]:
        """Parameters at ``q``, or at a set nearby that the law allows, and how far off that is.

        Values that may not be negative are cut to zero. Then the one coordinate is moved towards ``inside`` that has
        the shortest way, or else all of them together.
        """
        cut = np.where(self.bounded, np.maximum(q, 0.0), q)
        if _allowed(self.law, self.values(cut)):
            return self.law.make(**self.values(cut)), float(np.linalg.norm(q - cut))
        ends = [end for end in (self._moved(cut, axis) for axis in np.eye(q.size)) if end is not None]
        everywhere = self._moved(cut, np.ones(q.size))
        edge = min(ends, key=lambda end: float(np.linalg.norm(end - cut)), default=everywhere)
        return self.law.make(**self.values(edge)), float(np.linalg.norm(q - edge))

    def _moved(self, q: NDArray, along: NDArray) -> Any:
        """The first allowed set on the way to ``inside`` along some coordinates, None if there is none."""
        way = (self.inside - q) * along
        if not _allowed(self.law, self.values(q + way)):
            return None
        low, high = 0.0, 1.0
        for _ in range(40):
            middle = 0.5 * (low + high)
            if _allowed(self.law, self.values(q + middle * way)):
                high = middle
            else:
                low = middle
        return q + high * way

    @property
    def bounded(self) -> NDArray[np.bool_]:
        """Which coordinates may not be negative."""
        return np.array([s.lowest == 0.0 for s in self.sought], dtype=bool)

    def coordinates(self, parameters: Any) -> NDArray[np.float64]:
        """The coordinates of a set of parameters."""
        values = [float(getattr(parameters, s.name)) for s in self.sought]
        return np.array([math.log(v) if s.logarithmic else v for s, v in zip(self.sought, values)])

    def without(self, name: str, q: NDArray, value: float | None) -> "Space":
        """The space with one parameter held at a value, or left to the constructor.

        Raises
        ------
        ValueError
            Where the law does not allow that beside the others.
        """
        keep = [i for i, s in enumerate(self.sought) if s.name != name]
        held = dict(self.held) if value is None else {**self.held, name: value}
        smaller = Space(self.law, tuple(self.sought[i] for i in keep), held, self.start[keep], q[keep])
        smaller = smaller._replace(inside=np.where(smaller.bounded, np.maximum(q[keep], 0.01), q[keep]))
        if not _allowed(self.law, smaller.values(q[keep])):
            smaller = smaller._replace(inside=_inside(smaller, smaller.inside))
        return smaller


def space_of(law: Law, held: Mapping[str, Any]) -> Space:
    """The space of all scalar parameters that are not held, about the record's own scales.

    Raises
    ------
    ValueError
        If no set near them is allowed.
    """
    sought = sought_of(law, held)
    q = np.array([math.log(s.start) if s.logarithmic else s.start for s in sought])
    space = Space(law, sought, held, q, q)
    return space if _allowed(law, space.values(q)) else space._replace(inside=_inside(space, q))


def _inside(space: Space, q: NDArray) -> NDArray[np.float64]:
    """A set near ``q`` that the law allows, by drawing ever wider about it."""
    rng = np.random.default_rng(0)
    for i in range(400):
        drawn = q + rng.normal(0.0, 0.02 * (1 + i) ** 0.75, q.size)
        if _allowed(space.law, space.values(drawn)):
            return drawn
    raise ValueError(f"friction law {space.law.name!r} allows no parameters near those that the record suggests")


class Optimum(NamedTuple):
    """The end of a search."""

    q: NDArray[np.float64]  # coordinates, then the factors of the problem's columns [1]
    cost: float  # half the sum of the robust loss [1]
    residual: NDArray[np.float64]  # at the weighed samples [1]
    jacobian: NDArray[np.float64]  # of the residual, with the weights of the loss [1]
    loss_scale: float  # where the loss turns from square to linear [1]


def residuals(problem: Problem, space: Space, q: NDArray, prior: float) -> NDArray[np.float64]:
    """Residuals at the weighed samples (F31), and rows that keep the search near.

    One row draws it back into the range that the law allows; the others, of weight ``prior``, hold a coordinate at its
    start that the record does not determine.
    """
    n = len(space.sought)
    parameters, outside = space.made(q[:n])
    model = problem.response(space.law, parameters) + problem.columns @ q[n:]
    e = (model - problem.torque)[problem.weighed]  # (F31)
    return np.concatenate([e, [PENALTY * math.sqrt(e.size) * outside], prior * (q[:n] - space.start)])


def descended(problem: Problem, space: Space, q: NDArray, loss_scale: float, *, final: bool = False) -> Optimum:
    """Robust least squares from ``q``; not ``final`` is a search in which some coordinates may be undetermined.

    Raises
    ------
    ValueError
        If a final search does not converge.
    """
    from scipy.optimize import least_squares  # imported here, because that takes longer than the import of all laws

    prior, n = 0.0 if final else PRIOR, np.count_nonzero(problem.weighed)

    def weakened(each: NDArray) -> NDArray[np.float64]:
        e = residuals(problem, space, each, prior)
        e[:n] = _soft(e[:n], loss_scale)
        return e

    tolerance = 1e-12 if final else 1e-6
    steps = 100 if final else TRIES
    found = least_squares(
        weakened, q, method="lm", xtol=tolerance, ftol=tolerance, gtol=1e-15, max_nfev=steps * (q.size + 1)
    )
    if not np.isfinite(found.cost) or (final and not found.success):
        raise ValueError(
            f"the search for the parameters of {space.law.name!r} did not converge ({found.message}): try more starts, "
            "global_search=True, or fixed= for what is known"
        )
    q = found.x.copy()
    q[: len(space.sought)] = space.coordinates(space.made(q[: len(space.sought)])[0])  # within what the law allows
    e = residuals(problem, space, q, prior)[:n]
    return Optimum(q, float(found.cost), e, _jacobian(problem, space, q, loss_scale)[:n], loss_scale)


def _jacobian(problem: Problem, space: Space, q: NDArray, scale: float) -> NDArray[np.float64]:
    """Derivatives of the weakened residuals, to the side that the law allows."""
    n = len(space.sought)
    first = residuals(problem, space, q, 0.0)
    root = np.sqrt(1.0 + (first / scale) ** 2)
    weight = np.sqrt(0.5 * (1.0 + root)) / root  # derivative of :func:`_soft`
    columns = []
    for i in range(q.size):
        step = np.zeros(q.size)
        step[i] = 1e-6 * max(1.0, abs(q[i]))
        if space.made((q + step)[:n])[1] > space.made((q - step)[:n])[1]:
            step = -step
        columns.append(weight * (residuals(problem, space, q + step, 0.0) - first) / step[i])
    return np.column_stack(columns)


def _soft(e: NDArray, scale: float) -> NDArray[np.float64]:
    """Residuals whose squares are the loss soft L1, ``2 s^2 (sqrt(1 + (e/s)^2) - 1)``; small ones are unchanged."""
    return e * np.sqrt(2.0 / (1.0 + np.sqrt(1.0 + (e / scale) ** 2)))


def searched(problem: Problem, space: Space, starts: int, seed: int, global_search: bool) -> Optimum:
    """The best of several searches: from the record's own scales, and from the best of sets drawn at random."""
    K = problem.columns.shape[1]
    middle = np.append(np.median(problem.torque[problem.weighed]), np.zeros(K))[:K]
    coarse = 0.1 * float(np.ptp(problem.torque))
    first = np.append(space.inside, middle)
    others: list[NDArray] = []
    if starts > 1 and space.sought:
        rng = np.random.default_rng(seed)
        drawn = [np.append(_drawn(space, rng.normal(0.0, 1.5, len(space.sought))), middle) for _ in range(SCREENED)]
        costs = [np.sum(np.abs(residuals(problem, space, q, PRIOR))) for q in drawn]
        others = [drawn[i] for i in np.argsort(costs)[: starts - 1]]
    if global_search:
        others.append(_evolved(problem, space, middle, coarse, seed))
    best = min((descended(problem, space, q, coarse) for q in [first, *others]), key=lambda end: end.cost)
    return refined(problem, space, best)


def _drawn(space: Space, steps: NDArray) -> NDArray[np.float64]:
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
