"""Hand torque of a drive with every friction law in turn, fitted to its first part and judged on the rest.

All coefficients of (H1) but two are linear: for the lateral acceleration a_c and the pre-sliding distance x_c, values
of a grid are tried, and the others follow from least squares with bounds. Least squares needs only the sums of products
in blocks of the drive, from which cross-validation and bootstrap are made without reading the drive again.

The shape of the torque over lateral acceleration is chosen by two cross-validations of the fitted part: with blocks of
time left out, and with the largest lateral accelerations left out, where a shape that does not hold beyond what was
fitted shows.
"""

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import nnls

from steer_env.friction import response
from steer_env.friction.law import LAWS, available
from steer_env.friction.numerics.check import number
from steer_env.hand_torque.drive import FEWEST, RATE, Drive, prepared
from steer_env.hand_torque.model import (
    FREE,
    MAPS,
    Array,
    Model,
    Prior,
    columns,
    has_distance,
    on_samples,
    stretched,
)
from steer_env.recording.recording import Recording

HELD_OUT = 0.35  # share of a drive, its last part, that judges [1]
BLOCK = 5.0  # of cross-validation and bootstrap; longer than a correction, assumed [s]
NO_GROWTH = np.nan, (np.nan, np.nan)  # of a drive without a dry law
DRAWS = 400  # of the bootstrap
A_C = (0.05, 0.1, 0.2, 0.4, 0.8)  # grid of a_c [m/s2]
X_C = tuple(np.radians([0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.45, 0.7, 1.0, 1.5, 2.5]))  # grid of x_c [rad]
GROWTHS = (0.0, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0, 5.0)  # grid of the level's growth by load [s2/m]
INNER = (0.5, 0.7, 0.85)  # shares of the fitted samples, those of least lateral acceleration, that predict the others
REFERENCE = "dahl"  # law with which the shape is chosen; assumed: the choice depends little on it
NONE, VISCOUS, DRY = "none", "viscous", "dry"
LEVEL = 0.95  # of the intervals
SYSTEMATIC = 0.1  # of a level: what its interval adds for smoothing, as drives of known friction show [1]
MOST_LOST = 1.5  # factor for what smoothing takes from a level, at most; assumed [1]
ALIKE = 0.02  # by which a law may leave more than the best and is not told apart; assumed [1]


class Sums(NamedTuple):
    """Sums of products of the terms of (H1) in blocks of a drive."""

    G: Array  # (B, m, m) of term and term [product of units]
    h: Array  # (B, m) of term and torque [product of units]
    s: Array  # (B,) of the torque's square [N2 m2]
    n: Array  # (B,) number of samples [1]


class Candidate(NamedTuple):
    """Terms of (H1) for one pair of the grid."""

    names: tuple[str, ...]
    a_c: float  # [m/s2]
    x_c: float  # pre-sliding distance; NaN without one [rad]
    growth: float  # of the level by the size of the lateral acceleration, relative [s2/m]
    sums: Sums


class Fitted(NamedTuple):
    """One row of the answer: without friction, with damping, or with damping and a dry law."""

    name: str  # "none", "viscous" or a law
    model: Model  # fitted to the whole drive
    judged: Model  # fitted to the part that does not judge
    level: float  # saturated friction of the whole drive, with what smoothing took away; 0 without a dry law [N m]
    level_interval: tuple[float, float]  # 95 %, from blocks drawn anew [N m]
    x_c: float  # pre-sliding distance with the torsion bar's twist; NaN without one [rad]
    x_c_interval: tuple[float, float]  # 95 % [rad]
    residual: float  # root mean square that is left of the judging part [N m]
    interval: tuple[float, float]  # 95 % [N m]
    adds: float  # by how much it leaves less than damping alone on the judging part [N m]
    adds_interval: tuple[float, float]  # 95 % [N m]
    fitted: float  # root mean square that is left of the fitted part [N m]
    crossed: float  # of the whole drive, each block predicted from the others [N m]
    blocks: Array  # (B,) sum of squares of these predictions by block [N2 m2]


class Shape(NamedTuple):
    """What the cross-validations of the fitted part leave with one shape."""

    name: str
    by_time: float  # blocks of time left out, root mean square [N m]
    beyond: float  # largest lateral accelerations left out, root mean square [N m]


class Identified(NamedTuple):
    """What a drive says of the hand torque."""

    drive: Drive
    first: int  # first sample that judges
    shape: str  # of ``MAPS``, chosen by the fitted part
    shapes: tuple[Shape, ...]  # all that were tried, the best first
    rows: tuple[Fitted, ...]  # that leaves least first
    chosen: str  # "none", "viscous" or "dry"
    equals: tuple[str, ...]  # dry laws that the judging part cannot tell from the best of them
    apart: float  # largest root-mean-square difference between predictions of dry laws in ``equals`` [N m]
    offset: float  # of the torque, T_0 of the best row [N m]
    growth: float  # of the level of the best dry law by the size of the lateral acceleration, not negative [N m s2/m]
    growth_interval: tuple[float, float]  # 95 %, from blocks drawn anew; NaN without a dry law [N m s2/m]

    def row(self, name: str) -> Fitted:
        """A row by its name; ValueError for a name that is none."""
        for each in self.rows:
            if each.name == name:
                return each
        raise ValueError(f"no row {name!r}: there are {', '.join(row.name for row in self.rows)}")

    @property
    def dry(self) -> tuple[Fitted, ...]:
        """The dry laws, that leaves least first."""
        return tuple(row for row in self.rows if row.name not in (NONE, VISCOUS))

    @property
    def best(self) -> Fitted:
        """The dry law that leaves least of the fitted part, or damping where no law was fitted.

        The judging part does not choose it, so that what the law leaves there is a prediction.
        """
        return min(self.dry, key=lambda row: row.fitted, default=self.row(VISCOUS))


def identify(
    recording: Recording | Drive,
    *,
    laws: Sequence[str] | None = None,
    held_out: float = HELD_OUT,
    prior: Prior | None = None,
    seed: int = 0,
    notify: Callable[[float, str], None] = lambda part, text: None,
) -> Identified:
    """Identify the hand torque (H1) of a free drive, with every friction law in turn.

    Parameters
    ----------
    recording : Recording or Drive
        With ``handwheel_angle`` [rad], ``torsion_bar_torque`` [N m] and ``vehicle_speed`` [m/s], left positive.
    laws : sequence of str, optional
        Dry laws to fit; by default all that are registered.
    held_out : float
        Share of the drive, its last part, that judges and is not fitted, 0.1 to 0.6 [1].
    prior : Prior, optional
        Ratio, wheelbase and understeer; by default those of the recording's meta, else assumed.
    seed : int
        Of the draws of the bootstrap.
    notify : callable
        Told the part that is done and what comes next.

    Raises
    ------
    ValueError
        As :func:`steer_env.hand_torque.prepared`, and for an unknown law or a share out of range.
    """
    drive = recording if isinstance(recording, Drive) else prepared(recording, prior)
    share = number("held_out", held_out, minimum=0.1, maximum=0.6)
    dry = [law for law in (available() if laws is None else laws) if law != VISCOUS]
    for law in dry:
        LAWS[law]  # refuses an unknown one with those that are known
    if drive.turns < FEWEST:
        dry = []
    first = drive.time.size - round(share * drive.time.size)
    notify(0.0, "shape of the torque")
    shapes = _shapes(drive, first, REFERENCE if dry else None)
    rows, names = [], [NONE, VISCOUS, *dry]
    for i, name in enumerate(names):
        notify((i + 1) / (len(names) + 1), name)
        rows.append(_row(drive, first, shapes[0].name, name, np.random.default_rng(seed)))
    return _answer(drive, first, shapes, rows, seed)


def at_ends(found: Identified) -> tuple[str, ...]:
    """What is told of pre-sliding distances, or their intervals, that reach an end of the grid, in whole sentences."""
    texts = []
    for end, side in ((X_C[0], "least"), (X_C[-1], "largest")):
        best = [row.name for row in found.dry if row.x_c == end]
        reach = [row.name for row in found.dry if end in row.x_c_interval and row.name not in best]
        grid = f"the {side} of the grid, {np.degrees(end):.2g} deg: it may lie beyond"
        texts += [f"the best pre-sliding distance of {', '.join(best)} is {grid}"] if best else []
        texts += [f"the interval of the pre-sliding distance of {', '.join(reach)} reaches {grid}"] if reach else []
    return tuple(texts)


def _names(shape: str, name: str) -> tuple[str, ...]:
    """Terms of (H1) of a row; the inertia is that of all rows, and "none" has no damping."""
    return ("T_0", *MAPS[shape], *(("I",) if name == NONE else ("C", "I")), *(("level",) if _is_law(name) else ()))


def _is_law(name: str | None) -> bool:
    return name not in (NONE, VISCOUS, None)


def blocks(samples: int) -> NDArray[np.int64]:
    """Block of each sample (T,)."""
    size = round(BLOCK * RATE)
    count = max(round(samples / size), 1)
    return np.minimum(np.arange(samples) // size, count - 1)


def sums_of(X: Array, torque: Array, weight: Array, block: NDArray[np.int64]) -> Sums:
    """Sums by block of the products of terms (T, m) and torque (T,), of the samples whose weight is above zero."""
    count, used = int(block.max()) + 1, weight > 0.0
    parts = [(X[inside], torque[inside]) for inside in (used & (block == b) for b in range(count))]
    return Sums(
        np.array([x.T @ x for x, _ in parts]),
        np.array([x.T @ y for x, y in parts]),
        np.array([y @ y for _, y in parts]),
        np.array([float(y.size) for _, y in parts]),
    )


def _candidates(
    drive: Drive,
    shape: str,
    name: str,
    block: NDArray[np.int64],
    grid: Sequence[float] | None = None,
    distances: Sequence[float] = X_C,
    growths: Sequence[float] = (0.0,),
) -> list[Candidate]:
    """Terms and sums of every point of the grid."""
    angle, dt, a = drive.angle, drive.dt, drive.lateral_acceleration
    names = _names(shape, name)
    others = tuple(each for each in names if each != "level")
    stretches = _is_law(name) and has_distance(name)
    pairs, units = list(product(distances if stretches else distances[:1], growths)), [np.zeros((a.size, 0))]
    if _is_law(name):
        units = [response(stretched(name, 1.0, x), angle, dt, 1.0 + c * np.abs(a))[:, None] for x, c in pairs]  # (F11)
    found = []
    for a_c in (A_C if "T_c" in names else A_C[:1]) if grid is None else grid:
        X = columns(others, a, a_c, angle, dt)
        for (x, c), unit in zip(pairs, units):
            sums = sums_of(np.column_stack([X, unit]), drive.torque, drive.weight, block)
            found.append(Candidate(names, a_c, x if stretches else np.nan, c, sums))
    return found


def _solved(names: Sequence[str], G: Array, h: Array) -> Array:
    """Coefficients (m,) of least squares with the bounds of ``FREE``, from sums of products."""
    free = [i for i, name in enumerate(names) if name in FREE]
    size = np.sqrt(np.maximum(np.diag(G), 1e-12))
    A = G / np.outer(size, size)
    # A free coefficient is the difference of two that are not negative.
    pick = np.concatenate([np.eye(len(names)), -np.eye(len(names))[:, free]], axis=1)
    values, vectors = np.linalg.eigh(A)
    root = np.sqrt(np.maximum(values, 1e-12))
    R = root[:, None] * vectors.T  # R'R = A
    y = (vectors.T @ (h / size)) / root
    return np.asarray(pick @ nnls(np.asarray(R @ pick), y)[0]) / size


def _left(sums: Sums, p: Array, blocks: Any) -> Array:
    """Sum of squares that coefficients leave in blocks [N2 m2]."""
    return sums.s[blocks] - 2.0 * sums.h[blocks] @ p + np.einsum("bij,i,j->b", sums.G[blocks], p, p)


def _fit(candidates: Sequence[Candidate], times: Array) -> tuple[Candidate, Array]:
    """The pair of the grid that leaves least, and its coefficients; ``times`` (B,) says how often a block counts."""
    best = None
    everything = np.arange(times.size)
    for each in candidates:
        p = _solved(each.names, np.tensordot(times, each.sums.G, 1), times @ each.sums.h)
        left = float(times @ _left(each.sums, p, everything))
        if best is None or left < best[0]:
            best = left, each, p
    assert best is not None
    return best[1], best[2]


def _crossed(candidates: Sequence[Candidate], folds: Sequence[Any]) -> tuple[Array, Array]:
    """Sum of squares (B,) that each block leaves when those of its fold are not fitted, and its samples."""
    count = candidates[0].sums.n
    left, used = np.zeros_like(count), np.zeros_like(count)
    for fold in folds:
        times = np.ones_like(count)
        times[fold] = 0.0
        chosen, p = _fit(candidates, times)
        left[fold] = _left(chosen.sums, p, fold)
        used[fold] = count[fold]
    return left, used


def _shapes(drive: Drive, first: int, law: str | None) -> tuple[Shape, ...]:
    """All shapes, that which the two cross-validations of the fitted part leave least with first."""
    part = drive._replace(weight=np.where(np.arange(drive.time.size) < first, drive.weight, 0.0))
    name = law or VISCOUS
    size = np.abs(part.lateral_acceleration)
    inner = [np.quantile(size[part.weight > 0.0], share) for share in INNER]
    found = []
    for shape in MAPS:
        block = np.minimum(blocks(drive.time.size), blocks(first).max())
        candidates = _thinned(_candidates(part, shape, name, block))
        left, used = _crossed(candidates, np.array_split(np.arange(int(block.max()) + 1), 8))
        beyond = []
        for limit in inner:
            outside = _thinned(_candidates(part, shape, name, (size > limit).astype(int)))
            there, samples = _crossed(outside, [np.array([1])])
            beyond.append(there[1] / samples[1])
        found.append(Shape(shape, float(np.sqrt(left.sum() / used.sum())), float(np.sqrt(np.mean(beyond)))))
    return tuple(sorted(found, key=lambda each: each.by_time**2 + each.beyond**2))


def _thinned(candidates: list[Candidate]) -> list[Candidate]:
    """Every third pre-sliding distance, which is enough to choose a shape."""
    kept = sorted({each.x_c for each in candidates if np.isfinite(each.x_c)})[1::3]
    return [each for each in candidates if not kept or each.x_c in kept]


def _model(drive: Drive, shape: str, name: str, chosen: Candidate, p: Array) -> Model:
    terms = dict(zip(chosen.names, map(float, p)))
    level = terms.pop("level", 0.0)
    distance = chosen.x_c if np.isfinite(chosen.x_c) else X_C[0]
    friction = stretched(name, level, distance) if level > 0.0 else None
    return Model(shape, chosen.a_c, terms, friction, drive.prior)


def _row(drive: Drive, first: int, shape: str, name: str, rng: np.random.Generator) -> Fitted:
    """Fit a row to the whole drive and to the part that does not judge; intervals of level and distance."""
    block = blocks(drive.time.size)
    candidates = _candidates(drive, shape, name, block)
    count = int(block.max()) + 1
    chosen, p = _fit(candidates, np.ones(count))
    left, used = _crossed(candidates, np.array_split(np.arange(count), 10))
    level, ends, distances = 0.0, (0.0, 0.0), (np.nan, np.nan)
    if _is_law(name):
        level = float(p[-1])
        draws = _drawn([each for each in candidates if each.a_c == chosen.a_c], rng)
        factor = _lost(drive, shape, name, chosen, p)
        level, ends = _estimate(level, np.array([q[-1] for _, q in draws]), _counted(candidates).size, factor)
        if np.isfinite(chosen.x_c):
            distances = interval_of(np.array([each.x_c for each, _ in draws]))
    early = drive._replace(weight=np.where(np.arange(drive.time.size) < first, drive.weight, 0.0))
    judged = _model(drive, shape, name, *_fit(_candidates(early, shape, name, block), np.ones(count)))
    fitted = early.weight > 0.0
    error = on_samples(judged, drive.angle, drive.speed, drive.dt) - drive.torque
    return Fitted(
        name, _model(drive, shape, name, chosen, p), judged, level, ends, chosen.x_c, distances,
        residual=np.nan, interval=(np.nan, np.nan), adds=0.0, adds_interval=(0.0, 0.0),
        fitted=float(np.sqrt(np.mean(error[fitted] ** 2))), crossed=float(np.sqrt(left.sum() / used.sum())),
        blocks=left,
    )  # fmt: skip


def _counted(candidates: Sequence[Candidate]) -> NDArray[np.int64]:
    """Blocks that hold samples; those within a gap hold none."""
    return np.flatnonzero(candidates[0].sums.n)


def _drawn(candidates: Sequence[Candidate], rng: np.random.Generator) -> list[tuple[Candidate, Array]]:
    """Fits to blocks drawn anew."""
    used = _counted(candidates)
    times = np.zeros((DRAWS, candidates[0].sums.n.size))
    times[:, used] = redrawn(used.size, rng)
    return [_fit(candidates, each) for each in times]


def _estimate(value: float, draws: Array, count: int, factor: float) -> tuple[float, tuple[float, float]]:
    """A level that is not negative, with what smoothing took from it (``factor``), and its 95 % interval.

    The draws are of ``count`` blocks, and few blocks ask for a wider interval than that of their draws.
    """
    wide = widened(count, count - 1)
    low, high = interval_of(draws)
    rest = SYSTEMATIC * value
    below, above = np.hypot(wide * (value - low), rest), np.hypot(wide * (high - value), rest)
    return factor * value, (float(factor * max(value - below, 0.0)), float(factor * (value + above)))


def _growth(drive: Drive, shape: str, row: Fitted, seed: int) -> tuple[float, tuple[float, float]]:
    """Growth of the level with the load as in (F11), and its interval; the size of a stands for the load."""
    block, place = blocks(drive.time.size), X_C.index(row.x_c) if np.isfinite(row.x_c) else 0
    near = X_C[max(place - 1, 0) : place + 2]
    candidates = _candidates(drive, shape, row.name, block, (row.model.a_c,), near, GROWTHS)
    chosen, p = _fit(candidates, np.ones(candidates[0].sums.n.size))
    draws = _drawn(candidates, np.random.default_rng(seed))
    value = chosen.growth * float(p[-1])
    factor = _lost(drive, shape, row.name, chosen, p)
    grown = np.array([each.growth * q[-1] for each, q in draws])
    return _estimate(value, grown, _counted(candidates).size, factor)


def _lost(drive: Drive, shape: str, name: str, chosen: Candidate, p: Array) -> float:
    """Factor on a level for what the low-pass of the angle takes away [1].

    The torque of the fitted model over the angle with little smoothing is fitted again over the angle of the fit.
    """
    model = _model(drive, shape, name, chosen, p)
    if model.friction is None:
        return 1.0
    again = drive._replace(torque=on_samples(model, drive.fine_angle, drive.speed, drive.dt))
    block = np.zeros(drive.time.size, int)
    distance = (chosen.x_c if np.isfinite(chosen.x_c) else X_C[0],)
    same = _candidates(again, shape, name, block, (chosen.a_c,), distance)
    found = float(_fit(same, np.ones(1))[1][-1])
    return float(np.clip(p[-1] / found, 1.0, MOST_LOST)) if found > 0.0 else 1.0


def redrawn(count: int, seed: int | np.random.Generator, draws: int = DRAWS) -> Array:
    """How often each of ``count`` blocks counts when as many are drawn anew, (draws, count)."""
    return np.random.default_rng(seed).multinomial(count, np.full(count, 1.0 / count), draws).astype(float)


def widened(count: int, degrees: int) -> float:
    """Factor on the interval of draws of few blocks, with so many degrees of freedom left, by Student's t [1]."""
    tail = 0.5 + 0.5 * LEVEL
    return float(np.sqrt(count / degrees) * stats.t.ppf(tail, degrees) / stats.norm.ppf(tail))


def interval_of(values: Array) -> tuple[float, float]:
    """Ends of the interval that holds ``LEVEL`` of the values."""
    low, high = np.quantile(values, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
    return float(low), float(high)


def _answer(drive: Drive, first: int, shapes: tuple[Shape, ...], rows: list[Fitted], seed: int) -> Identified:
    """The rows judged on the same draws of blocks of the judging part."""
    used = np.flatnonzero((np.arange(drive.time.size) >= first) & (drive.weight > 0.0))
    if used.size < 2.0 * BLOCK * RATE:
        raise ValueError(
            f"the judging part has {used.size / RATE:.2g} s of use: raise held_out, or take a longer drive"
        )
    predicted = {row.name: on_samples(row.judged, drive.angle, drive.speed, drive.dt) for row in rows}
    block = blocks(used.size)
    count = int(block.max()) + 1
    squares = {
        name: np.bincount(block, (torque[used] - drive.torque[used]) ** 2, count) for name, torque in predicted.items()
    }
    size = np.bincount(block, minlength=count).astype(float)
    times = redrawn(count, seed)
    drawn = {name: np.sqrt(times @ each / (times @ size)) for name, each in squares.items()}
    left = {name: float(np.sqrt(each.sum() / size.sum())) for name, each in squares.items()}
    judged = [
        row._replace(
            residual=left[row.name],
            interval=interval_of(drawn[row.name]),
            adds=left[VISCOUS] - left[row.name],
            adds_interval=interval_of(drawn[VISCOUS] - drawn[row.name]),
        )
        for row in sorted(rows, key=lambda row: left[row.name])
    ]
    dry = [row.name for row in judged if row.name not in (NONE, VISCOUS)]
    equals = [
        name
        for name in dry
        if left[name] <= (1.0 + ALIKE) * left[dry[0]] or interval_of(drawn[name] - drawn[dry[0]])[0] <= 0.0
    ]
    apart = max(
        (float(np.sqrt(np.mean((predicted[a] - predicted[b])[used] ** 2))) for a in equals for b in equals), default=0.0
    )
    found = Identified(drive, first, shapes[0].name, shapes, tuple(judged), NONE, tuple(equals), apart, 0.0, *NO_GROWTH)
    growth, interval = _growth(drive, found.shape, found.best, seed) if dry else NO_GROWTH
    offset = found.best.model.terms["T_0"]
    return found._replace(chosen=_chosen(found), offset=offset, growth=growth, growth_interval=interval)


def _chosen(found: Identified) -> str:
    """The richest of none, viscous and dry that beats the one before it, by blocks predicted from the others.

    It beats it where the 95 % interval of the sum of squares that it saves, from blocks drawn anew, is above zero, and
    so is that of its level.
    """
    chosen = NONE
    kinds = [(VISCOUS, found.row(VISCOUS)), *((DRY, row) for row in sorted(found.dry, key=lambda row: row.crossed)[:1])]
    for kind, row in kinds:
        saved = (found.row(NONE) if chosen == NONE else found.row(VISCOUS)).blocks - row.blocks
        times = redrawn(saved.size, 0, 4 * DRAWS)
        if interval_of(times @ saved)[0] > 0.0 and (kind == VISCOUS or row.level_interval[0] > 0.0):
            chosen = kind
    return chosen
