"""What a drive keeps: every sample, thinned, in a file that grows, and the last seconds for the window.

The loop gives a sample each millisecond. A row of the file is the mean of five of them, at their middle: it delays no
channel against another, and takes 0.4 % of an amplitude at 10 Hz, above what the metrics read. The time is that of the
simulation, which stays behind the clock where deadlines are missed; how many were missed stands beside it.

A recording that grows in its file while it is made: what was written stays, also where the program is killed.
"""

import math
import os
import re
from collections import deque
from collections.abc import Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.live.real_time.recorder import RECORD_HEAD, Recorder
from steer_env.recording import csv_file
from steer_env.recording.units import FILE_UNITS
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.subsystems import Subsystem

_TIME_FORMAT, _VALUE_FORMAT = "%.6f", ",%.7g"  # to the microsecond; seven significant digits, as `steer-env run` writes


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
        self._row = _TIME_FORMAT + _VALUE_FORMAT * len(channels) + "\n"
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


Array = NDArray[np.float64]

SAMPLES = 5  # in a row of the file
SECONDS, SPACING = 10.0, 0.01  # that the window shows, and the time between two of its points [s]
HISTORY = ("x", "y", "yaw_angle", "handwheel_angle", "torsion_bar_torque", "chosen_set")  # that the window shows
_FILE_NAME = re.compile(r"drive-(\d+)\.csv")
# Columns of the recorder that are kept under other names, as channels of the car have theirs, with units.
OWN_COLUMNS = {
    "missed": ("deadlines_missed", "1"),
    "set": ("chosen_set", "1"),
    "share": ("share_of_next_set", "1"),
    "motor_torque": ("wheel_torque", "N m"),
    "phase": ("watchdog_phase", "1"),
    "gain": ("watchdog_gain", "1"),
}
SUMS, LAST = ("deadlines_missed",), ("chosen_set", "watchdog_phase")  # of which a row has no mean
INPUTS = ("target_speed", "throttle_request", "brake_request", "coast")  # that no channel of the car shows


class Column(NamedTuple):
    """A channel of the recording, and where it stands in a sample."""

    name: str
    unit: str
    place: int


def recorded_columns(subsystem: Subsystem, recorder: Recorder) -> list[Column]:
    """The channels that a recording has of the samples of a subsystem."""
    units = [*[""] * len(RECORD_HEAD), *(signal.unit for signal in (*subsystem.given, *subsystem.outputs))]
    first = len(RECORD_HEAD) + len(subsystem.given)
    found = []
    for place, (name, unit) in enumerate(zip(recorder.columns, units)):
        if place < len(RECORD_HEAD):
            if name in OWN_COLUMNS:
                found.append(Column(*OWN_COLUMNS[name], place))
        elif place >= first or name in INPUTS:
            found.append(Column(name, unit, place))
    return found


def new_file(folder: Path, columns: Sequence[Column], meta: Mapping[str, Any]) -> tuple[Path, Appended]:
    """A new file in a folder, which is made if it is missing; none is ever overwritten.

    Raises
    ------
    OSError
        The folder cannot be made, or takes no file; says so and what to do.
    """
    channels = [*((column.name, column.unit) for column in columns), ("vehicle_speed", "m/s")]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        numbers = [int(found[1]) for entry in folder.iterdir() if (found := _FILE_NAME.fullmatch(entry.name))]
        for number in count(max(numbers, default=0) + 1):
            path = folder / f"drive-{number:04d}.csv"
            try:
                return path, Appended(path, channels, meta)
            except FileExistsError:  # of another drive that has begun just now
                continue
            except OSError:
                path.unlink(missing_ok=True)  # a full disk takes an empty file
                raise
    except OSError as error:
        raise OSError(f"no recording can be written to {folder} ({error.strerror}): choose another directory") from None
    raise AssertionError("unreachable: the numbers do not end")


class Log:
    """Takes the samples of a loop as they come.

    Parameters
    ----------
    columns : sequence of Column
    file : Appended, optional
        From :func:`new_file` with the same columns.

    Attributes
    ----------
    samples : int
        So far, with those that were lost.
    speed : float
        Forward speed at the last row, NaN before the second [m/s].
    """

    def __init__(self, columns: Sequence[Column], file: Appended | None = None) -> None:
        names = [column.name for column in columns]
        self._file, self._places = file, [column.place for column in columns]
        self._sums, self._last = ([names.index(name) for name in which] for which in (SUMS, LAST))
        self._pose, self._shown = ([names.index(name) for name in which] for which in (HISTORY[:3], HISTORY))
        self._configuration = names.index("chosen_set")
        self._rest = np.zeros((0, 1 + len(names)))
        self._history: deque[Array] = deque(maxlen=round(SECONDS / SPACING))
        self._before: Array | None = None  # time, x, y of the last row
        self._next = -math.inf  # time of the next point of the history [s]
        self.samples, self.speed = 0, math.nan

    def add(self, samples: Array, lost: int) -> None:
        """Take samples (N, K) of a recorder, and how many were lost behind them.

        Raises
        ------
        OSError
            The file takes no more.
        """
        time = SAMPLE_TIME * (1.0 + self.samples + np.arange(len(samples)))
        self.samples += len(samples) + lost
        samples = np.concatenate([self._rest, np.column_stack([time, samples[:, self._places]])])
        whole = len(samples) // SAMPLES * SAMPLES
        if self._before is None and whole == SAMPLES:
            whole = 0  # the first speed needs two rows
        self._rest = samples[whole:]
        if whole:
            self._add(samples[:whole].reshape(-1, SAMPLES, samples.shape[1]))

    def _add(self, groups: Array) -> None:
        time, values = groups[..., 0].mean(axis=1), groups[..., 1:]
        rows = values.mean(axis=1)
        rows[:, self._sums] = values[..., self._sums].sum(axis=1)
        rows[:, self._last] = values[:, -1, self._last]
        rows[:, self._configuration] += 1.0  # as the keys count
        speeds = self._speeds(time, rows[:, self._pose])
        if self._file is not None:
            self._file.add(time, np.column_stack([rows, speeds]))
        for t, row in zip(time.tolist(), rows):
            if t >= self._next:
                self._history.append(row[self._shown])
                self._next = t + SPACING - 0.5 * SAMPLES * SAMPLE_TIME

    def _speeds(self, time: Array, pose: Array) -> Array:
        """Forward speeds (N,) from the way since the row before [m/s]: not every chassis reports its speed."""
        way = np.column_stack([time, pose[:, :2]])
        start = 2.0 * way[:1] - way[1:2] if self._before is None else self._before[None]
        dt, dx, dy = np.diff(np.concatenate([start, way]), axis=0).T
        speeds = np.asarray((dx * np.cos(pose[:, 2]) + dy * np.sin(pose[:, 2])) / dt)
        self._before, self.speed = way[-1], float(speeds[-1])
        return speeds

    def history(self) -> Array:
        """The last seconds (N, H) of the channels ``HISTORY``, an array of the caller's own."""
        return np.array(list(self._history)).reshape(-1, len(self._shown))

    def close(self) -> None:
        """Close the file; fewer than five samples at the end are left out."""
        if self._file is not None:
            self._file.close()
