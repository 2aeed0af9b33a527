"""``friction.compare``: laws fitted to the first part of a record and judged on the rest (F39)."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.blocks import drawn_means, percentile_interval
from steer_env.friction.identification.determined import samples_per_count
from steer_env.friction.identification.displacement import displacement_noise
from steer_env.friction.identification.fit import Fit, Options, checked_order, cleaned, fitted, prepared
from steer_env.friction.identification.periods import moving
from steer_env.friction.identification.position import SOUGHT_FIELDS
from steer_env.friction.identification.record import Record, checked
from steer_env.friction.law import available, law_of, make
from steer_env.friction.level import by_sample
from steer_env.friction.numerics.check import number, positive
from steer_env.friction.response import response

HELD_OUT = 0.4  # of a record: its last part judges, the first one fits [1]
BLOCKS = 20  # of the held-out part
DRAWS = 2000  # of blocks, with replacement
MATTERS = 0.02  # a law that leaves less than this more than another one is as good [1]


class Compared(NamedTuple):
    """One law on a record, judged on the samples that it was not fitted to."""

    law: str
    fit: Fit | None  # None where the law was refused
    refused: str  # why, or empty
    residual: float  # RMS on the held-out part while it moves [N m]
    interval: tuple[float, float]  # of the residual, 95 %, from blocks drawn with replacement [N m]
    aic: float  # Akaike's information criterion on the fitted part [1]
    bic: float  # Bayes' [1]
    alike: tuple[str, ...]  # laws that the held-out part cannot tell from this one
    resting: float | None = None  # RMS on the held-out part at rest; None without rests, or for a law without memory
    alone: float | None = None  # residual with the same level everywhere, where one over the position was sought [N m]


def compare(
    record: Record,
    laws: Sequence[str] | None = None,
    *,
    held_out: float | slice = HELD_OUT,
    inertia: float | None = 0.0,
    starts: int = 3,
    global_search: bool = False,
    seed: int = 0,
    order: float | str | None = None,
    notify: Callable[[float, str], None] = lambda part, text: None,
) -> tuple[Compared, ...]:
    """Fit laws to the first part of a record and judge them on the motion of a later one, the best first.

    Two laws are alike where the 95 % interval of the difference of their held-out mean squares holds zero, or where the
    worse one leaves at most 2 % more. Nested and equivalent laws are alike on the records of the smaller one: Dahl and
    LuGre without damping, Coulomb and Masing, Masing and GMS.

    Parameters
    ----------
    record : Record
    laws : sequence of str, optional
        Names, by default of all laws.
    held_out : float or slice
        Share of the record, its end, or the samples that judge [1]. With 0 the whole record is fitted and judges.
    inertia : float or None
        As in :func:`steer_env.friction.fit` [kg m2].
    starts, global_search, order
        As in :func:`steer_env.friction.fit`; with an order, each law is fitted without it too (``Compared.alone``).
    seed : int
        Of the draws.
    notify : callable
        Told the part that is done and what comes next.

    Returns
    -------
    tuple of Compared
        Laws that are refused come last.

    Raises
    ------
    ValueError
        For a share not in 0 to 0.9, an unknown law, or samples that judge before any that fit or without motion.
    """
    whole = checked(record.x, record.torque, positive("dt", record.dt), record.load)
    judging = held_out if isinstance(held_out, slice) else slice(_first(whole, held_out), None)
    first = judging.indices(whole.x.size)[0]
    if first < 2:
        raise ValueError(f"held_out must leave samples before it that fit, got it from sample {first}")
    load = None if whole.load is None else whole.load[:first]
    part = prepared(Record(whole.x[:first], whole.torque[:first], whole.dt, load), inertia)
    known = part.branches.turns[part.branches.first]  # before it, a law does not know its memory
    if first == whole.x.size:
        judging = slice(known, None)
    options = Options({}, starts, global_search, seed, checked_order(order, load))
    found, squares, left, moves = [], {}, {}, _moves(whole, inertia, judging)
    names = available() if laws is None else laws
    for i, name in enumerate(names):
        notify(i / len(names), f"fitting {name.replace('_', ' ')}")
        law = law_of(make(name))
        try:
            fit = fitted(part, law, options)
        except ValueError as error:
            found.append(Compared(name, None, str(error), math.inf, (math.inf, math.inf), math.inf, math.inf, ()))
            continue
        e, moving_part = remainder(whole, fit), moves[judging]
        left[name] = e[known:first][moves[known:first]]
        squares[name] = e[judging][moving_part] ** 2
        each = _judged(fit, e[judging], moving_part, squares[name], seed)
        if order is not None:
            same = fit if fit.level is None else fitted(part, law, options._replace(order=None))
            each = each._replace(alone=_rms(remainder(whole, same)[judging][moving_part]))
        found.append(each)
    found.sort(key=lambda each: each.residual)
    result = []
    for each in found:
        aic, bic = _criteria(each, left)
        result.append(each._replace(alike=_alike(each.law, squares, seed), aic=aic, bic=bic))
    return tuple(result)


def _judged(fit: Fit, e: NDArray, moves: NDArray, squares: NDArray, seed: int) -> Compared:
    """A law by what it leaves of the samples that judge, without its criteria."""
    low, high = percentile_interval(np.sqrt(_bootstrap_means(squares, seed)))
    tells = not moves.all() and law_of(fit.parameters).memory_size(fit.parameters) > 0
    resting = _rms(e[~moves]) if tells else None
    return Compared(fit.law, fit, "", _rms(e[moves]), (low, high), math.inf, math.inf, (), resting)


def _rms(values: NDArray) -> float:
    return math.sqrt(np.mean(values**2))


def _moves(record: Record, inertia: float | None, judging: slice) -> NDArray[np.bool_]:
    moves = moving(cleaned(record, displacement_noise(record.x), inertia).x)
    if not np.any(moves[judging]):
        raise ValueError("the samples that judge must hold motion, got a rest: choose another held_out")
    return moves


def _first(record: Record, share: float) -> int:
    return record.x.size - round(number("held_out", share, minimum=0.0, maximum=0.9) * record.x.size)


def remainder(record: Record, fit: Fit) -> NDArray[np.float64]:
    """What a law that was fitted leaves of the torque of a whole record (T,), law less record [N m]."""
    clean = cleaned(record, displacement_noise(record.x), fit.inertia)
    load = np.zeros(clean.x.size) if record.load is None else record.load
    scale: Any = 1.0 if fit.level is None else by_sample(fit.level, load, clean.x)
    return response(fit.parameters, clean.x, record.dt, scale) + fit.offset - clean.torque


def _criteria(each: Compared, left: dict[str, NDArray]) -> tuple[float, float]:
    """Information criteria of a fit, in which samples count as often as they are independent (F39).

    The number of independent samples is that of the law that leaves least, the same for every law, as criteria of
    different numbers of samples cannot be compared.
    """
    if each.fit is None:
        return math.inf, math.inf
    e = left[each.law]
    best = min(left.values(), key=lambda other: float(np.mean(other**2)))
    count = best.size / samples_per_count(best)
    values = [v for name, v in each.fit.parameters._asdict().items() if name not in each.fit.undetermined]
    elements = max((np.size(v) for v in values if np.ndim(v)), default=0)  # of which each adds one
    k = 1 + elements + sum(np.ndim(v) == 0 for v in values)  # with the offset
    k += sum(name in each.fit.intervals for name in SOUGHT_FIELDS)  # of a level over the position
    gain = count * math.log(max(float(np.mean(e**2)), 1e-300))  # (F39)
    return gain + 2.0 * k, gain + k * math.log(count)


def _bootstrap_means(values: NDArray, seed: int) -> NDArray[np.float64]:
    """Their mean in each draw of ``BLOCKS`` blocks (DRAWS,)."""
    return drawn_means(values, BLOCKS * np.arange(values.size) // values.size, seed, DRAWS)


def _alike(law: str, squares: dict[str, NDArray], seed: int) -> tuple[str, ...]:
    """The other laws whose held-out mean squares differ from a law's by no more than chance or ``MATTERS``."""
    if law not in squares:
        return ()
    names = []
    for other in squares.keys() - {law}:
        low, high = percentile_interval(_bootstrap_means(squares[law] - squares[other], seed))
        a, b = np.mean(squares[law]), np.mean(squares[other])
        if low <= 0.0 <= high or max(a, b) <= (1.0 + MATTERS) ** 2 * min(a, b):
            names.append(other)
    return tuple(sorted(names))
