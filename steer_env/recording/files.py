"""Recordings from and to files: .csv, .mat, with extras .mf4, .mdf and .parquet; and from .csv.gz and CAN logs.

Files contain angles in degrees and all other quantities in SI units, and they name the unit of every column. A
recording that is written and read again is the same, except for the last bit of an angle, which is converted to degrees
and back. Measured files with other names, units, signs and delays are read with a mapping
(:mod:`steer_env.recording.channel_mapping`). Raw CAN logs are read with a database
(:mod:`steer_env.recording.can_log`).
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from steer_env.recording import can_log, csv_file, mat_file, mdf_file, parquet_file
from steer_env.recording import channel_mapping as mappings
from steer_env.recording.channel_mapping import KNOWN, Entry, Mapping, did_you_mean
from steer_env.recording.recording import Recording
from steer_env.recording.table import Column, Table, Values, named_time, time_place
from steer_env.recording.units import COUNTS, FILE_UNITS, SPELLINGS, parse_unit, spellings

# Suffix -> module with `save` and `open_table`, which returns a table.Table; can_log has no `save`.
FORMATS: dict[str, Any] = {
    ".csv": csv_file,
    ".mat": mat_file,
    ".mf4": mdf_file,
    ".mdf": mdf_file,
    ".parquet": parquet_file,
}
LONGEST_STEP = 0.1  # of a time in seconds that says no unit; no metric is read from 8 samples a second [s]
MOST_NAMED = 10  # largest number of columns that the meta lists as not read


class _Choice(NamedTuple):
    """A column that is read, and how."""

    place: int  # index among the file's columns
    name: str  # name of the channel
    unit: str  # unit in memory
    size: float  # value in memory of one unit of the file [unit in memory]
    entry: Entry


def read(
    path: str | os.PathLike[str],
    mapping: Mapping | str | os.PathLike[str] | None = None,
    *,
    can: can_log.Options | None = None,
) -> Recording:
    """A recording from a file, whose suffix gives the format.

    The channels that are read are those that the mapping names and those with a known name
    (``channel_mapping.KNOWN``). If the mapping names no channel, all channels with a known unit are read, and the meta
    key ``not_read`` lists the others. A channel without any value is left out and listed there, too; the meta key
    ``uncalibrated`` lists those in counts. A column called time or t without a unit is in seconds, which the meta key
    ``seconds_assumed`` tells. Where the mapping gives a channel a delay, all channels are trimmed to the
    time that remains. An old name of a channel is replaced, and a line on standard error says so.

    Parameters
    ----------
    path : str or path
        A file that ends in one of ``FORMATS`` or ``can_log.SUFFIXES``.
    mapping : Mapping or path of a .toml file, optional
        Names, units, signs, delays and offsets, and meta that replaces the meta of the file.
    can : can_log.Options, optional
        For a CAN log, which needs it: the database, the bus and the end of what is read.

    Raises
    ------
    ValueError
        If the file cannot be read as a recording. The message names the file, for .csv also the line and the column,
        what was expected there, and what to do.
    OSError
        If the file cannot be opened.
    """
    if not isinstance(mapping, Mapping):
        mapping = Mapping() if mapping is None else mappings.load(mapping)
    try:
        table = opened(path, can, [entry.column for entry in mapping.channels.values()])
        time = [_time(table.columns, mapping)] if table.timed else []
        if "time" in mapping.channels and not table.timed:
            raise ValueError("this format has a time base of its own: remove [channels.time] from the mapping")
        choices, left = _choose(table.columns, mapping, [choice.place for choice in time])
        loaded = table.load([choice.place for choice in time + choices])
        instants = _instants(table.columns, time[0], loaded[0]) if time else loaded[0]
        assumed = [table.columns[k.place].label for k in time if _assumed(table.columns[k.place], k.entry)]
        channels, units = {}, {}
        for choice, values in zip(choices, loaded[1:]):
            if isinstance(values, str) and choice.name not in {**KNOWN, **mapping.channels}:
                left.append(table.columns[choice.place].label)
                continue
            raw = _samples(table.columns, choice, values)
            if np.isnan(raw).all():
                left.append(f"{table.columns[choice.place].label} (no values)")
                continue
            channels[choice.name] = _value(choice, raw)
            units[choice.name] = choice.unit
        if left and not channels:
            raise ValueError(
                f"none of the columns {_listed(left)} can be read: each needs numbers and a unit ({SPELLINGS}); "
                "name those that are wanted, and their units, in a mapping"
            )
        uncalibrated = [name for name, unit in units.items() if unit == COUNTS]
        told = {"not_read": _listed(left), "uncalibrated": _listed(uncalibrated), "seconds_assumed": _listed(assumed)}
        meta = {**table.meta, **{key: text for key, text in told.items() if text}, **mapping.meta}
        recording = Recording(np.asarray(instants), channels, units, meta)
        for choice in choices:
            if choice.entry.delay and choice.name in channels:
                recording = recording.delayed(choice.name, -choice.entry.delay)
        return recording
    except ValueError as error:
        raise ValueError(f"{_place(path, can)}: {error}") from None


def _place(path: str | os.PathLike[str], can: can_log.Options | None) -> str:
    """A file in messages, with the databases that a CAN log is read with."""
    if can is None or not can.dbc or not can_log.recognised(path, can):
        return str(path)
    return f"{path} with {', '.join(map(str, can_log.paths_of(can.dbc)))}"


def opened(path: str | os.PathLike[str], can: can_log.Options | None = None, sources: Sequence[str] = ()) -> Table:
    """A file as its format opens it; ``sources`` may name sums of signals of a CAN log.

    Raises
    ------
    ValueError
        If the file cannot be read.
    OSError
        If the file cannot be opened.
    """
    form = None if can_log.recognised(path, can) else _format(path)
    with open(path, "rb"):  # the readers of the formats report a missing file in different ways
        pass
    if form is None:
        return can_log.open_table(path, can or can_log.Options(), sources)
    table: Table = form.open_table(path)
    if table.columns and all(column.label.startswith(can_log.BUS) for column in table.columns):
        raise ValueError("it holds raw frames of a bus: give the DBC that says what is in them, --dbc car.dbc")
    return table


def write(recording: Recording, path: str | os.PathLike[str], *, digits: int | None = None) -> None:
    """Write a recording to a file, whose suffix gives the format.

    The recording is written to a file beside ``path``, which is then renamed, so ``path`` is never incomplete.

    Parameters
    ----------
    recording : Recording
    path : str or path
    digits : int, optional
        Significant digits of the values in the file's units, which make a text file smaller; by default all of them.
        The time, to the nanosecond then, and the meta are not rounded to them.

    Raises
    ------
    ValueError
        If the suffix is none of ``FORMATS``, or if the format cannot hold a channel's name.
    """
    path = Path(path)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        if csv_file.compressed(path):
            raise ValueError(f"{csv_file.COMPRESSED} is read, not written: write a .csv, and compress it with gzip")
        form = _format(path)
        channels = [
            (name, recording.units[name], _rounded(values / FILE_UNITS[recording.units[name]][1], digits))
            for name, values in recording.channels.items()
        ]
        time = recording.time if digits is None else np.round(recording.time, 9)
        with open(part, "w+b") as file:
            form.save(file, time, channels, recording.meta)
        os.replace(part, path)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    except OSError as error:  # a full disk has no name
        error.filename = error.filename or str(path)
        raise
    finally:
        part.unlink(missing_ok=True)


def _rounded(values: np.ndarray, digits: int | None) -> np.ndarray:
    """The numbers nearest to those with so many significant digits."""
    return values if digits is None else np.array([float(f"{value:.{digits}g}") for value in values.tolist()])


def _format(path: str | os.PathLike[str]) -> Any:
    """The module for a file's suffix."""
    suffix = ".csv" if csv_file.compressed(path) else Path(path).suffix.lower()
    if suffix not in FORMATS:
        if Path(path).name.lower().endswith(can_log.SUFFIXES):
            raise ValueError(f"a CAN log is not written; recordings end in {', '.join(FORMATS)}")
        raise ValueError(f"recordings end in {', '.join([*FORMATS, *can_log.SUFFIXES])}, got {suffix!r}")
    return FORMATS[suffix]


def _time(columns: list[Column], mapping: Mapping) -> _Choice:
    """The column of the time: that of the mapping, else one called time or t, else the first if it is in seconds."""
    entry = mapping.channels.get("time")
    if entry is not None:
        place: int | None = _find(columns, entry)
    else:
        place = time_place(columns)
    if place is None:
        labels = [column.label for column in columns]
        hint = " (only one column: separate columns by , or ; or tabs)" if len(columns) == 1 else ""
        raise ValueError(
            f"no time among the columns {_listed(labels)}{hint}: expected time_s or Time [s], "
            'or a mapping with [channels.time] from = "...", unit = "s"'
        )
    entry = entry or Entry("time", columns[place].label, None)
    if _assumed(columns[place], entry):
        return _Choice(place, "time", "s", 1.0, entry)
    return _choice(columns, place, entry, "s")


def _assumed(column: Column, entry: Entry) -> bool:
    """Whether a column is the time by its name, and neither the file nor the mapping says a unit."""
    return named_time(column) and column.unit is None and entry.unit is None


def _instants(columns: list[Column], choice: _Choice, values: Values) -> np.ndarray:
    """The samples of the time [s]; ValueError for one without a unit whose steps are too long for seconds."""
    instants = _samples(columns, choice, values) * choice.size
    column = columns[choice.place]
    if _assumed(column, choice.entry):
        step = float(np.median(np.diff(instants)))
        if not step <= LONGEST_STEP:
            raise ValueError(
                f"column {column.label!r} names no unit, and its steps of {step:g} are too long for seconds: give its "
                f'unit in a mapping, [channels.time] from = "{column.label}", unit = "ms" (or "us", "s")'
            )
    return instants


def _choose(columns: list[Column], mapping: Mapping, used: list[int]) -> tuple[list[_Choice], list[str]]:
    """The columns to read, and the labels of those that are left out because of their unit.

    The columns ``used`` (indices) are already taken.
    """
    mapped = [
        _choice(columns, _find(columns, entry), entry, KNOWN.get(name))
        for name, entry in mapping.channels.items()
        if name != "time"
    ]
    by_name = {choice.name: choice for choice in mapped}
    used = used + [choice.place for choice in mapped]
    left = []
    for place, column in enumerate(columns):
        name = column.name
        known = name in KNOWN
        if place in used or name in mapping.channels or (mapped and not known):
            continue
        if not known and (name == "time" or parse_unit(column.unit or "") is None):
            left.append(column.label)
            continue
        if name in by_name:
            twice = [columns[by_name[name].place].label, column.label]
            raise ValueError(f"{twice[0]!r} and {twice[1]!r} are both {name!r}: name one of them in a mapping")
        by_name[name] = _choice(columns, place, Entry(name, column.label, None))
    return list(by_name.values()), left


def _find(columns: list[Column], entry: Entry) -> int:
    """The index of an entry's column, found by its label or else by its name without the unit."""
    for texts in ([column.label for column in columns], [column.name for column in columns]):
        places = [place for place, text in enumerate(texts) if text == entry.column]
        if len(places) > 1 and entry.unit is not None:
            wanted = parse_unit(entry.unit)
            places = [k for k in places if parse_unit(columns[k].unit or "") == wanted] or places
        if len(places) == 1:
            return places[0]
        if places:
            twice = _listed([columns[place].label for place in places])
            raise ValueError(f"{entry.source!r} for {entry.name} may be any of {twice}: give its unit as well")
    if entry.sign_from is not None:
        raise ValueError(f"sign_from of {entry.name} is for CAN logs, whose signals may have their sign in another one")
    names = [column.name for column in columns if "+" not in column.name]
    raise ValueError(f"no channel {entry.source!r} for {entry.name}; {did_you_mean(entry.source, names)}")


def _choice(columns: list[Column], place: int, entry: Entry, expected: str | None = None) -> _Choice:
    """A column for an entry; ValueError unless its unit is known and is ``expected`` in memory."""
    column = columns[place]
    text = column.unit if entry.unit is None else entry.unit
    found = parse_unit(text or "")
    remedy = f'[channels.{entry.name}] from = "{column.label}", unit = "..."'
    if found is None:
        problem = "names no unit" if not text else f"has the unit {text!r}, which is not known"
        allowed = "s, ms, us" if expected == "s" else spellings(expected or KNOWN.get(entry.name))
        raise ValueError(f"column {column.label!r} {problem}; give it in a mapping, {remedy}, with one of {allowed}")
    if found[0] not in (expected or found[0], COUNTS):
        raise ValueError(
            f"column {column.label!r} is in {text!r}, {entry.name} needs {expected!r}: correct it, {remedy}"
        )
    own = parse_unit(column.unit or "")
    if own and own[0] != found[0] and column.declares_unit:
        raise ValueError(
            f"column {column.label!r} is in {column.unit!r} by the file, but in {text!r} by the mapping: these are of "
            f"different quantities; map another column to {entry.name}, or correct the unit in the file"
        )
    return _Choice(place, entry.name, *found, entry)


def _value(choice: _Choice, raw: np.ndarray) -> np.ndarray:
    """The values in memory of readings in the unit of the file."""
    entry = choice.entry
    with np.errstate(over="ignore", invalid="ignore"):  # refused by who reads a number from it, see require_moderate
        return entry.sign * ((raw - entry.offset) * (entry.scale * choice.size))


def _samples(columns: list[Column], choice: _Choice, values: Values) -> np.ndarray:
    """The samples; ValueError with the reason if there are none."""
    if isinstance(values, str):
        raise ValueError(f"column {columns[choice.place].label!r}, wanted as {choice.name}, {values}")
    return values


def _listed(labels: list[str]) -> str:
    """The labels with commas; only the first ten of them."""
    more = f" and {len(labels) - MOST_NAMED} more" if len(labels) > MOST_NAMED else ""
    return ", ".join(labels[:MOST_NAMED]) + more
