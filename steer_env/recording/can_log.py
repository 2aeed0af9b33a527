"""Raw CAN logs as recordings, with the packages python-can and cantools: frames decoded by a database.

python-can reads .blf, .asc, .log (candump), .trc and its own .csv, the three in the middle also compressed by gzip; the
raw frames of an .mf4 come from asammdf. :mod:`steer_env.recording.can_database` has the signals. A column is a signal,
``MESSAGE.SIGNAL``, the sum of signals of one message, ``MESSAGE.COARSE + MESSAGE.FINE``, in which some sensors split
their reading, or a magnitude with its sign, ``MESSAGE.SIZE signed by MESSAGE.SIGN``, negative where that is 1, or
what the database names so.

Time begins at the first frame of the log. The messages of a log come at rates of their own and with jitter. The
recording has one uniform time base: the mean rate of the message with the most frames among those that are wanted,
within the time that all of them cover. Each value is interpolated linearly between the last frame before the instant
and the first one after it, and uses no others; where these are more than ``LONGEST_STEP`` periods apart, or one of them
holds a code that is no value, it is a gap. The meta ``can`` tells this with the frames, the rate, the longest step and
the gaps of every message, and how many frames its counter misses; its ``notes`` are sentences for the user.

Frames of one message with one time stamp: where these are more than ``MOST_DOUBLED`` of a message, the logger stamps in
batches, and the frames are spread over the time before the stamp, see ``_spread``; of others the last is kept. Both are
told. A computer that stamps the frames of a batch one by one, as an adapter hands them over, gives stamps that are less
than ``BURST`` apart; these are taken as one. What a log of batches has of the time between messages is the order of
their frames: each message is moved as a whole so that its frames are, on average, midway between those of the fastest
message that come before and after them. The truth is within half the cycle time of that one. Where each message has
one frame at most in a batch, so that only frames of different messages share stamps, all stay where they are, and the
truth is within the time between two stamps. Either is told in the meta ``timing_error_s``, by which the intervals of
metrics are widened.

A message of J1939 that does not occur under its own identifier is taken from the one source address from which its
parameter group comes.
"""

import gzip
import re
from array import array
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import closing
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from steer_env.friction.numerics.check import did_you_mean
from steer_env.recording import can_database, own_process
from steer_env.recording.can_database import Message, contains_signal, identifier, parameter_group
from steer_env.recording.channel_mapping import SIGNED
from steer_env.recording.table import (
    MOST_DOUBLED,
    NO_VALUE,
    TIMING,
    Column,
    Table,
    Values,
    in_common,
    interpolate_between,
    last_of_each_time,
    tell,
)
from steer_env.recording.units import parse_unit

SUFFIXES = (".blf", ".asc", ".log", ".trc", ".asc.gz", ".log.gz", ".trc.gz")
CSV_HEADER = "timestamp,arbitration_id,"  # of a log that python-can wrote as .csv
LONGEST_STEP = 3.0  # between two frames without a gap, in median periods of the message [1]
BURST = 1e-3  # between two frames of a batch, and at most a tenth of the message's mean period; assumed [s]
COUNTERS = ("counter", "alive", "rolling")  # parts of the names of signals that count the frames
MDF = (".mf4", ".mdf")
BUS = ("CAN_", "LIN_")  # begin the names of channels with the frames of a bus in an MDF file
FRAMES = "CAN_DataFrame"  # channel of an MDF file with raw frames
RELATIVE = re.compile(r"\s*base\s+\w+\s+timestamps\s+relative", re.IGNORECASE)
TRIGGER_BLOCK = re.compile(r"\s*begin\s*triggerblock", re.IGNORECASE)
STAMP = re.compile(r"\s*(\d+\.\d+)\s")
METHOD = "linear interpolation between the frames before and after each instant, at a uniform rate"

Frame = tuple[float, int, bool, Any, bytes]  # time stamp [s], identifier, whether it has 29 bits, bus, data


class Options(NamedTuple):
    """How a log is read."""

    dbc: str | PathLike[str] | Sequence[str | PathLike[str]] = ()  # a database, or several that are taken together
    bus: str | None = None  # the channel of the log whose frames are read; None: the only one of each message
    until: float = np.inf  # frames from this time on are not read [s]


class Wanted(NamedTuple):
    """A column that is to be read."""

    label: str
    parts: list[can_database.Column]  # summands of one message
    sign: can_database.Column | None  # of the same message; the values are negative where it is 1, or its ``negative``


class Raw:
    """Frames of one identifier as they come."""

    def __init__(self, width: int) -> None:
        self.width = width  # bytes that are kept of each frame
        self.time = array("d")  # [s]
        self.number = array("L")  # among all frames of the log, in the order in which they came
        self.size = array("B")  # bytes of the frame
        self.data = bytearray()
        self.buses: set[str] = set()

    def take(self, number: int, time: float, bus: str, data: bytes) -> None:
        """Add a frame."""
        self.number.append(number)
        self.time.append(time)
        self.size.append(len(data))
        self.data += data[: self.width].ljust(self.width, b"\0")
        self.buses.add(bus)

    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The time (F,), the bytes (F, B) and the sizes (F,)."""
        data = np.frombuffer(self.data, dtype=np.uint8).reshape(len(self.time), self.width)
        return np.array(self.time), data, np.array(self.size)


class Log(NamedTuple):
    """The frames of a log that are wanted."""

    start: float  # time stamp of the first frame [s]
    frames: dict[tuple[int, bool], Raw]  # by identifier, and whether it has 29 bits
    seen: Counter[tuple[int, bool]]  # how often each occurs


def is_can_log(path: str | PathLike[str], options: Options | None = None) -> bool:
    """Whether a file is a CAN log by its suffix, a .csv by the header of one, or an MDF file with a database."""
    name = Path(path).name.lower()
    if name.endswith(SUFFIXES):
        return True
    if not name.endswith(".csv") or not Path(path).is_file():
        return name.endswith(MDF) and options is not None and bool(options.dbc)
    with open(path, "rb") as file:
        return file.read(len(CSV_HEADER)) == CSV_HEADER.encode()


def open_table(path: str | PathLike[str], options: Options, sources: Sequence[str] = ()) -> Table:
    """Read the databases; every signal is a column, and so is each of ``sources`` that is a sum or has a sign.

    Raises
    ------
    ValueError
        Without the packages or a database, or if a database or a source cannot be read.
    """
    paths = database_paths(options.dbc)
    if not paths:
        raise ValueError("a CAN log holds raw frames: give the DBC that says what is in them, --dbc car.dbc")
    signals, left = can_database.load(paths)
    named = Counter(entry.signal.name for entry in signals)
    columns, wanted = [], []
    for entry in signals:
        name = entry.label if entry.apart or named[entry.signal.name] > 1 else entry.signal.name
        unit, own = entry.signal.unit or None, entry.sign
        signed = (own.label, own.negative) if own else ()
        columns.append(Column(entry.label, name, unit, parse_unit(unit or ""), *signed))
        wanted.append(Wanted(entry.label, [entry], None))
    places = {text: place for place, column in enumerate(columns) for text in (column.label, column.name)}
    for source in dict.fromkeys(sources):
        sizes, _, sign = source.partition(SIGNED)
        names = [part.strip() for part in (*sizes.split("+"), sign) if part]
        for name in names:
            if name not in places:
                raise ValueError(_missing(name, source, columns[: len(signals)], signals, left))
        if len(names) == 1:
            continue
        parts = [signals[places[name]] for name in names]
        summands = parts[:-1] if sign else parts
        if len({entry.message for entry in parts}) > 1 or len({entry.signal.unit for entry in summands}) > 1:
            raise ValueError(f"{source!r} cannot be formed: its signals must be of one message and in one unit")
        columns.append(columns[places[names[0]]]._replace(label=source, name=source, sign=None))
        wanted.append(Wanted(source, summands, parts[-1] if sign else None))
    meta: dict[str, Any] = {}
    known = {entry.message.key for entry in signals}

    def load(places: Sequence[int]) -> list[Values]:
        return _load(path, options, [wanted[place] for place in places], known, meta)

    return Table(columns, meta, False, load)


def database_paths(dbc: str | PathLike[str] | Sequence[str | PathLike[str]]) -> Sequence[str | PathLike[str]]:
    """The databases as several, where one may be given alone."""
    return (dbc,) if isinstance(dbc, str | PathLike) else dbc


def _missing(
    name: str, source: str, columns: list[Column], signals: list[can_database.Column], left: dict[str, str]
) -> str:
    """Why a signal, which a source names, is none of those that can be read."""
    for label, reason in left.items():
        if name in (label, label.rpartition(":")[2], label.rpartition(".")[2]) or name.startswith(f"{label}."):
            return f"{label} of the database cannot be read ({reason})"
    alike = [column.label for column in columns if column.label.endswith((f".{name}", f":{name}"))]
    reasons = dict.fromkeys(entry.apart for entry in signals if entry.apart and entry.label in alike)
    wanted = f"no signal {name!r}{'' if name == source else f', for {source!r}'}"
    return "; ".join((wanted, *reasons, did_you_mean(name, alike or [column.name for column in columns])))


def _load(
    path: Any, options: Options, wanted: list[Wanted], known: set[tuple[int, bool]], meta: dict[str, Any]
) -> list[Values]:
    """The time, and every column at that time or the reason for which it cannot be read; writes the meta ``can``."""
    log = _read_frames(path, options, [part for column in wanted for part in column.parts])
    notes: list[str] = []
    told: dict[str, dict[str, Any]] = {}
    found = [_signal(column, log, known, told, notes, meta) for column in wanted]
    usable = {k: signal for k, signal in enumerate(found) if not isinstance(signal, str)}
    if not usable:
        return [np.empty(0), *map(str, found)]
    in_order = sorted(usable, key=lambda k: -usable[k][0].size)  # the fastest message first
    stamped = {wanted[k].parts[0].message.label: usable[k][0] for k in in_order}
    fastest, *_ = stamped
    batch, within = _batch([*stamped.values()]), _block_time([*stamped.values()])
    placed: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    late: dict[str, list[str]] = {label: [] for label in stamped if label != fastest}  # their columns
    clock = None  # numbers and instants of the frames of the fastest message
    for k in in_order:
        stamps, values, numbers = usable[k]
        message = wanted[k].parts[0].message
        if batch is None:
            kept = last_of_each_time(meta, message.label, stamps)
            placed[k] = stamps[kept], values[kept]
        else:
            stamps = _stamps(stamps)
            time, cycle = _spread(stamps, message.cycle)
            if clock is None:
                clock, within = (numbers, time), cycle / 2
            placed[k] = time + np.mean(_midway(*clock, numbers) - time), values
            notes.append(
                f"{message.label}: the log stamps frames in batches of {batch:.3g} s; {values.size} frames with "
                f"{np.unique(stamps).size} stamps are spread by the cycle time of {cycle:.3g} s"
            )
        if message.label in late:
            late[message.label].append(wanted[k].label)
    if late and within:
        meta[TIMING] = [{"channels": labels, "seconds": within} for labels in late.values()]
        notes.append(
            f"the time between frames of {', '.join(late)} and those of {fastest} is known to within {within:.2g} s, "
            "for which the intervals of metrics allow"
        )
    begin, end = in_common({wanted[k].label: time for k, (time, _) in placed.items()})
    most = max((time for time, _ in placed.values()), key=len)
    rate = float((most.size - 1) / (most[-1] - most[0]))
    base = begin + np.arange(int((end - begin) * rate * (1 + 1e-12)) + 1) / rate
    meta["can"] = {"method": METHOD, "rate_hz": rate, "first_frame_s": log.start, "messages": told}
    meta["can"] |= {"notes": list(dict.fromkeys(notes))} if notes else {}
    return [
        base,
        *(
            interpolate_between(base, *placed[k], LONGEST_STEP) if k in placed else str(one)
            for k, one in enumerate(found)
        ),
    ]


def _signal(
    column: Wanted,
    log: Log,
    known: set[tuple[int, bool]],
    told: dict[str, dict[str, Any]],
    notes: list[str],
    meta: dict[str, Any],
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | str:
    """Time [s], values and numbers of the frames that hold a column, NaN for codes, or why there are none."""
    first = column.parts[0]
    raw = _raw(first, log, known, notes)
    if isinstance(raw, str):
        return f"is in the message {first.message.label} ({first.message.identified}), which {raw}"
    time, data, size = raw.arrays()
    told.setdefault(first.message.label, _frame_statistics(first.message, time - log.start, data, size))
    there, values, counted = np.ones(time.size, dtype=bool), np.zeros(time.size), list[str]()
    for part in (*column.parts, *([column.sign] if column.sign else ())):
        try:
            held, read, codes = part.read(data, size)
        except ValueError as error:
            return f"cannot be read: {error}"
        there &= held
        signed = np.where(read == part.negative, -values, values) + 0 * read  # NaN where there is no sign
        values = signed if part is column.sign else values + read
        if codes:
            tell(meta, NO_VALUE, part.label, codes)
            notes += [
                f"{part.label}: most values are {code}; if that range is wrong, set it to [0|0] in the database"
                for code, count in codes.items()
                if code.startswith("beyond") and 2 * count > np.count_nonzero(held)
            ]
            counted += [f"{count} of {part.label} have {code}" for code, count in codes.items()]
    least = max(can_database.least_frame_size(part.signal) for part in column.parts)
    short = np.count_nonzero(size < least)
    if np.unique(time[there]).size < 2:
        lacking = f"; it needs {least} bytes, of which they have {size.max()}" if short else ""
        lacking = lacking or ("" if np.count_nonzero(there) < 2 else ", all with one time stamp")
        return f"has {np.count_nonzero(there)} samples in {size.size} frames{lacking}"
    label, sign = column.label, first.sign
    if np.isnan(values[there]).all():
        return f"has no value in any of its frames ({', '.join(counted)}); is the database that of this car?"
    if short:
        notes.append(f"{label} is not in {short} frames, which are shorter than its {least} bytes")
    if sign and column.sign is None:
        notes.append(
            f'{label} is read without its sign, {sign.label}: give it in a mapping, sign_from = "{sign.label}"'
        )
    return time[there] - log.start, values[there], np.array(raw.number)[there]


def _raw(entry: can_database.Column, log: Log, known: set[tuple[int, bool]], notes: list[str]) -> Raw | str:
    """The frames of a signal's message, or why there are none; for J1939 also those from another source address."""
    message = entry.message
    raw = log.frames.get(message.key)
    group, own = parameter_group(message.frame_id), f"0x{message.frame_id & 0xFF:02X}"
    others = [key for key in log.frames if key not in known and key[1] and parameter_group(key[0]) == group]
    if raw is None and entry.is_j1939 and others:
        sources = ", ".join(f"0x{frame_id & 0xFF:02X} ({identifier(frame_id, True)})" for frame_id, _ in others)
        if len(others) > 1:
            return f"comes from {sources}, not from {own}: write the identifier that is wanted into the database"
        raw = log.frames[others[0]]
        notes.append(f"{message.label} comes from the source address {sources}, in the database from {own}")
    if raw is None:
        if log.seen[message.frame_id, not message.extended]:
            one, other = ("an extended", "a standard") if message.extended else ("a standard", "an extended")
            return f"never occurs with {one} identifier; it is there as {other} one"
        there = ", ".join(identifier(*key) for key, _ in log.seen.most_common(12))
        return f"never occurs in the log; it has {there}{', ...' * (len(log.seen) > 12)}"
    if len(raw.buses) > 1:
        names = sorted(raw.buses)
        raise ValueError(f"{message.label} occurs on the buses {', '.join(names)}: choose one, --bus {names[0]}")
    time = np.array(raw.time) - log.start
    if (back := np.flatnonzero(np.diff(time) < 0)).size:
        one, other = time[back[0] : back[0] + 2]
        raise ValueError(
            f"{message.label} ({message.identified}): the time goes back from {one:.6f} to {other:.6f} s; sort the log"
        )
    return raw


def _read_frames(path: Any, options: Options, wanted: list[can_database.Column]) -> Log:
    """The frames of the wanted signals' messages, and those of their groups for J1939."""
    widths: dict[Any, int] = {}
    for entry in wanted:
        keys = (entry.message.key, *([parameter_group(entry.message.frame_id)] if entry.is_j1939 else ()))
        for key in keys:
            widths[key] = max(widths.get(key, 0), *map(can_database.least_frame_size, entry.message.signals))
    frames: dict[tuple[int, bool], Raw] = {}
    seen: Counter[tuple[int, bool]] = Counter()
    start = None
    source = _mdf_frames if Path(path).suffix.lower() in MDF else _log_frames
    for number, (time, frame_id, extended, bus, data) in enumerate(source(path, options.until)):
        start = time if start is None else start
        if options.bus is not None and str(bus) != options.bus:
            continue
        key = (frame_id, extended)
        seen[key] += 1
        if seen[key] == 1 and (key in widths or (extended and parameter_group(frame_id) in widths)):
            frames[key] = Raw(widths.get(key) or widths[parameter_group(frame_id)])
        if raw := frames.get(key):
            raw.take(number, time, str(bus), data)
    if start is None or not seen:
        where = "" if options.bus is None else f" on the bus {options.bus!r}"
        raise ValueError(f"no frame in the log{where}; is it complete?")
    return Log(start, frames, seen)


def _log_frames(path: Any, until: float) -> Iterator[Frame]:
    """The data frames of a log before a time; ValueError with the place where the log breaks off."""
    own_process.require("can", "CAN logs", "can")
    import can  # here, because it is an extra

    number, time, start, problem, frame = 0, 0.0, None, "", None
    longest: dict[int, int] = {}
    try:
        with can.LogReader(path) as reader:
            if isinstance(reader, can.ASCReader):
                reader.file = _absolute(reader.file)  # type: ignore[assignment]  # it reads lines from it
            for frame in reader:
                start = frame.timestamp if start is None else start
                if frame.timestamp - start >= until:
                    return
                time = frame.timestamp - start
                if not (frame.is_error_frame or frame.is_remote_frame):
                    size = len(frame.data)
                    if size != frame.dlc:
                        problem = f"the next one has {size} of {frame.dlc} bytes"
                        break
                    longest[frame.arbitration_id] = max(longest.get(frame.arbitration_id, 0), size)
                    yield frame.timestamp, frame.arbitration_id, frame.is_extended_id, frame.channel, bytes(frame.data)
                number += 1
            size = getattr(reader, "file_size", 0)
        problem = problem or _end(Path(path), size, frame, longest)
    except Exception as error:  # damaged logs raise exceptions of many types
        problem = str(error)
    if problem:
        whole = (
            f"take what is before that with --between 0 {np.floor(1e3 * time) / 1e3:g}" if number else "record it again"
        )
        raise ValueError(f"the log breaks off after {number} whole frames, at {time:.6f} s ({problem}); {whole}")


def _absolute(file: Any) -> Iterator[str]:
    """The lines of an ASC file; where its head says that stamps are relative, they are those of the line before added.

    Lines that are no frames count as well, which python-can skips. It also takes the first line behind the head for a
    part of that, so that one is put there.
    """
    time, relative, head = 0.0, False, True
    with closing(file):
        for line in file:
            relative = relative or bool(RELATIVE.match(line))
            if relative and not head and TRIGGER_BLOCK.match(line):
                raise ValueError("another trigger block begins, and relative stamps do not say when")
            stamp = STAMP.match(line)
            if stamp and head:
                yield "internal events logged\n"
                head = False
            if stamp and relative:
                time += float(stamp[1])
                line = f"{time:.9f} {line[stamp.end() :]}"
            yield line


def _mdf_frames(path: Any, until: float) -> Iterator[Frame]:
    """The data frames in an MDF file, in the order of their time stamps."""
    time, *rest = own_process.read("an MDF file with raw CAN frames", _frame_groups, str(path))
    count = np.searchsorted(time, time[0] + until) if time.size else 0
    for stamp, frame_id, extended, bus, size, data in zip(time[:count].tolist(), *(values[:count] for values in rest)):
        yield stamp, int(frame_id), bool(extended), str(bus), bytes(data[:size])


def _frame_groups(path: str) -> tuple[np.ndarray, ...]:
    """Time, identifier, whether that has 29 bits, bus, size and bytes of every data frame, by time."""
    import asammdf

    found = []
    with asammdf.MDF(path) as mdf:
        for group, _ in mdf.channels_db.get(FRAMES, ()):
            frames = mdf.get(FRAMES, group)
            names, values = frames.samples.dtype.names or (), frames.samples
            bits = values[f"{FRAMES}.ID"].astype(np.int64)
            extended = values[f"{FRAMES}.IDE"].astype(bool) if f"{FRAMES}.IDE" in names else bits >> 31 == 1
            bus = values[f"{FRAMES}.BusChannel"] if f"{FRAMES}.BusChannel" in names else np.zeros(bits.size, dtype=int)
            data = values[f"{FRAMES}.DataBytes"]
            data = np.pad(data, ((0, 0), (0, 64 - data.shape[1])))
            found.append(
                (frames.timestamps, bits & 0x1FFFFFFF, extended, bus, values[f"{FRAMES}.DataLength"].astype(int), data)
            )
    if not found:
        raise ValueError("it holds no raw CAN frames")
    columns = [np.concatenate(parts) for parts in zip(*found)]
    order = np.argsort(columns[0], kind="stable")
    return tuple(column[order] for column in columns)


def _end(path: Path, size: int, last: Any, longest: dict[int, int]) -> str:
    """What is wrong with the end of a log that python-can read without complaint; empty if nothing is.

    A last line without an end may be a whole frame: ``last`` has all the bytes that others of its identifier have, of
    whose sizes ``longest`` is the largest, and in formats that separate bytes they are what the line says.
    """
    if path.stat().st_size < size:
        return f"{path.stat().st_size} of {size} bytes are there"
    if path.suffix.lower() == ".blf":
        return ""
    with closing(gzip.open(path) if path.suffix.lower() == ".gz" else open(path, "rb")) as file:
        line = (deque(file, maxlen=1) or [b"\n"])[0].decode(errors="replace")
    if line.endswith("\n") or line.strip()[:1].isalpha() or line.startswith("//"):
        return ""  # what is no frame needs no end
    whole = last is not None and len(last.data) >= longest.get(last.arbitration_id, 0)
    if path.name.lower().endswith((".asc", ".trc", ".asc.gz", ".trc.gz")):
        whole = whole and " ".join(f"{byte:02X}" for byte in last.data) in line.upper()
    return "" if whole else f"the last line, {line!r}, has no end"


def _stamps(time: np.ndarray) -> np.ndarray:
    """One stamp for the frames (F,) of a batch: that of the last one of those that are less than ``BURST`` apart."""
    last = np.append(np.diff(time) > min(BURST, (time[-1] - time[0]) / time.size / 10), True)
    return np.asarray(time[last][np.cumsum(last) - last])


def _batch(times: list[np.ndarray]) -> float | None:
    """The time between two batches of a log that stamps its frames in batches [s]; None for any other log."""
    stamps = [_stamps(time) for time in times]
    shares = [np.mean(np.diff(time) == 0) for time in stamps]
    lengths = [np.median(np.diff(np.unique(time))) for time, share in zip(stamps, shares) if share > MOST_DOUBLED]
    return float(np.median(lengths)) if lengths else None


def _midway(clock: np.ndarray, time: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Instants (N,) of frames by their numbers (N,): midway between the ones before and after, of numbers (F,) [s]."""
    before = np.searchsorted(clock, numbers, side="right") - 1
    after = np.searchsorted(clock, numbers)
    return np.asarray(time[np.maximum(before, 0)] + time[np.minimum(after, clock.size - 1)]) / 2


def _block_time(times: list[np.ndarray]) -> float | None:
    """The time between two stamps of a log in which frames of several messages share them [s]; None for any other."""
    every = np.concatenate(times)
    stamps = np.unique(every)
    return float(np.median(np.diff(stamps))) if every.size - stamps.size > MOST_DOUBLED * every.size else None


def _spread(stamps: np.ndarray, declared: float | None) -> tuple[np.ndarray, float]:
    """Strictly ascending instants of frames that are stamped in batches, and the cycle time that is between them [s].

    The frames of one stamp are spread over the time before it, the cycle time apart, but not into the batch before. The
    cycle time is that which the database declares if the log agrees within a quarter, or else that of the log.
    """
    at, first, count = np.unique(stamps, return_index=True, return_counts=True)
    steps = np.diff(at)
    near = steps <= LONGEST_STEP * np.median(steps)
    found = float(steps[near].sum() / count[1:][near].sum())
    cycle = declared if declared and abs(declared / found - 1) < 0.25 else found
    at[-1] = min(at[-1], at[-2] + count[-1] * cycle)  # a log may end within a batch
    step = np.minimum(np.append(cycle, np.diff(at) / count[1:]), cycle)
    group = np.repeat(np.arange(at.size), count)
    return at[group] - ((first + count)[group] - np.arange(stamps.size)) * step[group], cycle


def _frame_statistics(message: Message, stamps: np.ndarray, data: np.ndarray, size: np.ndarray) -> dict[str, Any]:
    """What the meta tells of a message's frames."""
    time = np.unique(stamps)
    steps = np.diff(time)
    told: dict[str, Any] = {"id": identifier(*message.key), "frames": stamps.size}
    content = [signal for signal in message.signals if not signal.is_multiplexer]
    undescribed = ~np.any([contains_signal(message, signal, data, size) for signal in content], axis=0)
    if undescribed.any():
        told["not_decoded"] = int(np.count_nonzero(undescribed))
    if steps.size:
        longest = int(np.argmax(steps))
        told["rate_hz"] = float((stamps.size - 1) / (time[-1] - time[0]))
        told["longest_step_s"], told["longest_step_at_s"] = float(steps[longest]), float(time[longest])
        told["gaps"] = int(np.count_nonzero(steps > LONGEST_STEP * np.median(steps)))
    for signal in message.signals:
        if any(part in signal.name.lower() for part in COUNTERS) and signal.length < 64:
            most = signal.maximum if signal.maximum and signal.maximum > 0 else 2**signal.length - 1
            counts = can_database.raw_values(signal, data)[contains_signal(message, signal, data, size)].astype(float)
            told["missed_by_counter"] = int(np.sum(np.maximum(np.diff(counts) % (int(most) + 1) - 1, 0)))
    return told
