"""Recordings as Apache Parquet, with the package pyarrow: columns named as in text, ``handwheel_angle_deg``; JSON meta.

Files from other programs may name the unit in brackets, as a suffix, or under ``unit`` in the metadata of the column. A
column of time stamps is read as the seconds since the first.
"""

import json
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import IO, Any

import numpy as np

from steer_env.recording import own_process
from steer_env.recording.table import Table, Values, column, gaps, label

META = b"steer-env"  # key of the file's metadata


def save(
    file: IO[bytes], time: np.ndarray, channels: list[tuple[str, str, np.ndarray]], meta: Mapping[str, Any]
) -> None:
    """Write the channels (name, unit in memory, values in file units) in double precision."""
    own_process.require("pyarrow", "Parquet files", "parquet")
    import pyarrow  # here, because it is an extra
    from pyarrow import parquet

    columns = {"time_s": time} | {label(name, unit): values for name, unit, values in channels}
    table = pyarrow.table({name: pyarrow.array(values) for name, values in columns.items()})
    parquet.write_table(table.replace_schema_metadata({META: json.dumps(dict(meta))}), file)


def open_table(path: str | PathLike[str]) -> Table:
    """Read the names and the meta; the table's ``load`` reads the columns."""
    own_process.require("pyarrow", "Parquet files", "parquet")
    from pyarrow import parquet, types  # here, because it is an extra

    try:
        schema = parquet.read_schema(path)
    except Exception as error:  # damaged files raise exceptions of several types
        raise _damaged(error) from None
    columns = [column(field.name, _unit(field)) for field in schema]

    def load(places: Sequence[int]) -> list[Values]:
        names = [columns[place].label for place in places]
        try:
            # Two columns of one name are read by their places, which needs the whole file.
            twice = len({each.label for each in columns}) < len(columns)
            table = parquet.ParquetFile(path).read(None if twice else names)
            found = [table[place if twice else columns[place].label] for place in places]
            for k, each in enumerate(found):
                exact = types.is_decimal(each.type) or types.is_boolean(each.type)  # objects to numpy
                found[k] = (each.cast("float64") if exact else each).to_numpy()
        except Exception as error:
            raise _damaged(error) from None
        return [_numbers(meta, *pair) for pair in zip(names, found)]

    text = (schema.metadata or {}).get(META, b"{}").decode(errors="replace")
    try:
        meta = json.loads(text)
    except (ValueError, RecursionError):
        meta = None
    if not isinstance(meta, dict):
        raise ValueError(f"its meta {META.decode()} is no JSON object, but {text[:80]!r}")
    return Table(columns, meta, True, load)


def _damaged(error: Exception) -> ValueError:
    return ValueError(f"cannot be read as a Parquet file ({str(error).splitlines()[0]}); is it complete?")


def _unit(field: Any) -> str:
    """The unit that stands apart from the name of a column; empty if there is none."""
    stamps = str(field.type).startswith(("timestamp", "duration"))
    return "s" if stamps else (field.metadata or {}).get(b"unit", b"").decode()


def _numbers(meta: dict[str, Any], name: str, values: np.ndarray) -> Values:
    """The samples of a column; time stamps in seconds since the first."""
    if values.dtype.kind == "M":
        values = values - values[0]
    if values.dtype.kind == "m":
        values = values / np.timedelta64(1, "s")
    return gaps(meta, name, values.astype(float)) if values.dtype.kind in "fiub" else "holds no plain numbers"
