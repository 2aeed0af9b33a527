"""Recordings as measurement data files, ASAM MDF 4, with the package asammdf; the meta is JSON in the file's comment.

A file from another program may sample its channels at different instants. The time of the recording is that of the
channel with the most samples, within the time that all channels cover; the other channels are interpolated linearly. A
channel has a gap where it lacks samples (a step longer than 1.5 times its median step) or marks them as invalid.
"""

import importlib.util
import json
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import IO, Any, NamedTuple

import numpy as np

from steer_env.recording import own_process
from steer_env.recording.recording import interpolated
from steer_env.recording.table import Column, Table, Values, column
from steer_env.recording.units import file_unit

TIME = 1  # sync type of a master channel that is the time; other types are angle, distance and index
KIND, MISSING = "an MDF file", "MDF files need the package asammdf: pip install '.[mdf]'"

Place = tuple[None, int, int]  # of a channel: any name, group and index


class Signal(NamedTuple):
    """A channel as the file holds it."""

    samples: np.ndarray  # (N,) of numbers; text and arrays are not read
    timestamps: np.ndarray  # (N,) [s]
    invalid: np.ndarray | None  # (N,) whether a sample is invalid


def save(
    file: IO[bytes], time: np.ndarray, channels: list[tuple[str, str, np.ndarray]], meta: Mapping[str, Any]
) -> None:
    """Write the channels (name, unit in memory, values in file units) in double precision."""
    asammdf = _asammdf()
    if not channels:
        raise ValueError("a recording without channels cannot be an MDF file: write .csv")
    with asammdf.MDF(version="4.10") as mdf:
        mdf.header.comment = json.dumps(dict(meta))
        signals = [asammdf.Signal(values, time, unit=file_unit(unit), name=name) for name, unit, values in channels]
        mdf.append(signals, common_timebase=True)
        mdf.save(file)


def open_table(path: str | PathLike[str]) -> Table:
    """Open a file; every channel with a time base is a column.

    The label of a channel whose name occurs in several groups contains the number of its group.
    """
    if importlib.util.find_spec("asammdf") is None:
        raise ValueError(MISSING)
    file = os.fspath(path)
    columns, places, meta = own_process.read(KIND, _contents, file)

    def load(chosen: Sequence[int]) -> list[Values]:
        signals = own_process.read(KIND, _signals, file, [places[k] for k in chosen]) if chosen else []
        return _on_one_time([columns[k].label for k in chosen], signals)

    return Table(columns, meta, False, load)


def _contents(path: str) -> tuple[list[Column], list[Place], dict[str, Any]]:
    """Columns and their places in the file, and the meta."""
    columns: list[Column] = []
    places: list[Place] = []
    with _asammdf().MDF(path) as mdf:
        found = [(group, k, channel) for group in _timed(mdf) for k, channel in _channels(mdf, group)]
        occurrences = Counter(channel.name for _, _, channel in found)
        for group, k, channel in found:
            unit = mdf.get_channel_unit(group=group, index=k)
            name = channel.name if occurrences[channel.name] == 1 else f"{channel.name} (group {group})"
            columns.append(Column(name, name, unit) if unit else column(name))
            places.append((None, group, k))
        return columns, places, _meta(mdf.header)


def _signals(path: str, places: list[Place]) -> list[Signal]:
    with _asammdf().MDF(path) as mdf:
        return [
            Signal(found.samples, found.timestamps, found.invalidation_bits)
            for found in mdf.select(places, copy_master=False)
        ]


def _asammdf() -> Any:
    try:
        import asammdf  # here, because it is an extra and slow to import
    except ImportError:
        raise ValueError(MISSING) from None
    return asammdf


def _timed(mdf: Any) -> list[int]:
    """Groups whose master channel is the time."""
    masters = mdf.masters_db
    return [g for g in masters if getattr(mdf.groups[g].channels[masters[g]], "sync_type", TIME) == TIME]


def _channels(mdf: Any, group: int) -> list[tuple[int, Any]]:
    """Index and channel of everything in a group except its time."""
    return [(k, c) for k, c in enumerate(mdf.groups[group].channels) if k != mdf.masters_db[group]]


def _on_one_time(labels: list[str], signals: list[Signal]) -> list[Values]:
    """The time, and each signal at that time or the reason for which it cannot be read."""
    values: list[Values] = []
    for label, signal in zip(labels, signals):
        if signal.samples.ndim != 1 or signal.samples.dtype.kind not in "fiub":
            values.append("holds no plain numbers")
        elif signal.samples.size < 2:
            values.append(f"has {signal.samples.size} samples")
        else:
            with np.errstate(invalid="ignore"):  # of an infinite time, which is refused
                late = np.diff(signal.timestamps) <= 0
            if late.any() or not np.isfinite(signal.timestamps).all():
                k = int(np.argmax(late)) + 1
                raise ValueError(
                    f"the time of {label!r} must ascend strictly; sample {k} is {signal.timestamps[k]} s "
                    f"after {signal.timestamps[k - 1]} s; repair the file"
                )
            samples = signal.samples.astype(float)
            if signal.invalid is not None:
                samples[np.asarray(signal.invalid, dtype=bool)] = np.nan
            values.append(samples)
    usable = [(k, signals[k].timestamps) for k, v in enumerate(values) if isinstance(v, np.ndarray)]
    if not usable:
        return [np.empty(0), *values]
    _, time = max(usable, key=lambda pair: pair[1].size)
    first, last = max(usable, key=lambda pair: pair[1][0]), min(usable, key=lambda pair: pair[1][-1])
    time = time[(time >= first[1][0]) & (time <= last[1][-1])]
    if time.size < 2:
        raise ValueError(
            f"{labels[first[0]]!r} begins at {first[1][0]:g} s, {labels[last[0]]!r} ends at {last[1][-1]:g} s: "
            "the channels have no time in common; name those that are wanted in a mapping"
        )
    for k, own in usable:
        if not np.array_equal(own, time):
            values[k] = interpolated(time, own, np.asarray(values[k]))
    return [time, *values]


def _meta(header: Any) -> dict[str, Any]:
    """The meta, which is empty if the comment is not that of a recording."""
    try:
        meta = json.loads(header.description)
    except (AttributeError, ValueError, RecursionError):  # MDF 3, or a comment that is not ours
        return {}
    return meta if isinstance(meta, dict) else {}
