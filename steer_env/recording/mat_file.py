"""Recordings for MATLAB: one variable per channel, named as ``handwheel_angle_deg`` with its unit; JSON ``meta``.

Files are written as v5, which every MATLAB reads; v7.3, which is HDF5, is read with the extra ``hdf5``. Files from
other programs may hold the channels in a structure; the names in nested structures are joined by dots.
"""

import json
import os
import re
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import IO, Any

import numpy as np

from steer_env.recording import mat73_file, own_process
from steer_env.recording.table import Table, Values, column, gaps, label, meta_in

LONGEST_NAME = 63  # longest name of a MATLAB variable [characters]


def save(
    file: IO[bytes], time: np.ndarray, channels: list[tuple[str, str, np.ndarray]], meta: Mapping[str, Any]
) -> None:
    """Write the channels (name, unit in memory, values in file units) as column vectors."""
    from scipy import io  # here, because few programs need it

    variables: dict[str, Any] = {"time_s": time}
    for name, unit, values in channels:
        variable = label(name, unit)
        if not re.fullmatch(r"[A-Za-z]\w*", variable, re.ASCII) or len(variable) > LONGEST_NAME:
            raise ValueError(f"channel {name!r} in {unit!r} cannot be a variable in MATLAB: rename the channel")
        variables[variable] = values
    io.savemat(file, {**variables, "meta": json.dumps(dict(meta))}, oned_as="column")


def open_table(path: str | PathLike[str]) -> Table:
    """Open a file; every vector of numbers in it is a column, and the time is one of them."""
    if mat73_file.is_hdf5(path):
        content = mat73_file.content(path)
    else:
        content = own_process.read("a MATLAB file", _before_73, os.fspath(path))
    content = {name: value for name, value in content.items() if not name.startswith("__")}
    while len(content) == 1 and isinstance(next(iter(content.values())), dict):
        content = next(iter(content.values()))
    vectors = list(_vectors(content, ""))
    meta = meta_in(content.get("meta"))

    def load(places: Sequence[int]) -> list[Values]:
        size = vectors[places[0]][1].size
        return [_samples(meta, *vectors[place], size) for place in places]

    return Table([column(name) for name, _ in vectors], meta, True, load)


def _before_73(path: str) -> dict[str, Any]:
    """The variables of a file before v7.3 by name."""
    from scipy import io

    found: dict[str, Any] = io.loadmat(path, simplify_cells=True, appendmat=False)
    return found


def _samples(meta: dict[str, Any], name: str, values: np.ndarray, size: int) -> Values:
    if values.dtype.kind not in "fiub":
        return "holds no plain numbers"
    return (
        gaps(meta, name, values.astype(float)) if values.size == size else f"has {values.size} samples, time has {size}"
    )


def _vectors(content: dict[str, Any], above: str) -> list[tuple[str, np.ndarray]]:
    """Name and values of every vector, ``above`` being the joined names of the structures around it."""
    found = []
    for name, value in content.items():
        if isinstance(value, dict):
            found += _vectors(value, f"{above}{name}.")
        elif isinstance(value, np.ndarray) and value.ndim == 1 and value.size > 1:
            found.append((above + name, value))
    return found
