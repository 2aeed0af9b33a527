"""Recordings as Apache Parquet, with the package pyarrow: columns named as in text, ``handwheel_angle_deg``; JSON meta.

Files from other programs may name the unit in brackets, as a suffix, or under ``unit`` in the metadata of the column. A
column of time stamps is read as the seconds since the first.
"""

import json
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import IO, Any

import numpy as np

from steer_env.recording.table import Column, Table, Values, column, label

META = b"steer-env"  # key of the file's metadata


def save(
    file: IO[bytes], time: np.ndarray, channels: list[tuple[str, str, np.ndarray]], meta: Mapping[str, Any]
) -> None:
    """Write the channels (name, unit in memory, values in file units) in double precision."""
    arrow, parquet = _pyarrow()
    columns = {"time_s": time} | {label(name, unit): values for name, unit, values in channels}
    table = arrow.table({name: arrow.array(values) for name, values in columns.items()})
    parquet.write_table(table.replace_schema_metadata({META: json.dumps(dict(meta))}), file)


def open_table(path: str | PathLike[str]) -> Table:
    """Read the names and the meta; the table's ``load`` reads the columns."""
    _, parquet = _pyarrow()
    try:
        schema = parquet.read_schema(path)
    except Exception as error:  # damaged files raise exceptions of several types
        raise _damaged(error) from None
    columns = [_column(field) for field in schema]

    def load(places: Sequence[int]) -> list[Values]:
        names = [columns[place].label for place in places]
        try:
            table = parquet.read_table(path, columns=names)
            found = [table[name].to_numpy() for name in names]
        except Exception as error:
            raise _damaged(error) from None
        return [_numbers(values) for values in found]

    try:
        meta = json.loads((schema.metadata or {}).get(META, b"{}"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"its meta {META.decode()} is no JSON: {error}") from None
    return Table(columns, meta, True, load)


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        from pyarrow import parquet  # here, because it is an extra
    except ImportError:
        raise ValueError("Parquet files need the package pyarrow: pip install '.[parquet]'") from None
    return pyarrow, parquet


def _damaged(error: Exception) -> ValueError:
    return ValueError(f"cannot be read as a Parquet file ({str(error).splitlines()[0]}); is it complete?")


def _column(field: Any) -> Column:
    unit = (field.metadata or {}).get(b"unit", b"").decode()
    if str(field.type).startswith(("timestamp", "duration")):
        unit = "s"
    return Column(field.name, field.name, unit) if unit else column(field.name)


def _numbers(values: np.ndarray) -> Values:
    """The samples of a column; time stamps in seconds since the first."""
    if values.dtype.kind == "M":
        values = values - values[0]
    if values.dtype.kind == "m":
        return values / np.timedelta64(1, "s")
    return values.astype(float) if values.dtype.kind in "fiub" else "holds no plain numbers"
