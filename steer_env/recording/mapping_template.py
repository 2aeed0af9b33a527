"""A mapping to fill in: the channels that are wanted, and every column of a file with its unit and range."""

import json
from collections.abc import Mapping
from os import PathLike

import numpy as np

from steer_env.recording import can_log, files
from steer_env.recording.table import Column, Table, Values
from steer_env.recording.units import file_unit, parse_unit

HEAD = """\
# How to read {name}. Remove the # of the lines that apply, and fill in the name that the channel has in the file.
# value in SI = sign * scale * (reading - offset) in the unit; a channel that is late by delay_ms is moved back.
# The unit "counts" is that of a sensor without a calibration; signals of a CAN message may be added, "A + B".
"""


def text(path: str | PathLike[str], channels: Mapping[str, str], can: can_log.Options | None = None) -> str:
    """The text of a mapping file, in which every line is a comment until it is filled in.

    Parameters
    ----------
    path : str or path
        The recorded file.
    channels : mapping of str to str
        Name and unit in memory of the channels that are wanted.
    can : can_log.Options, optional
        As for :func:`steer_env.recording.files.read`.

    Raises
    ------
    ValueError
        If the file cannot be read; the message names it.
    OSError
        If the file cannot be opened.
    """
    try:
        table = files.opened(path, can)
        values = _values(table)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    found = {column: _told(column, samples) for column, samples in zip(table.columns, values)}
    lines = [HEAD.format(name=path)]
    for name, unit in channels.items():
        fitting = [entry for entry in found if (parse_unit(entry.unit or "") or ("",))[0] == unit]
        lines.append(f"# [channels.{name}]")
        lines += [f"# from = {_quoted(entry)}  # {found[entry]}" for entry in fitting] or ['# from = ""']
        lines += [
            f'# unit = "{file_unit(unit)}"',
            "# sign = 1",
            "# scale = 1.0",
            "# offset = 0.0",
            "# delay_ms = 0",
            "",
        ]
    lines += ["# [meta]", '# manoeuvre = ""', "# speed_m_s = ", "", "# Every column of the file:"]
    lines += [f"# {_quoted(entry)}: {told}" for entry, told in found.items()]
    return "\n".join(lines) + "\n"


def _values(table: Table) -> list[Values]:
    """The samples of every column."""
    every = range(len(table.columns))
    return table.load(every) if table.timed else table.load(every)[1:]


def _told(column: Column, values: Values) -> str:
    """The unit with the smallest and the largest value, or why there is none."""
    if isinstance(values, str):
        return values
    if np.isnan(values).all():
        return "has no values"
    return f"{column.unit or 'no unit'}, {np.nanmin(values):.6g} to {np.nanmax(values):.6g}"


def _quoted(entry: Column) -> str:
    """The label as a TOML string, which JSON's is as well."""
    return json.dumps(entry.label, ensure_ascii=False)
