"""Friction laws that are fitted to a record, and what each leaves on the part that judges."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from steer_env import friction
from steer_env.friction.identification.displacement import noise_of
from steer_env.friction.identification.intervals import samples_per_count
from steer_env.friction.law import LAWS
from steer_env.friction.level import by_sample
from steer_env.friction.numerics.check import number
from steer_env.recording import friction_checks
from steer_env.recording.friction_checks import Array
from steer_env.recording.friction_record import FrictionRecord, check_units
from steer_env.recording.units import DEGREE

HELD_OUT = 0.4  # of the record: its last part judges, the first one fits [1]
BLOCKS = 20  # of the part that judges, at most, for its intervals
DRAWS = 2000  # of blocks
SEED = 0  # of these
# Unit in memory -> how a reader sees it, and the size of that.
SHOWN = {"rad": ("deg", DEGREE), "m": ("mm", 1e-3), "N m": ("N m", 1.0), "N": ("N", 1.0)}
LOADED = 0.2  # variation of a load by which a level can be fitted, over the largest load, at least; assumed [1]
MATTERS = 0.05  # a law that leaves less than this share more than the best one is as good [1]


class Judged(NamedTuple):
    """A law and a record."""

    law: str
    fit: Any  # friction.Fit of the first part; None where the law was not fitted
    reason: str  # why it was not; empty otherwise
    curve: Array  # (T,) the law over the whole record [unit of the friction]
    left: tuple[float, float, float]  # RMS on the part that judges, and its 95 % interval [unit of the friction]
    criterion: float  # Bayesian information criterion of the fitted part above the least of all laws [1]
    apart: bool  # whether it leaves more than the best law, by ``MATTERS``, in 95 % of the draws of blocks


class Found(NamedTuple):
    """All laws on one record, the best first."""

    record: FrictionRecord
    name: str  # of the record
    first: int  # first sample that judges; 0 where all of them fit and judge
    level: float  # mean friction [unit of the friction]
    repeats: float | None  # RMS difference from one period to the next on the part that judges [same unit]
    laws: tuple[Judged, ...]

    @property
    def best(self) -> Judged | None:
        """The law that leaves least; None where no law was fitted."""
        return self.laws[0] if self.laws and self.laws[0].fit is not None else None


def contents() -> frozenset[str]:
    """Names of the files of an output."""
    return frozenset({"index.html", "fit.json", *(f"{law}.json" for law in LAWS.available())})


def collect(
    record: FrictionRecord,
    name: str,
    laws: Sequence[str],
    *,
    held_out: float | None = None,
    by_load: bool = False,
    options: Mapping[str, Any] | None = None,
    notify: Callable[[float, str], None] = lambda part, text: None,
) -> Found:
    """Fit laws to the first part of a record and judge them on the last.

    Parameters
    ----------
    record : FrictionRecord
    name : str
        Of the record, for readers.
    laws : sequence of str
        Names of laws.
    held_out : float, optional
        Share of the record that judges; with 0 the whole record fits and judges [1]. By default ``HELD_OUT``, or 0
        where fewer than two reversals would remain to be fitted.
    by_load : bool
        Whether the level grows with the record's load.
    options : mapping, optional
        Further arguments of ``friction.fit``.
    notify : callable
        Told the part that is done and what comes next.

    Raises
    ------
    ValueError
        For units that are of no law, a share that is not in 0 to 0.9, or a level by a load that is not recorded or
        does not vary.
    """
    check_units(record)
    if by_load:
        _check_load(record)
    n = record.x.size
    share = HELD_OUT if held_out is None else number("held_out", held_out, minimum=0.0, maximum=0.9)
    first = n - round(share * n) if share else 0
    if held_out is None and friction_checks.turns(record.motion[:first]).size < 2:
        first = 0
    judging = slice(first, None)
    if record.motion is not record.x:
        unit, size = SHOWN[record.units["displacement"]]
        noise = noise_of(record.x) / size
        text = f"the displacement has noise of {noise:.2g} {unit}: it is smoothed between reversals"
        record = replace(record, notes=(*record.notes, text))
    found = []
    for i, law in enumerate(laws):
        notify(i / len(laws), f"fitting {law.replace('_', ' ')}")
        found.append(_judged(record, law, slice(0, first or None), judging, by_load, options or {}))
    found.sort(key=lambda each: each.left[0] if each.fit is not None else math.inf)
    if found and found[0].fit is not None:
        criteria = _criteria(record, found, first)
        found = [
            each._replace(apart=_apart(record, found[0], each, judging), criterion=criterion)
            for each, criterion in zip(found, criteria)
        ]
    middle = friction_checks.middle(record.motion, record.friction)
    level = float(np.mean(np.abs(record.friction - middle)))
    repeats = friction_checks.repeatability(record.motion, record.friction, first)
    return Found(record, name, first, level, repeats, tuple(found))


def _judged(
    record: FrictionRecord, law: str, fitting: slice, judging: slice, by_load: bool, options: Mapping[str, Any]
) -> Judged:
    """One law."""
    part = record.part(fitting)
    nothing = (np.full(record.x.size, math.nan), (math.nan, math.nan, math.nan), math.nan, False)
    try:
        fit = friction.fit(part.x, part.friction, law, dt=part.dt, load=part.load if by_load else None, **options)
    except ValueError as error:
        return Judged(law, None, str(error), *nothing)
    load = np.zeros(record.x.size) if record.load is None else record.load
    scale = 1.0 if fit.level is None else by_sample(fit.level, load)
    curve = friction.response(fit.parameters, record.motion, record.dt, scale) + fit.offset
    squares = _blocks(record, curve, judging)
    drawn = np.sqrt(np.mean(squares[_draws(squares.size)], axis=1))
    low, high = np.quantile(drawn, (0.025, 0.975))
    return Judged(law, fit, "", curve, (float(np.sqrt(np.mean(squares))), float(low), float(high)), math.nan, False)


def _check_load(record: FrictionRecord) -> None:
    if record.load is None:
        raise ValueError(
            "the record has no load by which its level could grow: name it with --map load=..., or leave --by-load out"
        )
    low, high = float(record.load.min()), float(record.load.max())
    if high - low < LOADED * high:
        raise ValueError(
            f"the load hardly varies ({low:.4g} to {high:.4g}), so that nothing tells how the level grows with it: "
            "leave --by-load out, or record under several loads"
        )


def known_from(record: FrictionRecord) -> int:
    """First sample at which the memory of a law hardly depends on what was before the record: the second reversal."""
    turns = friction_checks.turns(record.motion)
    return int(turns[1]) if turns.size > 2 else 0


def _criteria(record: FrictionRecord, laws: Sequence[Judged], first: int) -> list[float]:
    """Bayesian information criteria of the fitted part, above the least of them.

    n log(mean square) + k log(n), with k parameters that the record determines and n independent samples: those of the
    residuals of the law that leaves least there, the same for every law.

    Source: Schwarz, Annals of Statistics 6 (1978) 461.
    """
    part = slice(known_from(record), first or None)
    residuals = [(each.curve - record.friction)[part] for each in laws]
    squares = np.array([np.mean(e**2) for e in residuals]) + (1e-9 * np.ptp(record.friction)) ** 2  # without noise
    n = residuals[0].size / samples_per_count(residuals[int(np.nanargmin(squares))])
    charges = np.array([math.nan if each.fit is None else _parameters(each.fit) for each in laws]) * math.log(n)
    found = n * np.log(squares) + charges
    return (found - np.nanmin(found)).tolist()


def _parameters(fit: Any) -> int:
    """Number of parameters that a record determines, the offset among them; an element counts as one."""
    values = {name: value for name, value in fit.parameters._asdict().items() if name not in fit.undetermined}
    arrays = max((np.size(value) for value in values.values() if np.ndim(value)), default=0)
    return 1 + arrays + sum(np.ndim(value) == 0 for value in values.values())


def _apart(record: FrictionRecord, best: Judged, other: Judged, judging: slice) -> bool:
    """Whether a law leaves more than the best one by a share that matters, on blocks that both are drawn with."""
    if other.fit is None:
        return False
    more = _blocks(record, other.curve, judging) - (1.0 + MATTERS) ** 2 * _blocks(record, best.curve, judging)
    return bool(np.quantile(np.mean(more[_draws(more.size)], axis=1), 0.05) > 0.0)


def _blocks(record: FrictionRecord, curve: Array, judging: slice) -> Array:
    """Mean squares of what a law leaves, in blocks of whole periods where the record has a period."""
    squares = (curve[judging] - record.friction[judging]) ** 2
    length = friction_checks.period(record.motion) or math.ceil(squares.size / BLOCKS)
    blocks = max(squares.size // max(length, math.ceil(squares.size / BLOCKS)), 1)
    return np.array([part.mean() for part in np.array_split(squares, blocks)])


def _draws(blocks: int) -> np.ndarray:
    return np.random.default_rng(SEED).integers(blocks, size=(DRAWS, blocks))
