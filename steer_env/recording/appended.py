"""A recording that grows in its file while it is made: what was written stays, also where the program is killed."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from steer_env.recording import csv_file
from steer_env.recording.units import FILE_UNITS

_TIME, _VALUE = "%.6f", ",%.7g"  # to the microsecond; seven significant digits, as `steer-env run` writes


class Appended:
    """A new CSV file to which rows are added.

    Rows reach the operating system whole and at once, so that they outlive the program. Where the machine stops or the
    disk is full, the last line may be cut off; readers leave it out, and say so.

    Parameters
    ----------
    path : path
        Of a file that does not exist yet.
    channels : sequence of (name, unit)
        Units as of :class:`steer_env.recording.Recording`.
    meta : mapping
        As of a recording.

    Raises
    ------
    FileExistsError
        There is such a file; it stays as it is.
    OSError
        The file cannot be made.
    ValueError
        A channel whose name cannot be that of a column.
    """

    def __init__(self, path: Path, channels: Sequence[tuple[str, str]], meta: Mapping[str, Any]) -> None:
        head = csv_file.head(channels, {**meta, csv_file.APPENDED: True})
        self._sizes = [FILE_UNITS[unit][1] for _, unit in channels]
        self._row = _TIME + _VALUE * len(channels) + "\n"
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o666)
        self._write(head)

    def add(self, time: NDArray[Any], values: NDArray[Any]) -> None:
        """Add rows at times (N,) [s], later than those before, with the values (N, C) in SI units.

        Raises
        ------
        OSError
            The file takes no more.
        """
        rows = (values / self._sizes).tolist()
        self._write("".join([self._row % (t, *row) for t, row in zip(time.tolist(), rows)]).encode())

    def _write(self, text: bytes) -> None:
        while text:
            text = text[os.write(self._file, text) :]

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)
