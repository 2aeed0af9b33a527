"""Friction laws that are fitted to a record, and what each leaves on the part that judges."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from steer_env import friction
from steer_env.experiments.pages.pages import LIVE_FOLDER
from steer_env.friction import Compared, Record
from steer_env.friction.identification import periods
from steer_env.friction.identification.compare import HELD_OUT, remainder
from steer_env.friction.identification.displacement import displacement_noise
from steer_env.friction.law import LAWS
from steer_env.friction.numerics.check import number
from steer_env.recording import friction_checks
from steer_env.recording.friction_checks import Array
from steer_env.recording.friction_record import FrictionRecord, check_units
from steer_env.recording.units import DEGREE

RESTS = 0.1  # of the judging part: shorter rests are those of reversals, and not told; assumed [1]
# Unit in memory -> how a reader sees it, and the size of that.
SHOWN_UNITS = {"rad": ("deg", DEGREE), "m": ("mm", 1e-3), "N m": ("N m", 1.0), "N": ("N", 1.0)}
LOADED = 0.2  # variation of a load by which a level can be fitted, over the largest load, at least; assumed [1]


class Found(NamedTuple):
    """All laws on one record, the best first."""

    record: FrictionRecord
    name: str  # of the record
    first: int  # first sample that judges; 0 where all of them fit and judge
    level: float  # mean friction [unit of the friction]
    repeats: float | None  # RMS difference from one equal period to the next where it judges and moves [same unit]
    rests: float  # share of the part that judges at which the displacement stands still; 0 up to ``RESTS`` [1]
    laws: tuple[Compared, ...]
    curves: Mapping[str, Array]  # law -> (T,) its friction over the whole record [same unit]

    @property
    def best(self) -> Compared | None:
        """The law that leaves least, maybe no less than others (``equals``); None where no law was fitted."""
        return self.laws[0] if self.laws and self.laws[0].fit is not None else None

    @property
    def equals(self) -> tuple[Compared, ...]:
        """The laws that the judging part cannot tell from the one that leaves least, with it; those that leave less
        come first."""
        return tuple(each for each in self.laws if each.fit is not None and not self.apart(each))

    @property
    def saturated(self) -> dict[str, float]:
        """Friction of each law after a long way at the record's median speed [unit of the friction]."""
        return {each.law: each.fit.saturated[0] for each in self.laws if each.fit is not None}

    def apart(self, each: Compared) -> bool:
        """Whether a law leaves more than the best one, as :func:`steer_env.friction.compare` tells."""
        return each.fit is not None and self.best is not None and self.best.law not in (each.law, *each.alike)

    def criterion(self, each: Compared) -> float:
        """Bayes' information criterion above the least of all laws [1]."""
        return each.bic - min(other.bic for other in self.laws)


def contents() -> frozenset[str]:
    """Names of the files of an output."""
    return frozenset({"index.html", "fit.json", LIVE_FOLDER, *(f"{law}.json" for law in LAWS.available())})


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
        Further arguments of ``friction.compare``.
    notify : callable
        Told the part that is done and what comes next.

    Raises
    ------
    ValueError
        For units that are of no law, a share that is not in 0 to 0.9, a level by a load that is not recorded or does
        not vary, or a record that no law can be fitted to.
    """
    check_units(record)
    if by_load:
        _check_load(record)
    n = record.x.size
    share = HELD_OUT if held_out is None else number("held_out", held_out, minimum=0.0, maximum=0.9)
    first = n - round(share * n) if share else 0
    if held_out is None and friction_checks.find_reversals(record.motion[:first]).size < 2:
        first = 0
    if record.motion is not record.x:
        unit, size = SHOWN_UNITS[record.units["displacement"]]
        noise = displacement_noise(record.x) / size
        text = f"the displacement has noise of {noise:.2g} {unit}: it is smoothed between reversals"
        record = replace(record, notes=(*record.notes, text))
    given = Record(record.x, record.friction, record.dt, record.load if by_load else None)
    judging = slice(first, None) if first else 0.0
    found = friction.compare(given, laws, held_out=judging, notify=notify, **(options or {}))
    curves = {each.law: record.friction + remainder(given, each.fit) for each in found if each.fit is not None}
    level = friction_checks.mean_friction(record.motion, record.friction)
    repeats = periods.repeatability(record.motion, record.friction, first)
    rests = 1.0 - float(np.mean(periods.moving(record.motion[first:])))
    return Found(record, name, first, level, repeats, rests if rests > RESTS else 0.0, found, curves)


def known_from(record: FrictionRecord) -> int:
    """First sample at which the memory of a law hardly depends on what was before the record: the second reversal."""
    turns = friction_checks.find_reversals(record.motion)
    return int(turns[1]) if turns.size > 2 else 0


def _check_load(record: FrictionRecord) -> None:
    """ValueError unless the record has a load that varies."""
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
