"""What the bytes of CAN frames are: databases, read with the package cantools, and their signals.

A database that cantools refuses as a whole is read in parts, so that an entry which cannot be read costs only the
signals that it describes. An identifier or a name that two entries define differently is never chosen by their order.

A raw value is no value of its signal, but a gap, where it is

* beyond the signal's range [minimum|maximum], by more than half a count. [0|0] is no range, and neither is that of the
  raw values themselves, which some databases give for a signal with a scale;
* named by the database as no value: see ``named_codes``;
* in a message of J1939, not available, an error or reserved, by the table of SAE J1939-71 (see ``is_j1939``);
* the invalid value that databases of other formats than DBC declare.
"""

import re
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from steer_env.friction.numerics.check import number
from steer_env.recording import own_process
from steer_env.recording.csv_file import encoding_of
from steer_env.recording.table import NO_VALUE, gaps

LONGEST = 64  # signal that is read [bit]
LARGEST = 1e30  # number of a database [unit of its signal]
MOST_NAMED_VALUES = 16  # most names of a signal whose last raw values, where they have names, are codes; assumed [1]
# Words of a name that say there is no value, in any signal; and those that also may be a state, as of a switch.
INVALID = (
    r"invalid|not valid|unknown|undefin\w*|sna|n a|not avail\w*|unavailable|no data\w*|no signal|no value|missing|"
    r"ung\S* ?\S?ltig|nicht (verf\w*|definiert|vorhanden|verbaut)|kein wert"
)
NO_READING = (
    r"err|error|\w*fehler\w*|fault\w*|fail\w*|defect|defekt|(un)?init\w*|not \w+|nicht \w+|notused|unused|reserved|"
    r"reserviert|default|overflow|underflow|out of range|(im|un)plausib\w*|timeout|ersatzwert|dont care|na ?n"
)
ORDINARY = r"no (fault|error)s?|not faulted|fehlerfrei|kein fehler|valid range|real values?"  # names of what is a value
SIGN = r"vorzeichen( der)?|vorz|vz|sign|sgn|direction"  # part of the name of a signal that is the sign of another
LONGEST_SIGN = 2  # of such a signal, with a code for what is no sign [bit]
NEGATIVE = r"neg\w*|minus"  # names of what is a sign
AVAILABLE = 0xFA  # largest first byte of what is a value in J1939; then reserved, 0xFE error, 0xFF not available
# Kinds of statements of a DBC that say how bytes are read; the others are comments, nodes and attributes.
STATEMENT = re.compile(r"^[ \t]*(?=[A-Z]+_(?:[A-Z]+_)*\s)", re.MULTILINE)
IDENTIFIER = re.compile(r'^(\s*(?:BO_|VAL_|SIG_VALTYPE_|SG_MUL_VAL_|BA_\s+"\w+"\s+(?:BO_|SG_))\s+)(\d+)', re.MULTILINE)
OF_SIGNALS = ("VAL_", "SIG_VALTYPE_", "SG_MUL_VAL_")


class Message(NamedTuple):
    """A message as a database describes it."""

    database: str  # name of the database in labels
    label: str  # its name, behind that of the database and a colon where two messages have it
    name: str
    frame_id: int
    extended: bool  # whether the identifier has 29 bits
    cycle: float | None  # time between two frames [s]
    j1939: bool  # whether the database says so
    signals: tuple[Any, ...]  # of cantools

    @property
    def key(self) -> tuple[int, bool]:
        """What its frames have."""
        return self.frame_id, self.extended

    @property
    def identified(self) -> str:
        """Its identifier, as messages of errors show it."""
        return f"id {identifier(*self.key)}"

    @property
    def content(self) -> tuple[Any, ...]:
        """All that says how its frames are read, by which two definitions are the same or not."""
        fields = ("name", "start", "length", "byte_order", "is_signed", "minimum", "maximum", "unit", "multiplexer_ids")
        return (
            self.name,
            self.key,
            sorted((*(str(getattr(s, key)) for key in fields), repr(s.conversion), s.is_float) for s in self.signals),
        )


class Column(NamedTuple):
    """A signal of a message."""

    label: str  # MESSAGE.SIGNAL, behind the name of the database and a colon where there are two of those
    message: Message
    signal: Any
    apart: str  # why it needs the name of its database; empty if it does not

    @property
    def sign(self) -> "Column | None":
        """The signal that holds its sign, which its own bits do not; None if there is none."""
        signal, own = self.signal, _words(self.signal.name)
        signed = signal.is_signed and not 0 <= (signal.minimum or 0) < (signal.maximum or 0)
        if signed or signal.is_float or signal.length <= LONGEST_SIGN or signal.offset < 0 < signal.scale:
            return None
        short = "".join(word[0] + "".join(f"{letter}?" for letter in word[1:]) for word in own.split())
        for other in self.message.signals:
            words = _words(other.name)
            stem = re.sub(rf"\b({SIGN})\b *", "", words).strip()
            mine = set(stem.split()) <= set(own.split()) or (len(stem) > 2 and own.startswith(stem))
            mine = mine or bool(re.fullmatch(short, stem.replace(" ", "")))
            if other.length <= LONGEST_SIGN and stem not in (words, "") and mine:
                return self._replace(label=f"{self.label.rpartition('.')[0]}.{other.name}", signal=other)
        return None

    @property
    def negative(self) -> int:
        """The raw value of a sign that stands for minus: the one whose name says so; 1 without names."""
        names = self.signal.choices or {}
        return next((int(raw) for raw, name in names.items() if re.search(rf"\b({NEGATIVE})", _words(str(name)))), 1)

    @property
    def limits(self) -> tuple[float, float]:
        """The range of its values, infinite where the database gives none [unit of the signal]."""
        signal, raw = self.signal, _raw_range(self.signal)
        low, high = signal.minimum, signal.maximum
        scaled = (signal.scale, signal.offset) != (1, 0)
        if low is None or high is None or low >= high or (scaled and (low, high) in (raw, (0, 2**signal.length - 1))):
            return -np.inf, np.inf
        slack = 0.0 if signal.is_float else abs(signal.scale) / 2
        return (low - slack if low > -LARGEST else -np.inf), (high + slack if high < LARGEST else np.inf)

    @property
    def is_j1939(self) -> bool:
        """Whether the message is one of J1939: the database says so, or its identifier is like one.

        That has 29 bits of which the extended data page is 0, and a group that is sent to all or the null address.
        """
        group, address = (self.message.frame_id >> 16) & 0xFF, self.message.frame_id & 0xFF
        like = self.message.extended and not (self.message.frame_id >> 25) & 1 and (group >= 0xF0 or address == 0xFE)
        return self.message.j1939 or like

    def named_codes(self) -> dict[int, str]:
        """The raw values whose names say that they are no values, with these names.

        In a signal that counts or enumerates (every raw value has a name; or it has no unit, no scale and at most eight
        bits, as a gear or a switch has, and names for more than the last raw values of a byte), these are names such as
        "Invalid", "SNA", "Not available", "Unknown"; all other names are those of states, and stay numbers. In a signal
        that measures, they are also names such as "Error", "Fault", "Init", "Reserved", and, where it has no more than
        ``MOST_NAMED_VALUES`` names, any name of raw values that are the last ones of its bits, as 255 and 254 of eight;
        any other name, as 0 "Straight", is that of a value.
        """
        signal = self.signal
        lowest, highest = _raw_range(signal)
        names = {}
        for raw, name in (signal.choices or {}).items():
            # Databases also give a signed raw value as the unsigned one of the same bits, and the other way round.
            same_bits = -(1 << (signal.length - 1)) <= int(raw) < 1 << signal.length
            names[(int(raw) - lowest) % (1 << signal.length) + lowest if same_bits else int(raw)] = str(name)
        ends = set()
        for end, step in (highest, -1), (lowest, 1):
            while end in names and end != 0:
                ends.add(end)
                end += step
        plain = not signal.unit and (signal.scale, signal.offset) == (1, 0) and signal.length <= 8
        counts = signal.length == 8 and names.keys() <= ends  # a byte of which only codes have names
        states = (plain and not counts) or len(names) > highest - lowest
        words = rf"\b({INVALID if states else f'{INVALID}|{NO_READING}'})( ?\d+)?\b"
        codes = {raw for raw, name in names.items() if re.search(words, _words(name))}
        if not states and len(names) <= MOST_NAMED_VALUES:
            codes |= ends
        return {raw: names[raw] for raw in codes if not re.search(ORDINARY, _words(names[raw]))}

    def read(self, data: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray, dict[str, int]]:
        """The values in frames.

        Parameters
        ----------
        data : (F, B) array of uint8
            The bytes of each frame, filled up to one length.
        size : (F,) array
            How many of them each frame has.

        Returns
        -------
        there : (F,) array of bool
            Whether a frame holds the signal: it is long enough, and the multiplexer selects it.
        values : (F,) array
            In the unit of the signal; NaN where the raw value is no value, or is not there.
        codes : dict of str to int
            What the raw values without a value are, and how many there are.

        Raises
        ------
        ValueError
            If the signal has more than ``LONGEST`` bits, or a number that it cannot be scaled with, as 0.
        """
        signal = self.signal
        for key in ("scale", "offset"):
            number(f"{key} of {self.label}", getattr(signal, key), minimum=-LARGEST, maximum=LARGEST)
        if signal.scale == 0:
            raise ValueError(f"the scale of {self.label} is 0")
        with np.errstate(invalid="ignore", over="ignore"):  # of floating-point numbers that are none
            there, raw = contains_signal(self.message, signal, data, size), raw_values(signal, data)
            values = raw * float(signal.scale) + float(signal.offset)
            low, high = self.limits
            beyond = f"beyond [{signal.minimum:g}|{signal.maximum:g}]" if np.isfinite((low, high)).any() else ""
            kinds = [(raw == code, f"{code} ({name})") for code, name in sorted(self.named_codes().items())]
            if signal.raw_invalid is not None:
                kinds.append((raw == signal.raw_invalid, f"{signal.raw_invalid} (invalid)"))
            if self.is_j1939 and not (signal.is_signed or signal.is_float or signal.length == 1):
                kinds += _j1939_codes(signal.length, raw)
            kinds += [((values < low) | (values > high), beyond), (~np.isfinite(values), "not a finite number")]
        told: dict[str, Any] = {}
        found = np.full(there.size, np.nan)
        found[there] = gaps(told, self.label, values[there], {name: where[there] for where, name in kinds})
        return there, found, told.get(NO_VALUE, {}).get(self.label, {})


def contains_signal(message: Message, signal: Any, data: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Whether frames (F,) are long enough for a signal and its multiplexer, if it has one, selects it."""
    there = np.asarray(size >= least_frame_size(signal))
    switch = next((one for one in message.signals if one.name == signal.multiplexer_signal), None)
    if switch is None or signal.multiplexer_ids is None:
        return there
    chosen = np.isin(raw_values(switch, data), signal.multiplexer_ids)
    return there & chosen & contains_signal(message, switch, data, size)


def _words(name: str) -> str:
    """A name as words in small letters: "SignalNotAvailable_1" is "signal not available 1"."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name)
    return re.sub(r"[\W_]+", " ", apart).strip().lower()


def _raw_range(signal: Any) -> tuple[int, int]:
    """The smallest and the largest raw value that the bits of a signal hold."""
    half = 1 << (signal.length - 1)
    return (-half, half - 1) if signal.is_signed else (0, 2 * half - 1)


def _bit_range(signal: Any) -> tuple[int, int, int]:
    """The first and the last byte of a signal, and how many bits of the last significant one stand below it."""
    if signal.byte_order == "little_endian":
        return signal.start // 8, (signal.start + signal.length - 1) // 8, signal.start % 8
    first = 8 * (signal.start // 8) + 7 - signal.start % 8  # bits counted from the most significant one of each byte
    last = first + signal.length - 1
    return first // 8, last // 8, 7 - last % 8


def least_frame_size(signal: Any) -> int:
    """How many bytes a frame has at least that holds a signal."""
    return _bit_range(signal)[1] + 1


def raw_values(signal: Any, data: np.ndarray) -> np.ndarray:
    """The raw values (F,) of a signal in the bytes (F, B) of frames, of which each has all that the signal needs."""
    first, last, below = _bit_range(signal)
    if signal.length > LONGEST or (signal.is_float and signal.length not in (16, 32, 64)):
        kind = "floating-point " if signal.is_float else ""
        raise ValueError(f"{kind}signal {signal.name} has {signal.length} bits, which is not read")
    places = range(first, last + 1) if signal.byte_order == "little_endian" else range(last, first - 1, -1)
    raw = np.zeros(len(data), dtype=np.uint64)
    for k, place in enumerate(places):
        byte, shift = data[:, place].astype(np.uint64), 8 * k - below
        raw |= byte << np.uint64(shift) if shift >= 0 else byte >> np.uint64(-shift)
    raw &= np.uint64(2**signal.length - 1)
    if signal.is_float:
        return raw.astype(f"u{signal.length // 8}").view(f"f{signal.length // 8}").astype(float)
    if signal.is_signed:
        sign = np.uint64(1 << (signal.length - 1))
        return (raw ^ sign).astype(np.int64) - np.int64(sign) if signal.length < LONGEST else raw.view(np.int64)
    return raw


def _j1939_codes(length: int, raw: np.ndarray) -> list[tuple[np.ndarray, str]]:
    """The raw values that are none in J1939: by their first byte, or the last two of fields that have less than one."""
    highest = 2**length - 1
    if length < 8 or length % 4:
        return [(raw == highest, f"{highest} (not available)"), (raw == highest - 1, f"{highest - 1} (error)")]
    first = raw >> np.uint64(length - 8)
    kinds = ((first == 0xFF, "0xFF", "not available"), (first == 0xFE, "0xFE", "error"))
    rest = (first > AVAILABLE, f"0x{AVAILABLE + 1:X} to 0xFD", "reserved")
    return [(where, f"{code}{'..' * (length > 8)} ({name})") for where, code, name in (*kinds, rest)]


def parameter_group(frame_id: int) -> int:
    """The parameter group of an identifier of J1939, which has the source address and the priority besides."""
    group = (frame_id >> 8) & 0x3FFFF
    return group if (group >> 8) & 0xFF >= 0xF0 else group & 0x3FF00


def identifier(frame_id: int, extended: bool) -> str:
    """An identifier of 11 bits with three digits, of 29 bits with eight."""
    return f"0x{frame_id:08X}" if extended else f"0x{frame_id:03X}"


def load(paths: Sequence[str | PathLike[str]]) -> tuple[list[Column], dict[str, str]]:
    """Every signal of the databases, and what could not be read of them: MESSAGE or MESSAGE.SIGNAL -> reason.

    Raises
    ------
    ValueError
        If a database holds no message that can be read, or without the package cantools.
    OSError
        If a database cannot be opened.
    """
    names = [Path(path).stem for path in paths]
    left: dict[str, str] = {}
    found: list[Message] = []
    for path, name in zip(paths, names):
        for entry in _messages(path, left):
            cycle = entry.cycle_time / 1e3 if isinstance(entry.cycle_time, int | float) else None
            message = Message(
                database=name if names.count(name) == 1 else str(path),
                label=entry.name,
                name=entry.name,
                frame_id=entry.frame_id,
                extended=entry.is_extended_frame,
                cycle=cycle,
                j1939=entry.protocol == "j1939",
                signals=tuple(entry.signals),
            )
            if all(message.content != other.content for other in found):
                found.append(message)
    if not found:
        raise ValueError(f"{', '.join(map(str, paths))}: no message in it")
    columns = []
    names = [message.name for message in found]
    of_key: dict[tuple[int, bool], list[Message]] = defaultdict(list)
    for message in found:
        of_key[message.key].append(message)
    sources = Counter(f"{message.name}.{signal.name}" for message in found for signal in message.signals)
    for message in found:
        if names.count(message.name) > 1:
            message = message._replace(label=f"{message.database}:{message.name}")
        rivals = of_key[message.key]
        said = " and ".join(f"{other.name} in {other.database}" for other in rivals)
        for signal in message.signals:
            label = f"{message.name}.{signal.name}"
            apart = f"{message.identified} is {said}" if len(rivals) > 1 else ""
            apart = apart or f"{label} is there {sources[label]} times" * (sources[label] > 1)
            columns.append(Column(f"{message.database}:{label}" if apart else label, message, signal, apart))
    twice = {label for label, times in Counter(column.label for column in columns).items() if times > 1}
    left |= dict.fromkeys(twice, "it is defined twice, in different ways")
    return [column for column in columns if column.label not in twice], left


def _messages(path: str | PathLike[str], left: dict[str, str]) -> list[Any]:
    """The messages of a database, as cantools has them; what it cannot read of a DBC goes to ``left``."""
    own_process.require("cantools", "CAN databases", "can")
    import cantools  # here, because it is an extra

    try:
        database = cantools.database.load_file(path, encoding=encoding_of(path), strict=False)
        return list(getattr(database, "messages", []))
    except OSError:
        raise
    except Exception as error:  # cantools raises those of its parsers
        text = Path(path).read_text(encoding=encoding_of(path), errors="replace")
        found = _in_parts(text, cantools.database.load_string, left)
        if found:
            return found
        raise ValueError(f"{path} cannot be read as a CAN database: {' '.join(str(error).split())}") from None


def _extended_identifier(found: re.Match[str]) -> str:
    """An identifier with the mark of one of 29 bits if it has more than 11, which a standard one cannot have."""
    frame_id = int(found[2])
    return found[1] + str(frame_id | 1 << 31 if 0x7FF < frame_id < 1 << 29 else frame_id)


def _in_parts(text: str, parse: Callable[..., Any], left: dict[str, str]) -> list[Any]:
    """The messages of a DBC with what is said of their signals; those that ``parse`` refuses go to ``left``.

    An identifier of more than 11 bits without the mark of 29 bits is taken for one with it, which it can only be.
    """
    blocks: list[list[str]] = []
    about: dict[tuple[str, str], list[str]] = defaultdict(list)
    head = ""

    def loads(part: str) -> bool:
        try:
            parse(part, "dbc", strict=False)
        except Exception:  # cantools raises those of its parsers
            return False
        return True

    for part in STATEMENT.split(IDENTIFIER.sub(_extended_identifier, text)):
        kind, *words = re.findall(r"\w+", part.partition("\n")[0]) or [""]
        if kind == "BO_":
            blocks.append([part])
        elif kind == "SG_" and blocks:
            blocks[-1].append(part)
        elif kind in OF_SIGNALS and len(words) > 1:
            about[words[0], words[1]].append(part)
        elif kind.startswith("BA_DEF") and loads(part):
            head += part
        elif (found := re.match(r'BA_\s+("\w+")\s+(?:BO_\s+(\d+)|SG_\s+(\d+)\s+(\w+))', part)) and found[1] in head:
            about[found[2] or found[3], found[4] or ""].append(part)

    def word(part: str) -> str:
        """The identifier of a message, or the name of a signal."""
        return next(iter(re.findall(r"\w+", part)[1:]), "")

    def whole(block: list[str]) -> str:
        names = dict.fromkeys(["", *map(word, block[1:])])
        return "".join(block + [part for name in names for part in about.get((word(block[0]), name), ())])

    def readable(chosen: list[list[str]]) -> list[Any]:
        """The messages of the blocks that can be read, which are found by halves."""
        try:
            return list(parse(head + "".join(map(whole, chosen)), "dbc", strict=False).messages)
        except Exception as error:  # cantools raises those of its parsers
            reason = " ".join(str(error).split())
        if len(chosen) > 1:
            half = len(chosen) // 2
            return readable(chosen[:half]) + readable(chosen[half:])
        (block,) = chosen
        name = " ".join(block[0].split()[2:3]).rstrip(":")
        good = [part for part in block[1:] if readable([[block[0], part]])] if len(block) > 2 else []
        if good and len(good) < len(block) - 1:
            return readable([[block[0], *good]])
        left[f"{name}.{word(block[1])}" if len(block) == 2 else name] = reason
        return []

    return readable(blocks) if blocks else []
