"""Raw CAN logs as recordings, with the packages python-can and cantools: frames decoded by a DBC.

python-can reads .blf, .asc, .log (candump), .trc and its own .csv, the three in the middle also compressed by gzip;
cantools decodes the frames. A column is a signal, ``MESSAGE.SIGNAL``, or the sum of signals of one message,
``MESSAGE.COARSE + MESSAGE.FINE``, in which some sensors split their reading.

Time begins at the first frame of the log. The messages of a log come at rates of their own and with jitter. The
recording has one uniform time base: the mean rate of the message with the most frames among those that are wanted,
within the time that all of them cover. Each value is interpolated linearly between the last frame before the instant
and the first one after it, and uses no others; where these are more than ``LONGEST_STEP`` periods apart, it is a gap.
The meta ``can`` tells this with the frames, the rate, the longest step and the gaps of every message, and how many
frames its counter misses.
"""

import gzip
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import closing
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from steer_env.friction.numerics.check import number
from steer_env.recording.channel_mapping import did_you_mean
from steer_env.recording.table import Column, Table, Values

SUFFIXES = (".blf", ".asc", ".log", ".trc", ".asc.gz", ".log.gz", ".trc.gz")
CSV_HEADER = "timestamp,arbitration_id,"  # of a log that python-can wrote as .csv
LARGEST = 1e30  # number of a database [unit of its signal]
LONGEST_STEP = 3.0  # between two frames without a gap, in median periods of the message [1]
COUNTERS = ("counter", "alive", "rolling")  # parts of the names of signals that count the frames
METHOD = "linear interpolation between the frames before and after each instant, at a uniform rate"


class Options(NamedTuple):
    """How a log is read."""

    dbc: str | PathLike[str] | Sequence[str | PathLike[str]] = ()  # a database, or several that are taken together
    bus: str | None = None  # the channel of the log whose frames are read; None: the only one of each message
    until: float = np.inf  # frames from this time on are not read [s]


class Frames(NamedTuple):
    """The frames of one message."""

    time: np.ndarray  # (F,), strictly ascending [s]
    values: dict[str, np.ndarray]  # physical values (F,) of each signal in its unit; NaN where it is not multiplexed in


def recognised(path: str | PathLike[str]) -> bool:
    """Whether a file is a CAN log by its suffix, or a .csv by the header of one."""
    name = Path(path).name.lower()
    if name.endswith(SUFFIXES):
        return True
    if not name.endswith(".csv") or not Path(path).is_file():
        return False
    with open(path, "rb") as file:
        return file.read(len(CSV_HEADER)) == CSV_HEADER.encode()


def open_table(path: str | PathLike[str], options: Options, sources: Sequence[str] = ()) -> Table:
    """Read the databases; every signal is a column, and so is each of ``sources`` that is a sum of signals.

    Raises
    ------
    ValueError
        Without the packages or a database, or if a database or a sum cannot be read.
    """
    messages = _messages(options.dbc)
    parts = [[(message, signal)] for message in messages for signal in message.signals]
    occurrences = Counter(signal.name for _, signal in (pair for (pair,) in parts))
    columns = []
    for ((message, signal),) in parts:
        label = f"{message.name}.{signal.name}"
        name = signal.name if occurrences[signal.name] == 1 else label
        columns.append(Column(label, name, signal.unit or None))
    for source in dict.fromkeys(source for source in sources if "+" in source):
        places = [_place(columns, part.strip(), source) for part in source.split("+")]
        summands = [parts[place][0] for place in places]
        if len({message.name for message, _ in summands}) > 1 or len({signal.unit for _, signal in summands}) > 1:
            raise ValueError(f"{source!r} is no sum: its signals must be of one message and in one unit")
        columns.append(Column(source, source, columns[places[0]].unit))
        parts.append(summands)
    meta: dict[str, Any] = {}

    def load(places: Sequence[int]) -> list[Values]:
        return _load(path, options, [parts[place] for place in places], meta)

    return Table(columns, meta, False, load)


def decoded(path: str | PathLike[str], options: Options) -> dict[str, Frames]:
    """The frames of every message of the databases that occurs, at their own instants; errors as for ``open_table``."""
    return _read(path, options, _messages(options.dbc))[1]


def _packages() -> tuple[Any, Any]:
    try:
        import can  # here, because they are an extra
        import cantools
    except ImportError:
        raise ValueError("CAN logs need the packages python-can and cantools: pip install '.[can]'") from None
    return can, cantools


def paths_of(dbc: str | PathLike[str] | Sequence[str | PathLike[str]]) -> Sequence[str | PathLike[str]]:
    """The databases as several, where one may be given alone."""
    return (dbc,) if isinstance(dbc, str | PathLike) else dbc


def _messages(paths: str | PathLike[str] | Sequence[str | PathLike[str]]) -> list[Any]:
    """The messages of all databases."""
    _, cantools = _packages()
    paths = paths_of(paths)
    if not paths:
        raise ValueError("a CAN log holds raw frames: give the DBC that says what is in them, --dbc car.dbc")
    found: dict[tuple[int, bool], Any] = {}
    for path in paths:
        try:
            database = cantools.database.load_file(path, strict=False)
        except OSError:
            raise
        except Exception as error:  # cantools raises those of its parsers
            text = " ".join(str(error).split())
            raise ValueError(f"{path} cannot be read as a CAN database: {text}") from None
        for message in getattr(database, "messages", []):
            _check_numbers(path, message)
            found[message.frame_id, message.is_extended_frame] = message
    if not found:
        raise ValueError(f"{', '.join(map(str, paths))}: no message in it")
    return list(found.values())


def _check_numbers(path: Any, message: Any) -> None:
    """ValueError for a number of a signal that the readings cannot be scaled with."""
    for signal in message.signals:
        for key in ("scale", "offset", "minimum", "maximum"):
            if (value := getattr(signal, key)) is not None:
                number(f"{path}: {key} of {message.name}.{signal.name}", value, minimum=-LARGEST, maximum=LARGEST)


def _place(columns: list[Column], name: str, source: str) -> int:
    """The index of a signal by its name with or without that of its message."""
    for place, entry in enumerate(columns):
        if name in (entry.label, entry.name):
            return place
    alike = [entry.label for entry in columns if entry.label.endswith(f".{name}")]
    hint = f"; it is one of {', '.join(alike)}" if alike else ""
    names = [entry.label for entry in columns if "+" not in entry.label]
    hint = hint or f"; {did_you_mean(name, names)}"
    raise ValueError(f"no signal {name!r} in the database, for the sum {source!r}{hint}")


def _load(path: Any, options: Options, wanted: list[list[tuple[Any, Any]]], meta: dict[str, Any]) -> list[Values]:
    """The time, and every column at that time or the reason for which it cannot be read; writes the meta ``can``."""
    messages = {parts[0][0].name: parts[0][0] for parts in wanted}
    start, frames, seen = _read(path, options, list(messages.values()))
    signals: list[tuple[np.ndarray, np.ndarray] | str] = []
    for parts in wanted:
        message = parts[0][0]
        found = frames.get(message.name)
        if found is None:
            signals.append(f"is in the message {_named(message)}, which never occurs in the log; it has {_ids(seen)}")
            continue
        values = np.sum([found.values[signal.name] for _, signal in parts], axis=0)
        there = ~np.isnan(values)
        few = f"has {np.count_nonzero(there)} samples"
        signals.append((found.time[there], values[there]) if np.count_nonzero(there) > 1 else few)
    usable = [signal for signal in signals if not isinstance(signal, str)]
    if not usable:
        return [np.empty(0), *(str(signal) for signal in signals)]
    time = _time_base([time for time, _ in usable])
    meta["can"] = {
        "method": METHOD,
        "rate_hz": float(1 / (time[1] - time[0])),
        "first_frame_s": start,
        "messages": {name: _told(messages[name], entry) for name, entry in frames.items()},
    }
    return [time, *(signal if isinstance(signal, str) else _interpolated(time, *signal) for signal in signals)]


def _read(path: Any, options: Options, wanted: list[Any]) -> tuple[float, dict[str, Frames], Counter[int]]:
    """Time of the first frame [s], the frames of the wanted messages that occur, and how often each identifier does."""
    keys = {(message.frame_id, message.is_extended_frame): message for message in wanted}
    raw: dict[str, list[tuple[float, bytes]]] = {}
    buses: dict[str, set[str]] = {}
    seen: Counter[int] = Counter()
    start = 0.0
    for place, frame in enumerate(_frames(path, options.until), start=1):
        start = frame.timestamp if place == 1 else start
        if options.bus is not None and str(frame.channel) != options.bus:
            continue
        seen[frame.arbitration_id] += 1
        message = keys.get((frame.arbitration_id, frame.is_extended_id))
        if message is None:
            continue
        time = frame.timestamp - start
        if len(frame.data) < max(message.length, frame.dlc):
            raise ValueError(
                f"frame {place}, at {time:.6f} s, has {len(frame.data)} of the {message.length} bytes of "
                f"{_named(message)}: the log is cut there, or the database is of another car; "
                f"{_before(time)}"
            )
        raw.setdefault(message.name, []).append((time, bytes(frame.data)))
        buses.setdefault(message.name, set()).add(str(frame.channel))
    for name, channels in buses.items():
        if len(channels) > 1:
            names = sorted(channels)
            raise ValueError(f"{name} occurs on the buses {', '.join(names)}: choose one, --bus {names[0]}")
    if not seen:
        where = "" if options.bus is None else f" on the bus {options.bus!r}"
        raise ValueError(f"no frame in the log{where}; is it complete?")
    return (
        start,
        {message.name: _decoded(message, raw[message.name]) for message in wanted if message.name in raw},
        seen,
    )


def _frames(path: Any, until: float) -> Iterator[Any]:
    """The data frames before a time; ValueError with the place where the log breaks off."""
    can, _ = _packages()
    number, time, start = 0, 0.0, None
    try:
        with can.LogReader(path) as reader:
            for frame in reader:
                start = frame.timestamp if start is None else start
                if frame.timestamp - start >= until:
                    return
                number, time = number + 1, frame.timestamp - start
                if not (frame.is_error_frame or frame.is_remote_frame):
                    yield frame
            size = getattr(reader, "file_size", 0)
        problem = _end(Path(path), size)
    except Exception as error:  # damaged logs raise exceptions of many types
        problem = str(error)
    if problem:
        whole = _before(time) if number else "record it again"
        raise ValueError(f"the log breaks off after {number} whole frames, at {time:.6f} s ({problem}); {whole}")


def _before(time: float) -> str:
    """The remedy for a log of which a part can be read; the time is rounded down [s]."""
    return f"take what is before that with --between 0 {np.floor(1e3 * time) / 1e3:g}"


def _end(path: Path, size: int) -> str:
    """What is wrong with the end of a log that python-can read without complaint; empty if nothing is."""
    if path.stat().st_size < size:
        return f"{path.stat().st_size} of {size} bytes are there"
    if not path.name.lower().endswith((".asc", ".trc", ".asc.gz", ".trc.gz")):
        return ""
    with closing(gzip.open(path) if path.suffix.lower() == ".gz" else open(path, "rb")) as file:
        last = deque(file, maxlen=1)
    if not last or last[0].endswith(b"\n"):
        return ""
    return f"the last line, {last[0].decode(errors='replace')!r}, has no end"


def _decoded(message: Any, raw: list[tuple[float, bytes]]) -> Frames:
    """The frames as cantools decodes them; of frames with the same time stamp the last.

    A frame that the database does not describe, such as one with a multiplexer of its own, has no values.
    """
    _, cantools = _packages()

    def signals(data: bytes) -> dict[str, Any]:
        try:
            found: dict[str, Any] = message.decode(data, decode_choices=False)
        except cantools.database.DecodeError:
            return {}
        return found

    time = np.array([stamp for stamp, _ in raw])
    back = np.flatnonzero(np.diff(time) < 0)
    if back.size:
        k = int(back[0])
        raise ValueError(
            f"{_named(message)}: the time goes back from {time[k]:.6f} to {time[k + 1]:.6f} s; sort the log"
        )
    kept = np.append(np.diff(time) > 0, True)
    frames = [signals(data) for (_, data), keep in zip(raw, kept) if keep]
    values = {
        signal.name: np.array([float(frame.get(signal.name, np.nan)) for frame in frames]) for signal in message.signals
    }
    return Frames(time[kept], values)


def _time_base(times: list[np.ndarray]) -> np.ndarray:
    """Uniform instants at the mean rate of the signal with the most frames, where all signals have frames [s]."""
    first, last = max(time[0] for time in times), min(time[-1] for time in times)
    most = max(times, key=len)
    step = (most[-1] - most[0]) / (most.size - 1)
    if last - first < step:
        raise ValueError(
            f"one signal begins at {first:g} s, another ends at {last:g} s: they have no time in common; name those "
            "that are wanted in a mapping"
        )
    return first + step * np.arange(int((last - first) / step * (1 + 1e-12)) + 1)


def _interpolated(at: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Linear interpolation between frames; NaN in gaps."""
    read = np.interp(at, time, values)
    k = np.clip(np.searchsorted(time, at, side="right") - 1, 0, time.size - 2)
    gap = np.diff(time) > LONGEST_STEP * np.median(np.diff(time))
    read[gap[k] & (at > time[k]) & (at < time[k + 1])] = np.nan
    return read


def _told(message: Any, frames: Frames) -> dict[str, Any]:
    """What the meta tells of a message's frames."""
    steps = np.diff(frames.time)
    told: dict[str, Any] = {"id": f"0x{message.frame_id:03X}", "frames": frames.time.size}
    undescribed = np.count_nonzero(np.all([np.isnan(values) for values in frames.values.values()], axis=0))
    if frames.values and undescribed:
        told["not_decoded"] = int(undescribed)
    if steps.size:
        longest = int(np.argmax(steps))
        told["rate_hz"] = float(1 / steps.mean())
        told["longest_step_s"], told["longest_step_at_s"] = float(steps[longest]), float(frames.time[longest])
        told["gaps"] = int(np.count_nonzero(steps > LONGEST_STEP * np.median(steps)))
    for signal in message.signals:
        if any(part in signal.name.lower() for part in COUNTERS):
            most = signal.maximum if signal.maximum and signal.maximum > 0 else 2**signal.length - 1
            modulus = int(most) + 1
            ahead = np.diff(frames.values[signal.name]) % modulus
            told["missed_by_counter"] = int(np.sum(np.maximum(ahead - 1, 0)))
    return told


def _named(message: Any) -> str:
    return f"{message.name} (id 0x{message.frame_id:03X})"


def _ids(seen: Counter[int]) -> str:
    """The identifiers that occur, the most frequent first."""
    named = [f"0x{identifier:03X}" for identifier, _ in seen.most_common(12)]
    return ", ".join(named) + (", ..." if len(seen) > len(named) else "")
