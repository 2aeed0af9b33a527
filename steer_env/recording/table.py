"""What every file format offers to :mod:`steer_env.recording.files`: columns to choose from, then the chosen ones."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from steer_env.recording.units import FILE_UNITS, split, understood


class Column(NamedTuple):
    """A column of a file, before it is read."""

    label: str  # as in the file
    name: str  # without its unit
    unit: str | None  # as the file spells it; None where it does not say


# Samples (T,) in the file's unit, or why there are none.
Values = np.ndarray | str


class Table(NamedTuple):
    """An opened file."""

    columns: list[Column]
    meta: dict[str, Any]
    timed: bool  # whether the time is one of the columns; else `load` puts it first by itself, in seconds
    load: Callable[[Sequence[int]], list[Values]]  # the columns of these places; the first of them is the time


def column(label: str) -> Column:
    """A column that names its unit, if at all, in its label."""
    return Column(label, *split(label))


def label(name: str, unit: str) -> str:
    """The column of a channel with its unit as suffix.

    Raises
    ------
    ValueError
        If the name ends so that the column would be read back with another unit.
    """
    text = f"{name}_{FILE_UNITS[unit][0]}"
    back = split(text)
    if back[0] != name or back[1] is None or understood(back[1]) != (unit, FILE_UNITS[unit][1]):
        raise ValueError(f"channel {name!r} in {unit!r} cannot be a column: rename the channel")
    return text
