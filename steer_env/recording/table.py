"""The common form of an opened file: :mod:`steer_env.recording.files` chooses columns from it and loads them."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from steer_env.recording.units import FILE_UNITS, parse_unit, split_unit


class Column(NamedTuple):
    """A column of a file, before it is read."""

    label: str  # its text in the file
    name: str  # the label without the unit
    unit: str | None  # as the file spells it; None if the file names none
    sign: str | None = (
        None  # label of the column that is 1 where the values, magnitudes, are negative; None: they are not
    )

    @property
    def declares_unit(self) -> bool:
        """Whether the unit stands apart from the name or in brackets; the end of a name may only look like one."""
        return self.unit is not None and self.label != f"{self.name}_{self.unit}"


# Samples (T,) in the file's unit, or a text that says why there are none.
Values = np.ndarray | str


class Table(NamedTuple):
    """An opened file."""

    columns: list[Column]
    meta: dict[str, Any]
    timed: bool  # whether the time is one of the columns; otherwise `load` returns it first, in seconds
    load: Callable[[Sequence[int]], list[Values]]  # loads the columns at these indices; the first is the time


def column(label: str) -> Column:
    """A column whose unit, if it is named, is part of the label."""
    return Column(label, *split_unit(label))


def named_time(entry: Column) -> bool:
    """Whether a column is the time by its name."""
    return entry.name.lower() in ("time", "t")


def time_place(columns: Sequence[Column]) -> int | None:
    """Index of the column of the time: the first one called time or t, else the first of all if it is in seconds."""
    for place, entry in enumerate(columns):
        if named_time(entry):
            return place
    return 0 if columns and (parse_unit(columns[0].unit or "") or ("",))[0] == "s" else None


def label(name: str, unit: str) -> str:
    """The label of a channel's column, which has the unit as a suffix.

    Raises
    ------
    ValueError
        If the column would be read back with another name or unit because of the end of the name.
    """
    text = f"{name}_{FILE_UNITS[unit][0]}"
    back = split_unit(text)
    if back[0] != name or back[1] is None or parse_unit(back[1]) != (unit, FILE_UNITS[unit][1]):
        raise ValueError(f"channel {name!r} in {unit!r} cannot be a column: rename the channel")
    return text
