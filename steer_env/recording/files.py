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

from steer_env.friction.numerics.check import did_you_mean
from steer_env.recording import can_log, csv_file, mat_file, mdf_file, parquet_file
from steer_env.recording import channel_mapping as mappings
from steer_env.recording.channel_mapping import KNOWN, Entry, Mapping
from steer_env.recording.recording import Recording
from steer_env.recording.table import TIMING, Column, Table, Values, last_of_each_time, time_column
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
    column: Column
    unit: str  # unit in memory
    size: float  # value in memory of one unit of the file [unit in memory]
    entry: Entry
    assumed: bool = False  # whether it is the time by its name and in seconds, as nothing says a unit


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
    ``seconds_assumed`` tells. What is no value is a gap, which ``no_value`` counts; of samples that share a time stamp
    the last is kept, and ``doubled_stamps`` counts the others; ``timing_error_s`` has the channels of a CAN log whose
    time is known less well than that of the others (:mod:`steer_env.recording.table`). Where the mapping gives a
    channel a delay, all channels are trimmed to the time that remains.

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
        table = open_file(path, can, [entry.column for entry in mapping.channels.values()])
        if "time" in mapping.channels and not table.timed:
            raise ValueError("this format has a time base of its own: remove [channels.time] from the mapping")
        time = [_time(table.columns, mapping)] if table.timed else []
        choices, left = _choose(table.columns, mapping, time)
        instants, *loaded = table.load([choice.place for choice in time + choices])
        for choice in time:
            instants = _instants(choice, instants)
            kept = last_of_each_time(table.meta, choice.column.label, instants)
            instants, loaded = instants[kept], [v if isinstance(v, str) else v[kept] for v in loaded]
        channels, units = {}, {}
        for choice, values in zip(choices, loaded):
            entry, name, label = choice.entry, choice.entry.name, choice.column.label
            if isinstance(values, str):
                if name in KNOWN or name in mapping.channels:
                    raise ValueError(f"column {label!r}, wanted as {name}, {values}")
                left.append(label)
            elif np.isnan(values).all():
                left.append(f"{label} (no values)")
            else:
                units[name] = choice.unit
                with np.errstate(over="ignore", invalid="ignore"):  # of what :func:`require_moderate` refuses
                    channels[name] = entry.sign * ((values - entry.offset) * (entry.scale * choice.size))
        if TIMING in table.meta and can_log.is_can_log(path, can):
            names = {choice.column.label: choice.entry.name for choice in choices}
            for each in table.meta[TIMING]:
                each["channels"] = [names[label] for label in each["channels"]]
        if left and not channels:
            raise ValueError(
                f"none of the columns {_list_labels(left)} can be read: each needs numbers and a unit ({SPELLINGS}); "
                "name those that are wanted, and their units, in a mapping"
            )
        uncalibrated = [name for name, unit in units.items() if unit == COUNTS]
        assumed = [choice.column.label for choice in time if choice.assumed]
        told = {"not_read": left, "uncalibrated": uncalibrated, "seconds_assumed": assumed}
        meta = {**table.meta, **{key: _list_labels(each) for key, each in told.items() if each}, **mapping.meta}
        recording = Recording(np.asarray(instants), channels, units, meta)
        for choice in choices:
            if choice.entry.delay and choice.entry.name in channels:
                recording = recording.delayed(choice.entry.name, -choice.entry.delay)
        return recording
    except ValueError as error:
        raise ValueError(f"{_source_words(path, can)}: {error}") from None


def _source_words(path: str | os.PathLike[str], can: can_log.Options | None) -> str:
    """A file in messages, with the databases that a CAN log is read with."""
    if can is None or not can.dbc or not can_log.is_can_log(path, can):
        return str(path)
    return f"{path} with {', '.join(map(str, can_log.database_paths(can.dbc)))}"


def open_file(path: str | os.PathLike[str], can: can_log.Options | None = None, sources: Sequence[str] = ()) -> Table:
    """A file as its format opens it; ``sources`` may name sums of signals of a CAN log.

    Raises
    ------
    ValueError
        If the file cannot be read.
    OSError
        If the file cannot be opened.
    """
    form = None if can_log.is_can_log(path, can) else _format(path)
    with open(path, "rb"):  # the readers of the formats report a missing file in different ways
        pass
    if form is None:
        return can_log.open_table(path, can or can_log.Options(), sources)
    table: Table = form.open_table(path)
    if table.columns and all(column.label.startswith(can_log.BUS) for column in table.columns):
        raise ValueError("it holds raw frames of a bus: give the DBC that says what is in them, --dbc car.dbc")
    return table


def write(recording: Recording, path: str | os.PathLike[str], *, digits: int | None = None, decimal: str = ".") -> None:
    """Write a recording to a file, whose suffix gives the format.

    The recording is written to a file beside ``path``, which is then renamed, so ``path`` is never incomplete.

    Parameters
    ----------
    recording : Recording
    path : str or path
    digits : int, optional
        Significant digits of the values in the file's units, which make a text file smaller; by default all of them.
        The time, to the nanosecond then, and the meta are not rounded to them.
    decimal : str
        Decimal sign of a .csv, "." or ","; with a comma the columns are separated by semicolons.

    Raises
    ------
    ValueError
        If the suffix is none of ``FORMATS``, or if the format cannot hold a channel's name or the decimal sign.
    """
    path = Path(path)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        if csv_file.is_compressed(path):
            raise ValueError(f"{csv_file.COMPRESSED} is read, not written: write a .csv, and compress it with gzip")
        form = _format(path)
        if decimal != "." and form is not csv_file:
            raise ValueError(f"the decimal sign {decimal!r} is of .csv files: give such a file, or leave it out")
        if decimal not in csv_file.SEPARATORS:
            raise ValueError(f"the decimal sign must be one of {', '.join(csv_file.SEPARATORS)}, got {decimal!r}")
        channels = [
            (name, recording.units[name], _round(values / FILE_UNITS[recording.units[name]][1], digits))
            for name, values in recording.channels.items()
        ]
        time = recording.time if digits is None else np.round(recording.time, 9)
        with open(part, "w+b") as file:
            form.save(file, time, channels, recording.meta, **({"decimal": decimal} if form is csv_file else {}))
        os.replace(part, path)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    except OSError as error:  # a full disk has no name
        error.filename = error.filename or str(path)
        raise
    finally:
        part.unlink(missing_ok=True)


def _round(values: np.ndarray, digits: int | None) -> np.ndarray:
    """The numbers nearest to those with so many significant digits."""
    return values if digits is None else np.array([float(f"{value:.{digits}g}") for value in values.tolist()])


def _format(path: str | os.PathLike[str]) -> Any:
    """The module for a file's suffix."""
    suffix = ".csv" if csv_file.is_compressed(path) else Path(path).suffix.lower()
    if suffix not in FORMATS:
        if Path(path).name.lower().endswith(can_log.SUFFIXES):
            raise ValueError(f"a CAN log is not written; recordings end in {', '.join(FORMATS)}")
        raise ValueError(f"recordings end in {', '.join([*FORMATS, *can_log.SUFFIXES])}, got {suffix!r}")
    return FORMATS[suffix]


def _time(columns: list[Column], mapping: Mapping) -> _Choice:
    """The column of the time: that of the mapping, else one called time or t, else the first if it is in seconds."""
    if "time" in mapping.channels:
        return _choice(columns, mapping.channels["time"], "s")
    place = time_column(columns)
    if place is None:
        raise ValueError(
            f"no time among the columns {_list_labels([column.label for column in columns])}: expected time_s or "
            'Time [s], or a mapping with [channels.time] from = "...", unit = "s"'
        )
    return _choice(columns, Entry("time", columns[place].label, None), "s", place)


def _instants(choice: _Choice, values: Values) -> np.ndarray:
    """The samples of the time [s]; ValueError for one without a unit whose steps are too long for seconds."""
    label = choice.column.label
    if isinstance(values, str):
        raise ValueError(f"column {label!r}, wanted as time, {values}")
    instants = values * choice.size
    if choice.assumed:
        step = float(np.median(np.diff(instants)))
        if not step <= LONGEST_STEP:
            raise ValueError(
                f"column {label!r} names no unit, and its steps of {step:g} are too long for seconds: give its "
                f'unit in a mapping, [channels.time] from = "{label}", unit = "ms" (or "us", "s")'
            )
    return instants


def _choose(columns: list[Column], mapping: Mapping, time: list[_Choice]) -> tuple[list[_Choice], list[str]]:
    """The columns to read beside the time, and the labels of those that are left out because of their unit."""
    mapped = [_choice(columns, entry, KNOWN.get(name)) for name, entry in mapping.channels.items() if name != "time"]
    by_name = {choice.entry.name: choice for choice in mapped}
    used = [choice.place for choice in time + mapped]
    left = []
    for place, column in enumerate(columns):
        name = column.name
        known = name in KNOWN
        if place in used or name in mapping.channels or (mapped and not known):
            continue
        if not known and (name == "time" or column.known is None):
            left.append(column.label)
            continue
        if name in by_name:
            twice = [by_name[name].column.label, column.label]
            raise ValueError(f"{twice[0]!r} and {twice[1]!r} are both {name!r}: name one of them in a mapping")
        by_name[name] = _choice(columns, Entry(name, column.label, None), None, place)
    return list(by_name.values()), left


def _find(columns: list[Column], entry: Entry, unit: tuple[str, float] | None) -> int:
    """The index of an entry's column, found by its label or else by its name without the unit."""
    for texts in ([column.label for column in columns], [column.name for column in columns]):
        places = [place for place, text in enumerate(texts) if text == entry.column]
        if len(places) > 1 and unit is not None:
            places = [place for place in places if columns[place].known == unit] or places
        if len(places) == 1:
            return places[0]
        if places:
            twice = _list_labels([columns[place].label for place in places])
            raise ValueError(f"{entry.source!r} for {entry.name} may be any of {twice}: give its unit as well")
    if entry.sign_from is not None:
        raise ValueError(f"sign_from of {entry.name} is for CAN logs, whose signals may have their sign in another one")
    names = [column.name for column in columns if "+" not in column.name]
    raise ValueError(f"no channel {entry.source!r} for {entry.name}; {did_you_mean(entry.source, names)}")


def _choice(columns: list[Column], entry: Entry, expected: str | None, place: int | None = None) -> _Choice:
    """A column for an entry; ValueError unless its unit is known and is ``expected`` in memory."""
    given = None if entry.unit is None else parse_unit(entry.unit)
    place = _find(columns, entry, given) if place is None else place
    column = columns[place]
    if column.is_time and expected == "s" and column.unit is None and entry.unit is None:
        return _Choice(place, column, "s", 1.0, entry, assumed=True)
    text, found = (column.unit, column.known) if entry.unit is None else (entry.unit, given)
    remedy = f'[channels.{entry.name}] from = "{column.label}", unit = "..."'
    if found is None:
        problem = "names no unit" if not text else f"has the unit {text!r}, which is not known"
        allowed = "s, ms, us" if expected == "s" else spellings(expected or KNOWN.get(entry.name))
        raise ValueError(f"column {column.label!r} {problem}; give it in a mapping, {remedy}, with one of {allowed}")
    if found[0] not in (expected or found[0], COUNTS):
        raise ValueError(
            f"column {column.label!r} is in {text!r}, {entry.name} needs {expected!r}: correct it, {remedy}"
        )
    if column.known and column.known[0] != found[0] and column.declares_unit:
        raise ValueError(
            f"column {column.label!r} is in {column.unit!r} by the file, but in {text!r} by the mapping: these are of "
            f"different quantities; map another column to {entry.name}, or correct the unit in the file"
        )
    return _Choice(place, column, *found, entry)


def _list_labels(labels: list[str]) -> str:
    """The labels with commas; only the first ten of them."""
    more = f" and {len(labels) - MOST_NAMED} more" if len(labels) > MOST_NAMED else ""
    return ", ".join(labels[:MOST_NAMED]) + more
