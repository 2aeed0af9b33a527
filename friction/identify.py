"""Parameters of a friction law from a measured quasi-static record: ``fit`` (F12)."""

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.fit_intervals import half_widths
from steer_env.friction.law import law_of, make
from steer_env.friction.numerics.check import numbers, positive
from steer_env.friction.response import response

BAND = 0.02  # of the range of x [1]: the search for reversals takes a smaller swing as noise; it still drives the law
FLAT = 0.02  # rise over the last quarter of a saturated branch, of its whole rise [1]
DETOUR = 0.02  # path beyond that of the branches [1]; noise adds as much to the saturated torque of a bristle
LEAST = 20  # samples to weigh
RANGE = np.log(1e4)  # of a parameter about its start

Bound = float | NDArray[np.float64]  # an array for a curve


class Fit(NamedTuple):
    """What :func:`fit` found.

    The record is ``steer_env.friction.response(parameters, x, dt) + offset`` and a residual.
    """

    law: str
    parameters: Any  # as from friction.make
    intervals: dict[str, tuple[Bound, Bound]]  # name -> (low, high), 95 %, in the parameter's unit
    offset: float  # constant part of the measured torque [N m]
    residual: float  # RMS over the weighed samples [N m]
    warnings: tuple[str, ...]


class _Branches(NamedTuple):
    """A record as its branches from reversal to reversal; the first one begins at the start of motion."""

    turns: list[int]  # samples that bound the branches
    ways: list[NDArray]  # distances from the start of each branch [rad]
    rises: list[NDArray]  # torques above the one at the start of each branch, positive against the motion [N m]
    swing: float  # width of the torque's plateau [N m]
    saturated: list[bool]  # whether each branch ends saturated
    first: int  # the first branch to be weighed


def fit(x: ArrayLike, torque: ArrayLike, law: str = "lugre", *, dt: float) -> Fit:
    """Identify a law from displacement and torque, recorded slowly, over one reversal or any number of loops.

    The memory at the start is unknown. The samples before the first reversal from saturation (before the first reversal
    at all, if none is) therefore drive the law but are not weighed. A constant offset is estimated too.

    Parameters
    ----------
    x : (T,) array_like
        Displacement [rad].
    torque : (T,) array_like
        Torque that resists positive motion [N m].
    law : str
        Name of a law that says in ``friction.register`` what such a record determines.
    dt : float
        Time between samples [s].

    Returns
    -------
    Fit
        The intervals cover noise of the torque, not a law that does not fit. That of ``F_c`` is open above where the
        weighed torque never saturates; those of Masing are of ``F_c`` and of the ``virgin_torque`` at its yields.

    Raises
    ------
    ValueError
        For an unknown law or one that determines nothing, values that are not finite, arrays of unequal length, ``dt``
        not positive, no motion, no reversal, too few samples, or torque of the wrong sign.
    """
    default = make(law)
    fitted = law_of(default).fitted
    if not fitted:
        raise ValueError(f"friction law {law!r} does not say what a record determines; register it with fitted=...")
    path, T, step = numbers("x", x), numbers("torque", torque), positive("dt", dt)
    if path.size != T.size:
        raise ValueError(f"x and torque must be of equal length, got {path.size} and {T.size} samples")
    branches = _branches(path, T)
    remembers = law_of(default).memory_size(default) > 0
    weighed = _weighed(path, branches, remembers)
    if callable(fitted):
        parameters, offset, intervals = fitted(path, T, step, weighed)
    else:
        stiffness = _stiffness(branches.ways, branches.rises, 0.25 * branches.swing)
        start = default._asdict() | {"F_c": 0.5 * branches.swing, "sigma_0": 0.5 * stiffness}
        parameters, offset, intervals = _least_squares(
            law, {name: start[name] for name in fitted}, path, T, step, weighed
        )
    warnings = _warnings(path, branches, remembers, parameters, intervals)
    if "F_c" in intervals and not any(branches.saturated[branches.first :]):
        intervals["F_c"] = intervals["F_c"][0], math.inf
    residual = (response(parameters, path, step) + offset - T)[weighed]
    return Fit(law, parameters, intervals, offset, math.sqrt(np.mean(residual**2)), warnings)


def _branches(path: NDArray, T: NDArray) -> _Branches:
    """The branches of a record; raises ValueError without a reversal and for torque of the wrong sign."""
    turns = _turns(path)
    swing = np.ptp(np.percentile(T, (1, 99)))  # without outliers
    rises = [math.copysign(1.0, path[b] - path[a]) * (T[a : b + 1] - T[a]) for a, b in pairwise(turns)]
    mean_rise = np.mean(np.concatenate(rises))
    if mean_rise <= 0.0:
        raise ValueError(
            f"torque must rise as x rises, as friction resists, got {mean_rise:g} N m on the mean after a reversal: "
            "if its sign is swapped, pass -torque"
        )
    ways = [np.abs(path[a : b + 1] - path[a]) for a, b in pairwise(turns)]
    saturated = [_saturates(way, rise, 0.25 * swing) for way, rise in zip(ways, rises)]
    first = 1 + (saturated[:-1].index(True) if any(saturated[:-1]) else 0)
    return _Branches(turns, ways, rises, swing, saturated, first)


def _weighed(path: NDArray, branches: _Branches, remembers: bool) -> NDArray[np.bool_]:
    """The samples that count; raises ValueError where they are too few."""
    weighed = np.arange(path.size) >= branches.turns[branches.first]
    if not remembers:  # a law without memory does not determine the torque at rest
        weighed &= np.diff(path, prepend=path[0]) != 0.0
    if np.count_nonzero(weighed) < LEAST:
        raise ValueError(
            f"x and torque must hold at least {LEAST} samples after the first reversal, got {np.count_nonzero(weighed)}"
        )
    return weighed


def _warnings(
    path: NDArray, branches: _Branches, remembers: bool, parameters: Any, intervals: dict[str, tuple[Bound, Bound]]
) -> tuple[str, ...]:
    """What the user has to know about the estimate."""
    warnings = []
    others = {name: value for name, value in parameters._asdict().items() if name not in intervals}
    kept = [f"{name} = {value:g}" for name, value in others.items() if np.ndim(value) == 0]
    if kept:
        warnings.append(f"a quasi-static record does not determine {', '.join(kept)}: kept at the default")
    if "F_c" in intervals and not any(branches.saturated[branches.first :]):
        warnings.append("the weighed torque never saturates, so F_c is a lower bound: record wider loops")
    if remembers and not branches.saturated[branches.first - 1]:
        warnings.append("no reversal from saturation: the memory at the start is taken as none, which biases the rest")
    detour = np.sum(np.abs(np.diff(path))) / sum(way[-1] for way in branches.ways) - 1.0
    if detour > DETOUR:
        warnings.append(f"x runs {detour:.1%} further than from reversal to reversal: filter x, its noise raises F_c")
    return tuple(warnings)


def _turns(x: NDArray) -> list[int]:
    """Samples that bound the branches: the start of motion, the reversals and the end.

    Raises ValueError where the record has no reversal.
    """
    band = BAND * np.ptp(x)
    turns = []
    side = low = high = 0
    for i, value in enumerate(x):
        low = i if value < x[low] else low
        high = i if value > x[high] else high
        if side <= 0 and value - x[low] > band:
            turns.append(low)
            side, high = 1, i
        elif side >= 0 and x[high] - value > band:
            turns.append(high)
            side, low = -1, i
    if len(turns) < 2:
        raise ValueError(f"x must move and reverse at least once, got a path from {x.min():g} to {x.max():g} rad")
    return [*turns, x.size - 1]


def _saturates(way: NDArray, rise: NDArray, least: float) -> bool:
    """Whether the torque of a branch has risen by ``least`` [N m] and is flat over the last quarter of its distance."""
    last = way >= 0.75 * way[-1]
    u, end = way[last] - np.mean(way[last]), np.mean(rise[last])
    return bool(end >= least and abs(u @ rise[last]) * 0.25 * way[-1] < FLAT * end * (u @ u))


def _stiffness(ways: list[NDArray], rises: list[NDArray], quarter: float) -> float:
    """Stiffness of the chord after a reversal up to a quarter of the swing [N m/rad].

    It is the median over the branches whose torque rises that far.
    """
    ends = [np.argmax(rise >= quarter) for rise in rises[1:]]
    chords = [rise[i] / way[i] for way, rise, i in zip(ways[1:], rises[1:], ends) if way[i] > 0.0]
    return float(np.median(chords)) if chords else 4.0 * quarter / max(map(np.max, ways))


def _least_squares(
    law: str, first: dict[str, float], x: NDArray, T: NDArray, dt: float, weighed: NDArray
) -> tuple[Any, float, dict[str, tuple[Bound, Bound]]]:
    """Parameters, offset [N m] and intervals by robust least squares on the logarithms of the parameters.

    ``first`` holds the start of the parameters to be estimated, by name.
    """
    from scipy.optimize import least_squares  # imported here, because that takes longer than the import of all laws

    def made(q: NDArray) -> Any:
        return make(law, **dict(zip(first, np.exp(q[:-1]).tolist())))

    def residuals(q: NDArray) -> NDArray[np.float64]:
        return (response(made(q), x, dt) + q[-1] - T)[weighed]  # (F12)

    q = np.append(np.log(list(first.values())), np.median(T))
    reach = np.append(np.full(len(first), RANGE), math.inf)
    bounds = q - reach, q + reach
    scale = 0.1 * np.ptp(T)  # where the loss turns from square to linear [N m]: first at a tenth of the range
    for _ in range(2):
        found = least_squares(residuals, q, bounds=bounds, loss="soft_l1", f_scale=scale, xtol=1e-10, ftol=1e-12)
        q = found.x
        scale = max(3.0 * 1.4826 * np.median(np.abs(found.fun)), 1e-6 * np.ptp(T))  # then at three standard deviations
    half = half_widths(found.jac, found.fun, np.eye(q.size))
    with np.errstate(over="ignore"):
        low, high = np.exp(q - half), np.exp(q + half)
    return made(q), float(q[-1]), {name: (low[i], high[i]) for i, name in enumerate(first)}
