"""The common form of an opened file: :mod:`steer_env.recording.files` chooses columns from it and loads them.

All readers keep two rules, and tell in the meta what they left out by them:

* What is no value is a gap: a code that a text stands for ("Invalid"), a sample that is marked invalid, an infinite
  number, an empty cell. The meta ``no_value`` counts them, ``{column: {reason: samples}}``.
* Of samples that share a time stamp the last is kept, and the meta ``doubled_stamps`` counts the others,
  ``{column: samples}``. Where more than ``MOST_DOUBLED`` of all share one, the logger stamped blocks, and the instants
  of the samples are not known: that is refused, and so is a time that goes back.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from steer_env.recording.units import FILE_UNITS, parse_unit, split_unit

NO_VALUE, DOUBLED = "no_value", "doubled_stamps"  # keys of the meta
# The same, of channels whose time is known less well than that of the others: a list of dicts with ``channels``, which
# are late or early together, and the largest error in ``seconds``.
TIMING = "timing_error_s"
MOST_DOUBLED = 0.1  # share of samples with the stamp of another, above which stamps are those of blocks; assumed [1]


class Column(NamedTuple):
    """A column of a file, before it is read; made by :func:`column`."""

    label: str  # its text in the file
    name: str  # the label without the unit
    unit: str | None  # as the file spells it; None if the file names none
    known: tuple[str, float] | None  # unit in memory and the value in memory of one; None if the spelling is not known
    sign: str | None = None  # label of the column that says where the values, magnitudes, are negative; None: none
    negative: int = 1  # what that column is there [1]

    @property
    def declares_unit(self) -> bool:
        """Whether the unit stands apart from the name or in brackets; the end of a name may only look like one."""
        return self.unit is not None and self.label != f"{self.name}_{self.unit}"

    @property
    def is_time(self) -> bool:
        """Whether a column is the time by its name."""
        return self.name.lower() in ("time", "t")


# Samples (T,) in the file's unit, or a text that says why there are none.
Values = np.ndarray | str


class Table(NamedTuple):
    """An opened file."""

    columns: list[Column]
    meta: dict[str, Any]  # to which `load` adds what it left out
    timed: bool  # whether the time is one of the columns; otherwise `load` returns it first, in seconds
    load: Callable[[Sequence[int]], list[Values]]  # loads the columns at these indices; the first is the time


def column(label: str, unit: str | None = None, name: str | None = None) -> Column:
    """A column with the unit that stands apart from its label, or else with the one that is part of it."""
    short, end = split_unit(label)
    if unit:
        return Column(label, name or label, unit, parse_unit(unit))
    return Column(label, name or short, end or None, parse_unit(end) if end else None)


def time_column(columns: Sequence[Column]) -> int | None:
    """Index of the column of the time: the first one called time or t, else the first of all if it is in seconds."""
    for place, entry in enumerate(columns):
        if entry.is_time:
            return place
    return 0 if columns and columns[0].known and columns[0].known[0] == "s" else None


def label(name: str, unit: str) -> str:
    """The label of a channel's column, which has the unit as a suffix.

    Raises
    ------
    ValueError
        If the column would be read back with another name or unit because of the end of the name.
    """
    text = f"{name}_{FILE_UNITS[unit][0]}"
    back = column(text)
    if back.name != name or back.known != (unit, FILE_UNITS[unit][1]):
        raise ValueError(f"channel {name!r} in {unit!r} cannot be a column: rename the channel")
    return text


def meta_in(text: Any) -> dict[str, Any]:
    """The meta in a comment of a file, which is empty if the text is not that of a recording."""
    try:
        meta = json.loads(text)
    except (TypeError, ValueError, RecursionError):
        return {}
    return meta if isinstance(meta, dict) else {}


def tell(meta: dict[str, Any], key: str, label: str, told: Any) -> None:
    """Add what was left out of a column to the meta, beside what the file tells of itself."""
    before = meta.get(key)
    meta[key] = {**before, label: before.get(label, told)} if isinstance(before, dict) else {label: told}


def gaps(
    meta: dict[str, Any], label: str, values: np.ndarray, codes: Mapping[str, np.ndarray] | None = None
) -> np.ndarray:
    """The samples (T,) of a column with NaN where they are no values, which the meta ``no_value`` tells.

    Parameters
    ----------
    meta : dict
        To which the counts are added.
    label : str
        Of the column.
    values : (T,) array
        Infinite numbers are no values; where it is NaN already and no code says why, it is ``"empty"``.
    codes : mapping of str to (T,) array of bool, optional
        Why samples are no values -> which; of several reasons for a sample the first is told.
    """
    rest, told = np.ones(values.size, dtype=bool), dict[str, int]()
    for reason, where in {**(codes or {}), "infinite": np.isinf(values), "empty": np.isnan(values)}.items():
        if count := int(np.count_nonzero(where & rest)):
            told[reason] = count
            rest = rest & ~where
    if told:
        tell(meta, NO_VALUE, label, told)
    return np.where(rest, values, np.nan)


def last_of_each_time(meta: dict[str, Any], label: str, time: np.ndarray) -> np.ndarray:
    """Which samples (T,) remain where several share a time stamp; the meta ``doubled_stamps`` counts the others.

    Raises
    ------
    ValueError
        If the time (T,) is not finite, goes back, or has the stamps of blocks; with the place.
    """
    with np.errstate(invalid="ignore"):  # of an infinite time
        step = np.diff(time)
    back = ~(step >= 0) | ~np.isfinite(step)
    if back.any():
        k = int(np.argmax(back)) + 1
        raise ValueError(
            f"the time of {label!r} must be finite and not go back; sample {k} is {time[k]} s after {time[k - 1]} s; "
            "repair the file"
        )
    kept = np.append(step > 0, True)[: time.size]
    doubled = int(np.count_nonzero(~kept))
    if doubled > max(MOST_DOUBLED * time.size, 1):
        k = int(np.argmin(kept))
        raise ValueError(
            f"{doubled} of {time.size} samples of {label!r} have the time stamp of another, the first {time[k]} s: "
            "where a logger stamps blocks of samples, their instants are not known; record the time of each sample"
        )
    if doubled:
        tell(meta, DOUBLED, label, doubled)
    return kept


def in_common(times: Mapping[str, np.ndarray]) -> tuple[float, float]:
    """Begin and end of the time that channels with times of their own have in common, by label [s].

    Raises
    ------
    ValueError
        If there is none.
    """
    first, last = max(times, key=lambda label: times[label][0]), min(times, key=lambda label: times[label][-1])
    begin, end = float(times[first][0]), float(times[last][-1])
    if end <= begin:
        raise ValueError(
            f"{first!r} begins at {begin:g} s, {last!r} ends at {end:g} s: the channels have no time in common; name "
            "those that are wanted in a mapping"
        )
    return begin, end


def interpolate_between(at: np.ndarray, time: np.ndarray, values: np.ndarray, longest: float) -> np.ndarray:
    """Values on the straight lines between samples; NaN beside one that is no value, and in gaps.

    A gap is where two samples are more than ``longest`` of the channel's median steps apart [1].
    """
    read = np.interp(at, time, values)
    k = np.clip(np.searchsorted(time, at, side="right") - 1, 0, time.size - 2)
    gap = np.diff(time) > longest * np.median(np.diff(time))
    read[gap[k] & (at > time[k]) & (at < time[k + 1])] = np.nan
    return np.where(at == time[k], values[k], read)
