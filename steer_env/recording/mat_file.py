"""Recordings for MATLAB (v5): a variable a channel that names its unit, ``handwheel_angle_deg``, and ``meta`` as JSON.

Files from elsewhere may hold the channels in a structure; below more than one, names are joined by dots.
"""

import json
import re
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import IO, Any

import numpy as np

from steer_env.recording.table import Table, Values, column, label

LONGEST_NAME = 63  # of a MATLAB variable


def save(
    file: IO[bytes], time: np.ndarray, channels: list[tuple[str, str, np.ndarray]], meta: Mapping[str, Any]
) -> None:
    """Write name, unit in memory and values in file units of each channel, as columns."""
    from scipy import io  # here, for few need it

    variables: dict[str, Any] = {"time_s": time}
    for name, unit, values in channels:
        variable = label(name, unit)
        if not re.fullmatch(r"[A-Za-z]\w*", variable, re.ASCII) or len(variable) > LONGEST_NAME:
            raise ValueError(f"channel {name!r} in {unit!r} cannot be a variable in MATLAB: rename the channel")
        variables[variable] = values
    io.savemat(file, {**variables, "meta": json.dumps(dict(meta))}, oned_as="column")


def open_table(path: str | PathLike[str]) -> Table:
    """Every vector of numbers in the file is a column; the time is one of them."""
    from scipy import io

    try:
        content = io.loadmat(path, simplify_cells=True, appendmat=False)
    except NotImplementedError:
        raise ValueError(
            "this is a MATLAB v7.3 file, v5 to v7 can be read; in MATLAB save it with save(name, '-v7')"
        ) from None
    except Exception as error:  # of damaged files, of as many types as there are parts to damage
        raise ValueError(f"cannot be read as a MATLAB file ({error}); is it complete?") from None
    content = {name: value for name, value in content.items() if not name.startswith("__")}
    while len(content) == 1 and isinstance(next(iter(content.values())), dict):
        content = next(iter(content.values()))
    vectors = dict(_vectors(content, ""))

    def load(places: Sequence[int]) -> list[Values]:
        chosen = [list(vectors.values())[place] for place in places]
        size = chosen[0].size
        return [v.astype(float) if v.size == size else f"has {v.size} samples, time has {size}" for v in chosen]

    return Table([column(name) for name in vectors], _meta(content.get("meta")), True, load)


def _vectors(content: dict[str, Any], above: str) -> list[tuple[str, np.ndarray]]:
    found = []
    for name, value in content.items():
        if isinstance(value, dict):
            found += _vectors(value, f"{above}{name}.")
        elif isinstance(value, np.ndarray) and value.ndim == 1 and value.size > 1 and value.dtype.kind in "fiub":
            found.append((above + name, value))
    return found


def _meta(text: Any) -> dict[str, Any]:
    try:
        meta = json.loads(text)
    except (TypeError, ValueError):
        return {}
    return meta if isinstance(meta, dict) else {}
