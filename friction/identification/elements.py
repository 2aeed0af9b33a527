"""Sliders in parallel from a record, by non-negative least squares on a grid of yields (F32)."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.identification.determined import FLOOR, WIDEST, Estimate, half_widths
from steer_env.friction.identification.problem import Problem
from steer_env.friction.law import Law, Sliders
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.virgin_curve import MAX_ELEMENTS

GRIDS = (4, 8, 16, 32, 64)  # numbers of yields that are compared on held-out samples
LEAST = 1e-3  # of those yields, over half the travel [1]
JUDGED = 1.0 / 3.0  # of the weighed samples, the last ones [1]
CONSTANT = (0.0,)  # slopes of the levels of sliders: none depends on the position [1]
SLOPES = (1.0, 0.5, 0.0, -0.5, -1.0)  # of sets that may; at 1 and -1 the level is zero at one end of the stroke [1]
YIELD_STEP = 1e-3  # of the logarithm of a yield, for derivatives by it [1]
ALIKE = 1.02  # of the least held-out residual: grids that leave no more widen the intervals [1]

# Of the search for the Stribeck curve and the lag of sliders that have them:
YIELDS = 8  # on which it begins
TRIES = 20  # steps
LARGEST = 4.0  # relative excess of break-away; assumed [1]
REACH = 6.0  # of the logarithms of Stribeck speed and C about the record's own scales [1]
SMALL = 0.01  # RMS that sliders without a Stribeck effect leave, of the level, which calls for none [1]
WORTH = 0.9  # of the sum of squares without a Stribeck effect, that one must leave less than [1]


Slider = Callable[[float], NDArray[np.float64]]  # yield -> torque (T,) of an element of unit level [1]


class Elements(NamedTuple):
    """What a record tells of sliders in parallel."""

    y: NDArray[np.float64]  # (N,) yields [rad]
    F: NDArray[np.float64]  # (N,) torques after the yield [N m]
    factors: NDArray[np.float64]  # (K,) of the problem's columns
    intervals: dict[str, tuple[Any, Any]]  # F_c, and virgin_torque at the yields [N m]
    J: NDArray[np.float64]  # (n, N + K) regressors that are used
    residual: NDArray[np.float64]  # (n,) at the weighed samples [N m]
    slope: NDArray[np.float64]  # (N,) of the yields over the stroke [1]
    sets: tuple["SliderSet", ...] = ()


class SliderSet(NamedTuple):
    """Neighbouring sliders as one: together the record tells their stiffness and yield, singly it does not."""

    sliders: int  # how many
    k: float  # sum of their stiffnesses [N m/rad]
    y: float  # torque of all after their yields, over k [rad]
    k_interval: tuple[float, float] | None  # 95 %; None where the record does not determine it [N m/rad]
    y_interval: tuple[float, float] | None  # [rad]


@kernel
def _slider(x, levels, y, out):  # type: ignore[no-untyped-def]
    e = 0.0
    for i in range(1, x.size):
        e = within(e + x[i] - x[i - 1], -levels[i] * y, levels[i] * y)
        out[i] = e / y


def fitted_sliders(problem: Problem, law: Law) -> tuple[Any, Elements]:
    """Parameters of a law of sliders in parallel from a record, and what :func:`elements_of` tells of the sliders.

    The torque of a slider is in proportion to its level, so that sliders are linear at one Stribeck curve and lag.
    Those are sought first, where the law has them, but where sliders without them leave little, or hardly more.
    """
    from scipy.optimize import least_squares  # imported here, because that takes longer than the import of all laws

    declared = law.fitted
    assert isinstance(declared, Sliders)
    if declared.by_position:
        found = elements_of(problem, slopes=SLOPES)
        return declared.made(found.F, found.y, found.slope, stroke_of(problem)), found
    found = elements_of(problem)
    if declared.one is None or np.mean(found.residual**2) < SMALL**2:
        return declared.made(found.F, found.y), found
    part = _with_speed(problem.thinned())
    T, bounds = part.torque[part.weighed], ([0.0, -REACH, -REACH], [LARGEST, REACH, REACH])

    def left(q: NDArray, y: NDArray) -> NDArray[np.float64]:
        A = regressors_of(part, y, _weakening(part, law, q))
        return A @ not_negative_factors(A, T, y.size) - T

    def sought(y: NDArray, start: ArrayLike) -> Any:
        return least_squares(left, start, bounds=bounds, max_nfev=TRIES, diff_step=1e-3, args=(y,))

    grid = np.geomspace(0.005, 0.5, YIELDS) * float(np.ptp(part.x[part.weighed]))
    best = min((sought(grid, [0.2, 0.0, lag]) for lag in (0.0, 3.0)), key=lambda end: float(end.cost))
    if 2.0 * float(best.cost) > WORTH * float(np.sum(left(np.zeros(3), grid) ** 2)):
        return declared.made(found.F, found.y), found
    viscous = _with_speed(problem)
    found = elements_of(viscous, _weakening(viscous, law, best.x))
    best = sought(found.y, np.clip(best.x, bounds[0], bounds[1]))  # once more with the yields that were found
    found = elements_of(viscous, _weakening(viscous, law, best.x))
    return declared.made(found.F, found.y), found


def _with_speed(problem: Problem) -> Problem:
    """The problem with a column for the viscous part, after the others."""
    speed = np.diff(problem.x, prepend=problem.x[0]) / problem.dt
    return problem._replace(columns=np.column_stack([problem.columns, speed]))


def _weakening(problem: Problem, law: Law, q: NDArray) -> Slider:
    """A slider of level 1, by the relative excess of break-away and the logarithms of Stribeck speed and C."""
    v_s, C = np.exp(q[1:]).tolist()

    def torque_of(y: float) -> NDArray[np.float64]:
        return problem.response(law, law.fitted.one(y, float(q[0]), v_s, C))  # type: ignore[union-attr, misc]

    return torque_of


def stroke_of(problem: Problem) -> NDArray[np.float64]:
    """The ends (2,) of the stroke that the weighed samples show [rad]."""
    x = problem.x[problem.weighed]
    return np.array([x.min(), x.max()])


def elements_of(problem: Problem, slider: Slider | None = None, slopes: Sequence[float] = CONSTANT) -> Elements:
    """Elements on the grid of yields, of several, that describes held-out samples best.

    The method needs no initial guess and has no local minimum. A grid ends where an element only just yields, at half
    the widest swing of the weighed samples; the record shows a part that yields later as a spring, and that part counts
    with the torque that it has reached. The intervals are those of ``F_c`` and of ``virgin_torque`` at each yield,
    because the record determines only the sum of the stiffnesses of neighbouring elements, not each of them. They hold
    what all grids say that describe the held-out samples nearly as well.

    Parameters
    ----------
    problem : Problem
    slider : callable, optional
        Torque (T,) of one element of unit level with a yield, along the record; by default of Maxwell slip.
    slopes : sequence of float
        Of the levels over the stroke, one set of sliders for each [1]; for Maxwell slip only.

    Source: Rizos, Fassois, Chaos 14 (2004) 431-445 (Maxwell slip as a regression); Lawson, Hanson, Solving Least
    Squares Problems, 1974.
    """
    widest = 0.5 * float(np.ptp(problem.x[problem.weighed]))
    own = dict.fromkeys((tuple(slopes), CONSTANT))  # levels that depend on nothing may describe the record as well
    grids = [np.repeat(np.geomspace(LEAST * widest, widest, n), len(each)) for each in own for n in GRIDS]
    sets = [np.tile(each, n) for each in own for n in GRIDS]
    regressors = [regressors_of(problem, y, slider, each) for y, each in zip(grids, sets)]
    T = problem.torque[problem.weighed]
    n = round((1.0 - JUDGED) * T.size)
    left = []
    for y, A in zip(grids, regressors):
        F = not_negative_factors(A[:n], T[:n], y.size)
        left.append(float(np.linalg.norm(A[n:] @ F - T[n:])))
    found = [(each, _estimate(y, A, T, m)) for each, y, A, m in zip(left, grids, regressors, sets)]
    found = [(each, elements) for each, elements in found if elements.y.size <= MAX_ELEMENTS]
    least, best = min(found, key=lambda each: each[0])
    found = [(each, elements) for each, elements in found if each <= ALIKE * least]
    bounds = [_bounds(elements, best.y, *_exchangeable(problem, elements, slider)) for _, elements in found]
    low = np.maximum(np.min([each[0] for each in bounds], axis=0), 0.0)
    high = np.max([each[1] for each in bounds], axis=0)
    intervals = {"F_c": (low[-1], high[-1]), "virgin_torque": (low, high)}
    return best._replace(intervals=intervals, sets=_sets(problem, best, slider))


def at_ends(problem: Problem, found: Elements) -> list[str]:
    """What is told where the largest slider yields at an end of the grid, in whole sentences."""
    low, high = stroke_of(problem)
    share = 2.0 * float(found.y[np.argmax(found.F)]) / float(high - low) if found.y.size else 0.1
    for end, side, remedy in (
        (LEAST, "least", "it may yield earlier; sample faster, or move slower"),
        (1.0, "largest", "it may yield later; record longer strokes"),
    ):
        if math.isclose(share, end):
            return [f"the largest slider has the {side} yield of the search, an end of the grid: {remedy}"]
    return []


def regressors_of(
    problem: Problem, y: NDArray, slider: Slider | None = None, slope: NDArray | None = None
) -> NDArray[np.float64]:
    """Torques of unit sliders with these yields, then the columns of the problem, at the weighed samples.

    ``slope`` (N,) is that of their levels over the stroke [1]; none without it.
    """
    A = np.zeros((problem.x.size, y.size + problem.columns.shape[1]))
    low, high = stroke_of(problem)
    u = np.clip((2.0 * problem.x - low - high) / (high - low), -1.0, 1.0)
    slopes = np.zeros(y.size) if slope is None else slope
    for i, (each, m) in enumerate(zip(y.tolist(), slopes.tolist())):
        if slider is None:
            out = np.zeros(problem.x.size)
            _slider(problem.x, problem.levels * (1.0 + m * u), each, out)
            A[:, i] = out
        else:
            A[:, i] = slider(each)
    A[:, y.size :] = problem.columns
    return A[problem.weighed]


def not_negative_factors(A: NDArray, T: NDArray, n: int) -> NDArray[np.float64]:
    """Least squares with the first ``n`` factors not negative (F32)."""
    from scipy.optimize import nnls  # imported here, because that takes longer than the import of all laws

    signed = np.column_stack([A, -A[:, n:], T])
    R = np.asarray(np.linalg.qr(signed, mode="r"))  # the same sum of squares in as many rows as columns
    F, _ = nnls(R[:, :-1], R[:, -1])  # (F32)
    factors = F[n : A.shape[1]] - F[A.shape[1] :]
    return np.append(F[:n], factors)


def beside(problem: Problem, estimate: Estimate, elements: Elements) -> tuple[Problem, Estimate]:
    """Problem and estimate with columns for the elements, after the others, so that all intervals allow for them (F32).

    Where the law has a level ``F_c`` of its own, the columns are those of what one element has more than the others.
    """
    size, end = elements.F.size, estimate.optimum
    A = elements.J[:, :size]
    if hasattr(estimate.parameters, "F_c"):
        A = (A - (A @ elements.F / np.sum(elements.F))[:, None])[:, 1:]
    jacobian = np.column_stack([end.jacobian, end.weight[:, None] * A])
    columns = np.zeros((problem.x.size, A.shape[1]))  # what is not weighed does not count
    columns[problem.weighed] = A
    end = end._replace(q=np.append(end.q, np.zeros(A.shape[1])), jacobian=jacobian)
    problem = problem._replace(columns=np.column_stack([problem.columns, columns]))
    return problem, estimate._replace(optimum=end)


def _estimate(y: NDArray, A: NDArray, T: NDArray, slope: NDArray) -> Elements:
    """Elements on one grid, without their intervals."""
    F = not_negative_factors(A, T, y.size)
    used, extra = np.flatnonzero(F[: y.size]), np.arange(y.size, A.shape[1])
    return Elements(y[used], F[used], F[extra], {}, A[:, np.append(used, extra)], A @ F - T, slope[used])


def _exchangeable(problem: Problem, found: Elements, slider: Slider | None) -> tuple[NDArray, NDArray]:
    """Yields and regressors of what may share the level: where it has slopes, both ends of them at each yield."""
    if not np.any(found.slope):
        return found.y, found.J
    y = np.repeat(np.unique(found.y), 2)
    return y, regressors_of(problem, y, slider, np.resize((-1.0, 1.0), y.size))


def _bounds(found: Elements, at: NDArray, y: NDArray, J: NDArray) -> tuple[NDArray, NDArray]:
    """95 % bounds of the virgin torque ``at`` displacements: of each element, the part that it has reached there.

    Their widths are those of elements with the yields ``y`` and the regressors ``J``.
    """
    shares, middle = np.minimum(at[:, None] / y, 1.0), np.minimum(at[:, None] / found.y, 1.0) @ found.F
    half = half_widths(J, found.residual, np.column_stack([shares, np.zeros((at.size, found.factors.size))]))
    return middle - half, middle + half


def _sets(problem: Problem, found: Elements, slider: Slider | None) -> tuple[SliderSet, ...]:
    """The most sets of neighbouring sliders whose stiffness and yield are determined by (F34), by the delta method.

    The covariance of (F35) is that of the torques of all sliders and of the logarithms of their yields. The intervals
    also hold what a linear step finds best with yields off the grid.
    """
    y, F, N = found.y, found.F, found.y.size
    steps = (-YIELD_STEP, YIELD_STEP)
    ends = [regressors_of(problem, y * math.exp(h), slider, found.slope)[:, :N] for h in steps]
    J = np.column_stack([found.J, F * (ends[1] - ends[0]) / (2.0 * YIELD_STEP)])
    groups = [slice(i, j) for j in range(1, N + 1) for i in range(j)]
    rows = np.zeros((2, len(groups), J.shape[1]))  # derivatives of the logarithms of k and y
    for row_k, row_y, part in zip(*rows, groups):
        k = F[part] / y[part]
        yields = np.arange(J.shape[1] - N, J.shape[1])[part]
        row_k[part], row_k[yields] = 1.0 / y[part] / k.sum(), -k / k.sum()
        row_y[:] = -row_k
        row_y[part] += 1.0 / F[part].sum()
    judged = half_widths(J, found.residual, rows.reshape(-1, J.shape[1]), FLOOR).reshape(2, -1) <= WIDEST
    step = np.linalg.lstsq(J, -found.residual, rcond=1e-6)[0]  # to yields off the grid
    change = rows @ step
    half = half_widths(J, found.residual + J @ step, rows.reshape(-1, J.shape[1])).reshape(2, -1)
    best: list[tuple[int, int, list[int]]] = [(0, 0, [])]  # of the first sliders: sets determined, less others; which
    for j in range(1, N + 1):
        last = [(m, part.start) for m, part in enumerate(groups) if part.stop == j]
        told = [(best[i], m, bool(judged[:, m].all())) for m, i in last]
        best.append(max((n + sure, less - (not sure), [*which, m]) for (n, less, which), m, sure in told))
    result = []
    for m in best[N][2]:
        k, level = float(np.sum((F / y)[groups[m]])), float(np.sum(F[groups[m]]))
        both = [
            (value * math.exp(min(off, 0.0) - h), value * math.exp(max(off, 0.0) + h)) if sure else None
            for value, off, h, sure in zip((k, level / k), change[:, m].tolist(), half[:, m].tolist(), judged[:, m])
        ]
        result.append(SliderSet(groups[m].stop - groups[m].start, k, level / k, both[0], both[1]))
    return tuple(result)
