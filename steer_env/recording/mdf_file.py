"""Recordings as measurement data files, ASAM MDF 4, with the package asammdf; the meta is JSON in the file's comment.

A file from another program may sample its channels at different instants. The time of the recording is that of the
channel with the most samples, within the time that all channels cover; the other channels are interpolated linearly. A
channel has a gap where it lacks samples (a step longer than ``LONGEST_STEP``), marks them as invalid, or has a
text in place of a number.

Samples are taken raw, and their conversions are evaluated here where asammdf 8.8 gives other values than the file
says: algebraic ones (what ``numexpr`` cannot read stays raw without sympy, and ``^`` is the exclusive or of whole
numbers), ranges of whole numbers, and tables of texts, whose keys it rounds to whole numbers.
"""

import ast
import json
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import count, takewhile
from os import PathLike
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from steer_env.recording import own_process
from steer_env.recording.table import (
    Column,
    Table,
    Values,
    column,
    gaps,
    in_common,
    interpolate_between,
    last_of_each_time,
    meta_in,
)
from steer_env.recording.units import file_unit

TIME = 1  # sync type of a master channel that is the time; other types are angle, distance and index
FILE_KIND = "an MDF file"
LONGEST_STEP = 1.5  # between two samples of a channel without a gap, in median steps of it [1]

# What a formula of an algebraic conversion may hold, with ^ for powers. A log is refused: numexpr takes it for natural,
# ASAM for decimal.
OPERATORS: dict[type, Any] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.USub: np.negative,
    ast.UAdd: np.positive,
}
FUNCTIONS: dict[str, Any] = {
    **{each.__name__: each for each in (np.sqrt, np.exp, np.log10, np.sin, np.cos, np.tan, np.sinh, np.cosh, np.tanh)},
    **{each.__name__: each for each in (np.arcsin, np.arccos, np.arctan)},
    **{"abs": np.abs, "ln": np.log, "pow": np.power, "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan},
}

Place = tuple[None, int, int]  # of a channel: any name, group and index


class Signal(NamedTuple):
    """A channel as the file holds it."""

    samples: np.ndarray | str  # (N,) of physical values, or why there are none
    timestamps: np.ndarray  # (N,) [s]
    codes: dict[str, np.ndarray]  # why samples are no values -> which (N,)


def save(file: Any, time: np.ndarray, channels: list[tuple[str, str, np.ndarray]], meta: Mapping[str, Any]) -> None:
    """Write the channels (name, unit in memory, values in file units) in double precision."""
    own_process.require("asammdf", "MDF files", "mdf")
    import asammdf  # here, because it is an extra and slow to import

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
    own_process.require("asammdf", "MDF files", "mdf")
    file = os.fspath(path)
    columns, places, meta = own_process.read(FILE_KIND, _contents, file)

    def load(chosen: Sequence[int]) -> list[Values]:
        signals = own_process.read(FILE_KIND, _signals, file, [places[k] for k in chosen]) if chosen else []
        return _on_one_time(meta, [columns[k].label for k in chosen], signals)

    return Table(columns, meta, False, load)


def _contents(path: str) -> tuple[list[Column], list[Place], dict[str, Any]]:
    """Columns and their places in the file, and the meta."""
    columns: list[Column] = []
    places: list[Place] = []
    from asammdf import MDF

    with MDF(path) as mdf:
        found: list[tuple[int, int, Any]] = [
            (group, k, channel)
            for group, master in mdf.masters_db.items()
            if getattr(mdf.groups[group].channels[master], "sync_type", TIME) == TIME
            for k, channel in enumerate(mdf.groups[group].channels)
            if k != master
        ]
        occurrences = Counter(channel.name for _, _, channel in found)
        for group, k, channel in found:
            unit = mdf.get_channel_unit(group=group, index=k)
            name = channel.name if occurrences[channel.name] == 1 else f"{channel.name} (group {group})"
            columns.append(column(name, unit))
            places.append((None, group, k))
        return columns, places, meta_in(getattr(mdf.header, "description", None))  # MDF 3 has none


def _signals(path: str, places: list[Place]) -> list[Signal]:
    from asammdf import MDF

    with MDF(path) as mdf:
        return [_signal(found) for found in mdf.select(places, copy_master=False, raw=True)]


def _signal(found: Any) -> Signal:
    """A channel that asammdf has read raw."""
    try:
        with np.errstate(all="ignore"):
            samples, codes = _physical(found.samples, found.conversion)
    except ValueError as error:
        return Signal(str(error), found.timestamps, {})
    if found.samples.dtype.kind == "f":  # a table has a value for what is no number, too
        samples = np.where(np.isfinite(found.samples), samples, found.samples)
    if found.invalidation_bits is not None:
        codes = {"marked invalid": np.asarray(found.invalidation_bits, dtype=bool), **codes}
    return Signal(samples, found.timestamps, codes)


def _physical(raw: np.ndarray, conversion: Any) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The values (N,) of raw samples by a conversion, and which texts stand in place of numbers, (N,) of bool each.

    Raises
    ------
    ValueError
        With what is wrong, if there are no numbers or the conversion cannot be evaluated.
    """
    values = raw
    if raw.ndim == 1 and raw.dtype.kind in "fiub":
        if formula := getattr(conversion, "formula", ""):
            values = _evaluate_formula(formula, raw.astype(float))
            return values, {f"no result of {formula!r}": np.isnan(values) & ~np.isnan(raw)}
        if hasattr(conversion, "lower_0") or hasattr(conversion, "val_0"):
            return _looked_up(raw, conversion)
        if np.any(np.diff(_each(conversion, "raw")) <= 0):
            raise ValueError("has a conversion by a table whose raw values do not ascend")
        values = raw.astype(float)  # in which asammdf computes no power of a byte in a byte
    if conversion is not None:
        values = np.asarray(conversion.convert(values))
    if values.ndim != 1 or values.dtype.kind not in "fiub":
        raise ValueError("holds no plain numbers")
    return values.astype(float), {}


def _each(conversion: Any, key: str) -> list[Any]:
    """The numbered entries of a conversion."""
    names = (f"{key}_{place}" for place in count())
    return [getattr(conversion, name) for name in takewhile(lambda name: hasattr(conversion, name), names)]


def _looked_up(raw: np.ndarray, conversion: Any) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Values and texts as of :func:`_physical` by a table of values or ranges, whose first entry that fits counts.

    The end of a range belongs to it for whole numbers, not for others (ASAM MDF 4, CCBLOCK).
    """
    lower = _each(conversion, "lower") or _each(conversion, "val")
    upper = _each(conversion, "upper") or lower
    targets = _each(conversion, "phys")
    targets.append(conversion.default if targets else conversion.referenced_blocks["default_addr"])
    if len(targets) == 1:
        targets[:0] = [conversion.referenced_blocks[f"text_{k}"] for k in range(len(lower))]
    if isinstance(targets[-1], bytes) and b"{X}" in targets[-1]:  # a formula beside texts in MDF 3
        targets[-1] = SimpleNamespace(formula=targets[-1].decode("latin-1").replace("{X}", "X").split('"')[1])
    if all(isinstance(target, bytes) for target in targets):
        raise ValueError("holds texts")
    chosen = np.full(raw.size, len(lower))
    for k in reversed(range(len(lower))):
        ends = raw <= upper[k] if raw.dtype.kind in "iub" else raw < upper[k]
        chosen[(raw >= lower[k]) & ends | (raw == lower[k])] = k
    values, codes = np.full(raw.size, np.nan), dict[str, np.ndarray]()
    for k, target in enumerate(targets):
        at = np.flatnonzero(chosen == k)
        if isinstance(target, bytes):
            texts = {target.decode(errors="replace").strip("\0 "): np.ones(at.size, dtype=bool)}
        else:
            values[at], texts = (target, {}) if isinstance(target, float) else _physical(raw[at], target)
        for text, where in texts.items():
            codes.setdefault(text, np.zeros(raw.size, dtype=bool))[at[where]] = True
    return values, codes


def _evaluate_formula(formula: str, x: np.ndarray) -> np.ndarray:
    """The values (N,) of a formula at x (N,); ValueError with what in it is not known."""

    def value(node: ast.expr) -> Any:
        match node:
            case ast.Constant(value=int() | float() as number):
                return float(number)
            case ast.Name(id="X1" | "X"):
                return x
            case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
                return OPERATORS[type(op)](value(left), value(right))
            case ast.UnaryOp(op=op, operand=operand) if type(op) in OPERATORS:
                return OPERATORS[type(op)](value(operand))
            case ast.Call(func=ast.Name(id=name), args=given, keywords=[]):
                function = FUNCTIONS.get(name.lower())
                if function and function.nin == len(given):
                    return function(*map(value, given))
        raise ValueError(f"has the algebraic conversion {formula!r}, in which {ast.unparse(node)!r} is not known")

    try:
        return np.broadcast_to(value(ast.parse(formula.strip().replace("^", "**"), mode="eval").body), x.shape)
    except (SyntaxError, RecursionError, MemoryError):
        raise ValueError(f"has the algebraic conversion {formula!r}, which is no formula") from None


def _on_one_time(meta: dict[str, Any], labels: list[str], signals: list[Signal]) -> list[Values]:
    """The time, and each signal at that time or the reason for which it cannot be read."""
    values: list[Values] = []
    own: dict[str, np.ndarray] = {}  # times of the readable ones
    for label, signal in zip(labels, signals):
        if isinstance(signal.samples, str):
            values.append(signal.samples)
            continue
        kept = last_of_each_time(meta, label, signal.timestamps)
        if np.count_nonzero(kept) < 2:
            values.append(f"has {np.count_nonzero(kept)} samples")
            continue
        values.append(gaps(meta, label, signal.samples, signal.codes)[kept])
        own[label] = signal.timestamps[kept]
    if not own:
        return [np.empty(0), *values]
    begin, end = in_common(own)
    time = max(own.values(), key=len)
    time = time[(time >= begin) & (time <= end)]
    for k, label in enumerate(labels):
        if label in own and not np.array_equal(own[label], time):
            values[k] = interpolate_between(time, own[label], np.asarray(values[k]), LONGEST_STEP)
    return [time, *values]
