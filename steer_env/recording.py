"""A recording: named channels over one time base, simulated or measured, in memory and as a CSV file.

In memory everything is SI with angles in radians. A file carries degrees for angles and SI for the
rest, and every column names its unit: ``time_s,handwheel_angle_deg,handwheel_torque_Nm,...``.
"""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

DEGREE = np.pi / 180

# Unit in memory -> (suffix of the file's column, value in memory of one file unit).
FILE_UNITS = {
    "rad": ("deg", DEGREE),
    "rad/s": ("deg_s", DEGREE),
    "rad/s2": ("deg_s2", DEGREE),
    "m": ("m", 1.0),
    "m/s": ("m_s", 1.0),
    "m/s2": ("m_s2", 1.0),
    "1/m": ("1_m", 1.0),
    "s": ("s", 1.0),
    "N": ("N", 1.0),
    "N m": ("Nm", 1.0),
    "W": ("W", 1.0),
    "J": ("J", 1.0),
    "A": ("A", 1.0),
    "V": ("V", 1.0),
    "K": ("K", 1.0),
    "1": ("1", 1.0),
}
_LONGEST_SUFFIX_FIRST = sorted(((s, unit) for unit, (s, _) in FILE_UNITS.items()), key=lambda pair: -len(pair[0]))

ORDER = 2  # of the low-pass; run forwards and backwards it attenuates like order 4, without phase
SAMPLES_PER_CUTOFF = 4.0  # slowest sampling rate, as a multiple of the cutoff


@dataclass(frozen=True, eq=False)
class Recording:
    """Channels sampled at common instants; the arrays are read-only copies, so a recording does not change.

    Parameters
    ----------
    time : (T,) array, T >= 2
        Strictly ascending [s]; not necessarily uniform.
    channels : mapping of str to (T,) array
        In SI with angles in radians, signs after ISO 8855, left positive. Gaps are NaN.
    units : mapping of str to str
        Unit of each channel, a key of ``FILE_UNITS``.
    meta : mapping of str to str, int, float, bool or None
        How the recording came about: manoeuvre, friction law, speed, ... with the unit in the key.

    Raises
    ------
    ValueError
        If the lengths differ, the time is not finite and ascending, or a unit or meta value is not known.
    """

    time: np.ndarray
    channels: Mapping[str, np.ndarray]
    units: Mapping[str, str]
    meta: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        time = _frozen(self.time, "time")
        if time.size < 2 or not np.all(np.isfinite(time)):
            raise ValueError(f"time needs at least two samples, all finite; got {time.size} samples")
        if np.any(np.diff(time) <= 0):
            k = int(np.argmax(np.diff(time) <= 0)) + 1
            raise ValueError(f"time must ascend strictly; sample {k} is {time[k]} s after {time[k - 1]} s")
        channels = {name: _frozen(values, name) for name, values in self.channels.items()}
        for name, values in channels.items():
            if values.size != time.size:
                raise ValueError(f"channel {name!r} has {values.size} samples, time has {time.size}")
        if "time" in channels:
            raise ValueError("no channel may be called 'time': that is the time base")
        if set(self.units) != set(channels):
            raise ValueError(f"units must name the channels {sorted(channels)}; got {sorted(self.units)}")
        for name, unit in self.units.items():
            if unit not in FILE_UNITS:
                raise ValueError(f"channel {name!r} has unit {unit!r}; known units are {list(FILE_UNITS)}")
        for key, value in self.meta.items():
            if not key or key != key.strip() or ":" in key or len(key.splitlines()) != 1:
                raise ValueError(f"meta key {key!r} must be a single line without a colon or spaces around it")
            if not (value is None or isinstance(value, str | int | float)):
                raise ValueError(f"meta {key!r} is {value!r}; allowed are text, numbers, true, false and None")
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "channels", channels)
        object.__setattr__(self, "units", dict(self.units))
        object.__setattr__(self, "meta", dict(self.meta))

    def __getitem__(self, name: str) -> np.ndarray:
        """Samples of a channel, (T,), in its unit; ValueError with the names there are if there is none."""
        try:
            return self.channels[name]
        except KeyError:
            raise ValueError(f"no channel {name!r} in this recording; it has {', '.join(self.channels)}") from None

    @property
    def rate(self) -> float:
        """Sampling rate [Hz]; ValueError unless every sample is within a fifth of a step of a uniform grid."""
        uniform = np.linspace(self.time[0], self.time[-1], self.time.size)
        step = uniform[1] - uniform[0]
        if np.max(np.abs(self.time - uniform)) > 0.2 * step:  # time stamps may be rounded
            raise ValueError("the time steps are not uniform: call resampled(rate) first")
        return float(1 / step)

    def between(self, t0: float, t1: float) -> "Recording":
        """The samples with ``t0 <= time <= t1`` [s]; ValueError if fewer than two."""
        inside = (self.time >= t0) & (self.time <= t1)
        if np.count_nonzero(inside) < 2:
            raise ValueError(f"no samples from {t0} to {t1} s; time runs from {self.time[0]} to {self.time[-1]} s")
        kept = {name: values[inside] for name, values in self.channels.items()}
        return replace(self, time=self.time[inside], channels=kept)

    def resampled(self, rate: float) -> "Recording":
        """Straight lines between the samples, read at a uniform ``rate`` [Hz] from the first sample on.

        Nothing is smoothed: before going to a lower rate, call ``filtered`` with less than half of it.
        """
        span = self.time[-1] - self.time[0]
        if not (np.isfinite(rate) and rate * span >= 1):
            raise ValueError(f"rate is {rate} Hz; it must give at least two samples in {span} s")
        time = self.time[0] + np.arange(int(rate * span + 1e-9) + 1) / rate
        read = {name: np.interp(time, self.time, values) for name, values in self.channels.items()}
        return replace(self, time=time, channels=read)

    def filtered(self, cutoff_hz: float) -> "Recording":
        """Zero-phase Butterworth low-pass of every channel alike, so that no loop between two of them is skewed.

        Parameters
        ----------
        cutoff_hz : float
            Frequency at which the amplitude is halved (-6 dB: 3 dB forwards, 3 dB backwards) [Hz].

        Raises
        ------
        ValueError
            If the time steps are not uniform, sampling is slower than four times the cutoff, the
            recording is shorter than the filter's run-in, or a channel has a sample that is not finite.
        """
        if not (np.isfinite(cutoff_hz) and cutoff_hz > 0):
            raise ValueError(f"cutoff_hz is {cutoff_hz}; it must be positive and finite")
        if self.rate < SAMPLES_PER_CUTOFF * cutoff_hz * (1 - 1e-9):
            raise ValueError(
                f"sampling at {self.rate:.4g} Hz is too slow for a low-pass at {cutoff_hz:g} Hz; "
                f"record at {SAMPLES_PER_CUTOFF * cutoff_hz:g} Hz or faster"
            )
        run_in = int(np.ceil(self.rate / cutoff_hz))
        if self.time.size <= run_in:
            raise ValueError(f"{self.time.size} samples are too few for a low-pass at {cutoff_hz:g} Hz: needs {run_in}")
        for name, values in self.channels.items():
            if not np.all(np.isfinite(values)):
                raise ValueError(f"channel {name!r} has samples that are not finite: repair or leave out the channel")
        from scipy import signal  # here, for it takes longer to import than an environment to start

        low_pass = signal.butter(ORDER, cutoff_hz, fs=self.rate, output="sos")
        smooth = {name: signal.sosfiltfilt(low_pass, v, padlen=run_in) for name, v in self.channels.items()}
        return replace(self, channels=smooth)

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write ``# key: value`` lines of meta, a header that names the units, and one row a sample.

        The file appears whole or not at all: it is written beside ``path`` and then renamed.

        Raises
        ------
        ValueError
            If the name of a channel ends so that its column would be read back with another unit.
        """
        columns, header = [self.time], ["time_s"]
        for name, values in self.channels.items():
            suffix, size = FILE_UNITS[self.units[name]]
            column = f"{name}_{suffix}"
            if _name_and_unit(column) != (name, self.units[name]) or "," in name or len(name.splitlines()) != 1:
                raise ValueError(f"channel {name!r} in {self.units[name]!r} cannot be a column: rename the channel")
            columns.append(values / size)
            header.append(column)
        rows = np.column_stack(columns)
        path = Path(path)
        part = path.with_name(f".{path.name}.{os.getpid()}.part")
        try:
            with open(part, "w", encoding="utf-8", newline="\n") as file:
                file.writelines(f"# {key}: {_meta_text(value)}\n" for key, value in self.meta.items())
                file.write(",".join(header) + "\n")
                file.writelines(",".join(map(repr, row.tolist())) + "\n" for row in rows)
            os.replace(part, path)
        finally:
            part.unlink(missing_ok=True)

    @classmethod
    def from_csv(cls, path: str | os.PathLike[str]) -> "Recording":
        """Read what ``to_csv`` writes, or a table of that form from elsewhere.

        Raises
        ------
        ValueError
            Naming the file, the line, the column and what was expected there.
        """
        with open(path, encoding="utf-8-sig") as file:
            lines = [line.rstrip("\n") for line in file]
        first = next((k for k, line in enumerate(lines) if not line.startswith("#")), len(lines))
        meta = {}
        for number, line in enumerate(lines[:first], start=1):
            key, colon, value = line[1:].partition(":")
            if not colon:
                raise _unreadable(path, number, 1, "'# key: value'", line)
            meta[key.strip()] = _meta_value(value.strip())
        header = [column.strip() for column in lines[first].split(",")] if first < len(lines) else [""]
        units = _read_header(path, first + 1, header)
        table = _read_rows(path, first + 2, header, lines[first + 1 :])
        channels = {name: values * FILE_UNITS[unit][1] for (name, unit), values in zip(units.items(), table[1:])}
        return cls(table[0], channels, units, meta)


def _unreadable(path: Any, line: int, column: int | str, expected: str, got: object) -> ValueError:
    return ValueError(f"{path}, line {line}, column {column!r}: expected {expected}, got {got!r}")


def _read_header(path: Any, line: int, header: list[str]) -> dict[str, str]:
    """Units of the channels that the header names after ``time_s``."""
    if header[0] != "time_s":
        raise _unreadable(path, line, 1, "'time_s'", header[0])
    units: dict[str, str] = {}
    for k, column in enumerate(header[1:], start=2):
        pair = _name_and_unit(column)
        if pair is None:
            suffixes = ", ".join(f"_{suffix}" for suffix, _ in FILE_UNITS.values())
            raise _unreadable(path, line, k, f"a name that ends in its unit ({suffixes})", column)
        if pair[0] in units:
            raise _unreadable(path, line, k, "each channel once", column)
        units[pair[0]] = pair[1]
    return units


def _read_rows(path: Any, line: int, header: list[str], lines: list[str]) -> np.ndarray:
    """The table below the header, one row a column of the file, (C, T), in the file's units."""
    rows: list[list[float]] = []
    for number, text in enumerate(lines, start=line):
        cells = text.split(",")
        if len(cells) != len(header):
            where = header[min(len(cells), len(header) - 1)]
            raise _unreadable(path, number, where, f"{len(header)} values", len(cells))
        row: list[float] = []
        for column, cell in zip(header, cells):
            try:
                row.append(float(cell))
            except ValueError:
                raise _unreadable(path, number, column, "a number", cell) from None
        if not np.isfinite(row[0]) or (rows and row[0] <= rows[-1][0]):
            raise _unreadable(path, number, "time_s", "a finite time after that of the line before", cells[0])
        rows.append(row)
    if len(rows) < 2:
        raise _unreadable(path, line + len(rows), "time_s", "at least two rows", len(rows))
    return np.array(rows).T


def _frozen(values: Any, name: str) -> np.ndarray:
    """A read-only (T,) copy in double precision."""
    array = np.array(values, dtype=float)
    if array.ndim != 1:
        raise ValueError(f"{name!r} has shape {array.shape}; expected one value a sample, (T,)")
    array.flags.writeable = False
    return array


def _name_and_unit(column: str) -> tuple[str, str] | None:
    """Channel and unit of a file's column, None if it does not end in a known unit."""
    for suffix, unit in _LONGEST_SUFFIX_FIRST:
        name = column.removesuffix(f"_{suffix}")
        if name and name != column:
            return name, unit
    return None


def _meta_value(text: str) -> Any:
    """What is written in JSON is read as such, anything else is text."""
    try:
        value = json.loads(text)
    except ValueError:
        return text
    return value if value is None or isinstance(value, str | int | float) else text


def _meta_text(value: Any) -> str:
    """Bare text where it reads back as itself, JSON otherwise."""
    plain = isinstance(value, str) and value == value.strip() and len(value.splitlines()) <= 1
    return value if plain and _meta_value(value) == value else json.dumps(value)
