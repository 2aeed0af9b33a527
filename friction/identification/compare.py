"""``friction.compare``: laws fitted to the first part of a record and judged on the rest (F39)."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.identification.fit import Fit, Options, fitted, prepared
from steer_env.friction.identification.intervals import samples_per_count
from steer_env.friction.identification.record import Record, checked
from steer_env.friction.law import available, law_of, make
from steer_env.friction.level import by_sample
from steer_env.friction.numerics.check import number, positive
from steer_env.friction.response import response

BLOCKS = 20  # of the held-out part
DRAWS = 2000  # of blocks, with replacement
MATTERS = 0.02  # a law that leaves less than this more than another one is as good [1]


class Compared(NamedTuple):
    """One law on a record, judged on the samples that it was not fitted to."""

    law: str
    fit: Fit | None  # None where the law was refused
    refused: str  # why, or empty
    residual: float  # RMS on the held-out part [N m]
    interval: tuple[float, float]  # of the residual, 95 %, from blocks drawn with replacement [N m]
    aic: float  # Akaike's information criterion on the fitted part, with independent samples [1]
    bic: float  # Bayes' [1]
    alike: tuple[str, ...]  # laws that the held-out part cannot tell from this one


def compare(
    record: Record,
    laws: Sequence[str] | None = None,
    *,
    held_out: float | slice = 1.0 / 3.0,
    inertia: float | None = 0.0,
    starts: int = 3,
    seed: int = 0,
) -> tuple[Compared, ...]:
    """Fit laws to the first part of a record and judge them on a later one, the best first.

    Two laws are alike where the 95 % interval of the difference of their held-out mean squares holds zero, or where the
    worse one leaves at most 2 % more. Nested and equivalent laws are alike on the records of the smaller one: Dahl and
    LuGre without damping, Coulomb and Masing, Masing and GMS.

    Parameters
    ----------
    record : Record
    laws : sequence of str, optional
        Names, by default of all laws.
    held_out : float or slice
        Share of the record, its end, or the samples that judge [1].
    inertia : float or None
        As in :func:`steer_env.friction.fit` [kg m2].
    starts : int
        Of each search.
    seed : int
        Of the draws.

    Returns
    -------
    tuple of Compared
        Laws that are refused come last.

    Raises
    ------
    ValueError
        For a share not between 0 and 0.9, an unknown law, or samples that judge before any that fit.
    """
    whole = checked(record.x, record.torque, positive("dt", record.dt), record.load)
    judging = held_out if isinstance(held_out, slice) else slice(_first(whole, held_out), None)
    first = judging.indices(whole.x.size)[0]
    if first < 2:
        raise ValueError(f"held_out must leave samples before it that fit, got it from sample {first}")
    load = None if whole.load is None else whole.load[:first]
    part = prepared(Record(whole.x[:first], whole.torque[:first], whole.dt, load), inertia)
    options = Options(starts=starts, seed=seed)
    found, squares = [], {}
    for name in available() if laws is None else laws:
        law = law_of(make(name))
        try:
            fit = fitted(part, law, options)
        except ValueError as error:
            found.append(Compared(name, None, str(error), math.inf, (math.inf, math.inf), math.inf, math.inf, ()))
            continue
        e = _left(whole, fit)
        squares[name] = np.array([np.mean(b) for b in np.array_split(e[judging] ** 2, BLOCKS)])
        drawn = np.sqrt(np.mean(squares[name][_draws(seed)], axis=1))
        low, high = np.quantile(drawn, (0.025, 0.975)).tolist()
        aic, bic = _criteria(e[:first], fit)
        found.append(Compared(name, fit, "", math.sqrt(np.mean(squares[name])), (low, high), aic, bic, ()))
    found.sort(key=lambda each: each.residual)
    return tuple(each._replace(alike=_alike(each.law, squares, seed)) for each in found)


def _first(record: Record, share: float) -> int:
    return record.x.size - round(number("held_out", share, minimum=0.0, maximum=0.9, above=True) * record.x.size)


def _left(record: Record, fit: Fit) -> NDArray[np.float64]:
    """What a law leaves of the torque of a whole record [N m]."""
    clean = prepared(record, fit.inertia).record  # x freed of its noise, and without the torque of the inertia
    scale: Any = 1.0 if fit.level is None or record.load is None else by_sample(fit.level, record.load)
    return response(fit.parameters, clean.x, record.dt, scale) + fit.offset - clean.torque


def _criteria(e: NDArray, fit: Fit) -> tuple[float, float]:
    """Information criteria of a fit, whose samples count as often as they are independent (F39)."""
    count = e.size / samples_per_count(e)
    k = sum(np.size(v) for v in fit.parameters) - len(fit.undetermined) + 1  # with the offset
    gain = count * math.log(max(float(np.mean(e**2)), 1e-300))
    return gain + 2.0 * k, gain + k * math.log(count)


def _draws(seed: int) -> NDArray[np.int_]:
    return np.random.default_rng(seed).integers(BLOCKS, size=(DRAWS, BLOCKS))


def _alike(law: str, squares: dict[str, NDArray], seed: int) -> tuple[str, ...]:
    """The other laws whose held-out mean squares differ from a law's by no more than chance or ``MATTERS``."""
    if law not in squares:
        return ()
    names = []
    for other in squares.keys() - {law}:
        low, high = np.quantile(np.mean((squares[law] - squares[other])[_draws(seed)], axis=1), (0.025, 0.975))
        a, b = np.mean(squares[law]), np.mean(squares[other])
        if low <= 0.0 <= high or max(a, b) <= (1.0 + MATTERS) ** 2 * min(a, b):
            names.append(other)
    return tuple(sorted(names))
