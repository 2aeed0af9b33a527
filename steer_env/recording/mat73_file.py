"""What MATLAB v7.3 files hold, which are HDF5, with the package h5py: numbers, text and structures of these."""

import os
from os import PathLike
from typing import Any

import numpy as np

from steer_env.recording import own_process

SIGNATURE = b"\x89HDF\r\n\x1a\n"
USER_BLOCK = 512  # MATLAB's own header before the signature [bytes]


def is_hdf5(path: str | PathLike[str]) -> bool:
    """Whether a file is HDF5, with MATLAB's header or without."""
    with open(path, "rb") as file:
        start = file.read(USER_BLOCK + len(SIGNATURE))
    return start.startswith(SIGNATURE) or start[USER_BLOCK:] == SIGNATURE


def content(path: str | PathLike[str]) -> dict[str, Any]:
    """The variables by name: arrays without axes of length 1, text, and dicts for structures.

    Raises
    ------
    ValueError
        Without h5py, with the command that installs it; or if the file is damaged.
    """
    own_process.require("h5py", "MATLAB v7.3 files", "hdf5")
    return own_process.read("a MATLAB v7.3 file", _read_variables, os.fspath(path))


def _read_variables(path: str) -> dict[str, Any]:
    import h5py  # here, because it is an extra

    with h5py.File(path, "r") as file:
        return _variables(file, h5py.Dataset)


def _variables(group: Any, dataset: Any) -> dict[str, Any]:
    """The entries of a group except what MATLAB keeps for itself."""
    found: dict[str, Any] = {}
    for name, entry in group.items():
        if name.startswith("#") or "MATLAB_empty" in entry.attrs:
            continue
        if not isinstance(entry, dataset):
            found[name] = _variables(entry, dataset)
        elif entry.attrs.get("MATLAB_class") == b"char":
            found[name] = bytes(np.asarray(entry).T.astype("<u2")).decode("utf-16-le")
        elif entry.dtype.kind in "fiubO":  # O for cells, which are listed and not read
            found[name] = np.squeeze(np.asarray(entry))
    return found
