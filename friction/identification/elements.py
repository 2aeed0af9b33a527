"""Sliders in parallel from a record: how many there are, and where the search for all parameters begins (F32).

The torque of sliders is linear in their levels, and so is a viscous part beside them. On a grid of yields least squares
with factors that are not negative therefore needs no initial guess and has no local minimum. What it finds is merged
and pruned as long as Bayes' criterion falls, with the yields sought off the grid beside the levels.

Sources: Rizos, Fassois, Chaos 14 (2004) 431-445 (Maxwell slip as a regression); Lawson, Hanson, Solving Least Squares
Problems, 1974; Kaufman, BIT 15 (1975) 49-57 (derivatives of what least squares leaves).
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.blocks import not_negative_factors
from steer_env.friction.identification.determined import one_speed, samples_per_count
from steer_env.friction.identification.displacement import white_noise_deviation
from steer_env.friction.identification.problem import Problem
from steer_env.friction.law import Law, Sliders
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.virgin_curve import MAX_ELEMENTS

GRID = 40  # yields
LEAST_YIELD = 1e-3  # of them, over half the travel [1]
SLOPES = (1.0, 0.5, 0.0, -0.5, -1.0)  # of levels over the stroke; at 1 and -1 a level is zero at one end of it [1]
DERIVATIVE_STEP = 1e-4  # of the logarithm of a yield and of a slope, for derivatives [1]
HARDLY = 1.02  # sum of squares that fewer sliders leave at most, over that of all of the grid; assumed [1]
ROUNDS = 30  # of the search for yields
MATTERS = 0.05  # of the level: a smaller slider that yields late is not told; assumed [1]
COUNTING_SAMPLES = 6000  # samples by which sliders are counted, about; assumed

# Of the search for the Stribeck curve and the lag of sliders that have them:
YIELDS = 8  # on which it begins
TRIES = 20  # steps
LARGEST = 4.0  # relative excess of break-away; assumed [1]
LOG_SEARCH_RANGE = 6.0  # of the logarithms of Stribeck speed and C about the record's own scales [1]
# Of the level, that sliders leave beside white noise: less calls for no Stribeck effect; assumed [1]
STRIBECK_RESIDUAL = 0.003

Slider = Callable[[float, float], NDArray[np.float64]]  # yield, slope -> torque (T,) of an element of unit level [1]


class Elements(NamedTuple):
    """Sliders with which the search for all parameters begins."""

    F: NDArray[np.float64]  # (N,) levels [1]
    y: NDArray[np.float64]  # (N,) yields [1]
    slope: NDArray[np.float64]  # (N,) of the levels over the stroke [1]
    factors: NDArray[np.float64]  # of the viscous part, where the law has one, and of the columns of the problem [1]
    left: float  # sum of squares
    stribeck: NDArray[np.float64]  # (3,) excess of break-away, logarithms of Stribeck speed and C; (0,) without [1]


@kernel
def _slider(x, levels, y, out):  # type: ignore[no-untyped-def]
    e = 0.0
    for i in range(1, x.size):
        e = within(e + x[i] - x[i - 1], -levels[i] * y, levels[i] * y)
        out[i] = e / y


def stroke_ends(problem: Problem) -> NDArray[np.float64]:
    """The ends (2,) of the stroke that the weighed samples show [1]."""
    x = problem.x[problem.weighed]
    return np.array([x.min(), x.max()])


def find_sliders(problem: Problem, law: Law) -> Elements:
    """The sliders of a record.

    A grid of yields ends where an element only just yields, at half the widest swing of the weighed samples; the record
    shows a part that yields later as a spring, and that part counts with the torque that it has reached. Where the law
    has a Stribeck curve and a lag, they are sought too, unless sliders without them leave hardly more than white noise.
    """
    declared = law.fitted
    assert isinstance(declared, Sliders)
    viscous = bool(declared.viscous) and not one_speed(problem)  # at one speed it is a part of the level
    regression = _Regression(problem, viscous, _maxwell_slip(problem))
    slopes = SLOPES if declared.by_position else (0.0,)
    flat = _counted(regression, slopes)
    left = regression.left(flat)
    if declared.one is None or np.mean(left**2) - white_noise_deviation(left) ** 2 < STRIBECK_RESIDUAL**2:
        return flat
    speeds = np.abs(np.diff(problem.x))[problem.weighed[1:]] / problem.dt
    least, most = np.log(np.quantile(speeds[speeds > 0.0], (0.05, 0.95)))
    bounds = [0.0, least - 1.0, -LOG_SEARCH_RANGE], [LARGEST, most, LOG_SEARCH_RANGE]
    found, y = flat, np.geomspace(0.005, 0.5, YIELDS) * regression.travel
    starts = [[0.2, 0.5 * (least + most), lag] for lag in (0.0, 3.0)]
    for _ in range(2):  # the second time with the yields that were found
        q = _stribeck(regression, law, y, starts, bounds)
        found = _counted(regression._replace(slider=_weakening(problem, law, q)), slopes)._replace(stribeck=q)
        y, starts = found.y, [q.tolist()]
    count = left.size / samples_per_count(left)
    gain = count * math.log(flat.left / found.left) - (2 * (found.y.size - flat.y.size) + q.size) * math.log(count)
    return found if gain > 0.0 else flat


class _Regression(NamedTuple):
    """Sliders as a regression at the weighed samples."""

    problem: Problem
    viscous: bool
    slider: Slider

    @property
    def T(self) -> NDArray[np.float64]:
        return self.problem.torque[self._rows]

    @property
    def travel(self) -> float:
        low, high = stroke_ends(self.problem)
        return float(high - low)

    @property
    def _rows(self) -> NDArray[np.int64]:
        rows = np.flatnonzero(self.problem.weighed)
        return rows[:: max(rows.size // COUNTING_SAMPLES, 1)]

    def columns(self, y: NDArray, slope: NDArray) -> NDArray[np.float64]:
        """Torques (n, N) of unit sliders."""
        rows = self._rows
        found = [self.slider(*each)[rows] for each in zip(y.tolist(), slope.tolist())]
        return np.column_stack(found) if found else np.zeros((rows.size, 0))

    def others(self) -> NDArray[np.float64]:
        """The viscous part, where the law has one, then the columns of the problem."""
        speed = np.diff(self.problem.x, prepend=self.problem.x[0]) / self.problem.dt
        both = np.column_stack([speed, self.problem.columns]) if self.viscous else self.problem.columns
        return both[self._rows]

    def factors(self, A: NDArray) -> NDArray[np.float64]:
        """Levels and other factors that leave least; only those of the columns of the problem may be negative (F32)."""
        # The same sum of squares in as many rows as columns
        R = np.asarray(np.linalg.qr(np.column_stack([A, self.T]), mode="r"))
        free = np.arange(A.shape[1]) >= A.shape[1] - self.problem.columns.shape[1]
        return not_negative_factors(R[:, :-1], R[:, -1], free)  # (F32)

    def solved(self, y: NDArray, slope: NDArray) -> Elements:
        """Levels and factors that leave least, of sliders with these yields and slopes."""
        A = np.column_stack([self.columns(y, slope), self.others()])
        p = self.factors(A)
        used = np.flatnonzero(p[: y.size])
        return Elements(p[used], y[used], slope[used], p[y.size :], float(np.sum((A @ p - self.T) ** 2)), np.empty(0))

    def left(self, found: Elements) -> NDArray[np.float64]:
        """What sliders leave (n,)."""
        return np.asarray(self.columns(found.y, found.slope) @ found.F + self.others() @ found.factors - self.T)

    def refined(self, found: Elements, sloped: bool) -> Elements:
        """The sliders with yields, and slopes where they have them, off the grid."""
        from scipy.optimize import least_squares  # imported here, because that takes longer than the import of all laws

        N, others = found.y.size, self.others()
        least, most = LEAST_YIELD * 0.5 * self.travel, 0.5 * self.travel

        def parts(q: NDArray) -> tuple[NDArray, NDArray]:
            return np.exp(q[:N]), q[N:] if sloped else np.zeros(N)

        def left(q: NDArray) -> NDArray[np.float64]:
            A = np.column_stack([self.columns(*parts(q)), others])
            return np.asarray(A @ self.factors(A) - self.T)

        def slopes(q: NDArray) -> NDArray[np.float64]:
            here = self.columns(*parts(q))
            A = np.column_stack([here, others])
            F = self.factors(A)
            steps = np.where(
                q < 0.5, DERIVATIVE_STEP, -DERIVATIVE_STEP
            )  # of slopes away from their ends; of yields either will do
            there = [self.columns(*parts(q + np.r_[steps[:N], 0.0 * steps[N:]]))]
            there += [self.columns(*parts(q + np.r_[0.0 * steps[:N], steps[N:]]))] if sloped else []
            D = np.column_stack([(each - here) * F[:N] for each in there]) / steps
            Q, R = np.linalg.qr(A[:, np.append(F[:N] > 0.0, np.ones(others.shape[1], bool))])
            Q = Q[:, np.abs(np.diag(R)) > 1e-9 * np.max(np.abs(R), initial=0.0)]
            return D - Q @ (Q.T @ D)

        q = np.log(np.clip(found.y, 1.001 * least, 0.999 * most))
        low, high = np.full(N, math.log(least)), np.full(N, math.log(most))
        if sloped:
            q = np.append(q, np.clip(found.slope, -0.999, 0.999))
            low, high = np.append(low, np.full(N, -1.0)), np.append(high, np.ones(N))
        end = least_squares(left, q, slopes, (low, high), max_nfev=ROUNDS, xtol=1e-6, ftol=1e-9)
        return self.solved(*parts(end.x))


def _maxwell_slip(problem: Problem) -> Slider:
    low, high = stroke_ends(problem)
    u = np.clip((2.0 * problem.x - low - high) / (high - low), -1.0, 1.0)

    def torque_of(y: float, slope: float) -> NDArray[np.float64]:
        out = np.zeros(problem.x.size)
        _slider(problem.x, problem.levels * (1.0 + slope * u), y, out)
        return out

    return torque_of


def _weakening(problem: Problem, law: Law, q: NDArray) -> Slider:
    """A slider of level 1, by the relative excess of break-away and the logarithms of Stribeck speed and C."""
    v_s, C = np.exp(q[1:]).tolist()

    def torque_of(y: float, slope: float) -> NDArray[np.float64]:
        return problem.response(law, law.fitted.one(y, float(q[0]), v_s, C))  # type: ignore[union-attr, misc]

    return torque_of


def _stribeck(
    regression: _Regression, law: Law, y: NDArray, starts: list[list[float]], bounds: Any
) -> NDArray[np.float64]:
    """Excess of break-away and logarithms of Stribeck speed and C with which sliders of these yields leave least."""
    from scipy.optimize import least_squares  # imported here, as above

    def left(q: NDArray) -> NDArray[np.float64]:
        each = regression._replace(slider=_weakening(regression.problem, law, q))
        return each.left(each.solved(y, np.zeros(y.size)))

    ends = [
        least_squares(left, np.clip(each, *bounds), bounds=bounds, max_nfev=TRIES, diff_step=1e-3) for each in starts
    ]
    return np.asarray(min(ends, key=lambda end: float(end.cost)).x)


def _counted(regression: _Regression, slopes: tuple[float, ...]) -> Elements:
    """As many sliders as Bayes' criterion asks for, from those of the grid."""
    sloped = len(slopes) > 1
    grid = np.geomspace(LEAST_YIELD, 1.0, GRID) * 0.5 * regression.travel
    found = regression.solved(np.repeat(grid, len(slopes)), np.resize(slopes, GRID * len(slopes)))
    if not found.y.size:
        return found
    best = regression.refined(found, sloped)
    left = regression.left(best)
    count = left.size / samples_per_count(left)

    def criterion(each: Elements) -> float:
        return count * math.log(max(each.left, 1e-24 * left.size)) + (2 + sloped) * each.y.size * math.log(count)

    most = HARDLY * best.left
    while best.y.size > 1:
        fewer = [_merged(best, i) for i in range(best.y.size - 1)]
        fewer += [_without_slider(best, i) for i in range(best.y.size)]
        tried = [regression.solved(each.y, each.slope) for each in fewer]
        least = regression.refined(min(tried, key=lambda each: each.left), sloped)
        if best.y.size <= MAX_ELEMENTS and (criterion(least) > criterion(best) or least.left > most):
            break
        best = least
    return best


def _merged(found: Elements, i: int) -> Elements:
    """Sliders of which two neighbours are one, with the stiffness and the level of both."""
    group = np.arange(found.y.size) - (np.arange(found.y.size) > i)
    F, k = (np.bincount(group, each).astype(float) for each in (found.F, found.F / found.y))
    return found._replace(F=F, y=F / k, slope=np.bincount(group, found.F * found.slope) / F)


def _without_slider(found: Elements, i: int) -> Elements:
    return found._replace(F=np.delete(found.F, i), y=np.delete(found.y, i), slope=np.delete(found.slope, i))


def yields_late(problem: Problem, F: NDArray, y: NDArray) -> bool:
    """Whether a slider that matters yields at the end of the search only, so that its level may be larger."""
    return bool(np.any((2.0 * y > 0.99 * np.ptp(stroke_ends(problem))) & (F > MATTERS * np.sum(F))))


def at_ends(problem: Problem, F: NDArray, y: NDArray) -> list[str]:
    """What is told of sliders that yield at an end of the search, in whole sentences."""
    texts = []
    if 2.0 * y[np.argmax(F)] < 1.01 * LEAST_YIELD * np.ptp(stroke_ends(problem)):
        end = "the largest slider has the least yield of the search"
        texts.append(f"{end}: it may yield earlier; sample faster, or move slower")
    if yields_late(problem, F, y):
        end = "a slider has the largest yield of the search"
        texts.append(f"{end}: it may yield later, and F_c is a lower bound; record longer strokes")
    return texts
