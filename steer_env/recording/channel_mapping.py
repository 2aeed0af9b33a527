"""Mappings: which channel of a measured file is which of ours, in what unit, with what sign, delay and offset.

A mapping is a small TOML file; every key but ``[channels.NAME]`` itself may be left out:

    [channels.handwheel_angle]
    from = "SteeringWheelAngle"   # name in the file, with or without its unit; by default the same name as here
    unit = "deg"                  # where the file does not say, or says it wrongly
    sign = -1                     # 1 or -1
    delay_ms = 10                 # the channel comes this much late; it is shifted back
    offset = 0.3                  # reading of the sensor at zero, in `unit`, before the sign is turned
    [meta]
    manoeuvre = "weave"
    speed_m_s = 27.8

``[channels.time]`` names the time base, where a file calls it otherwise; it takes ``from`` and ``unit`` only.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from steer_env.friction.numerics import toml
from steer_env.friction.numerics.check import number
from steer_env.recording.recording import check_meta
from steer_env.recording.units import SPELLINGS, understood
from steer_env.vehicle import plant
from steer_env.vehicle.chassis import two_track

# Channels that have a name of their own -> unit in memory.
KNOWN = {**dict(plant.CHANNELS), **dict(two_track.CHANNELS), "vehicle_speed": "m/s"}

_KEYS = ("from", "unit", "sign", "delay_ms", "offset")
_TIME_KEYS = ("from", "unit")


class Entry(NamedTuple):
    """How one channel is read; made and checked by :func:`entry` or :func:`parse_entry`."""

    name: str  # of the channel in the recording
    source: str  # its name in the file
    unit: str | None  # its unit in the file; None: as the file says
    sign: float = 1.0  # 1 or -1 [1]
    delay: float = 0.0  # by which the channel comes late [s]
    offset: float = 0.0  # subtracted before the sign is turned [unit of the file]


@dataclass(frozen=True)
class Mapping:
    """Entries by the channel's name, and meta that goes over that of the file."""

    channels: dict[str, Entry] = field(default_factory=dict)
    meta: dict[str, Any] = field(default_factory=dict)

    def with_entries(self, entries: Iterable[Entry]) -> "Mapping":
        """Entries added, or put in place of those of the same channel; for flags on top of a file."""
        return replace(self, channels={**self.channels, **{entry.name: entry for entry in entries}})


def load(path: str | PathLike[str]) -> Mapping:
    """A mapping from a TOML file.

    Raises
    ------
    ValueError
        Naming the file, and the key and what is allowed there, or the line of a syntax error.
    OSError
        A file that cannot be read.
    """
    try:
        return from_data(toml.loads(Path(path).read_text(encoding="utf-8-sig")))
    except UnicodeDecodeError:
        raise ValueError(f"{path}: expected text in UTF-8") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def from_data(data: dict[str, Any]) -> Mapping:
    """A mapping from the contents of a file; ValueError naming the key and what is allowed there."""
    for key in data:
        if key not in ("channels", "meta"):
            raise ValueError(f"no section {key!r} in a mapping; it takes [channels.NAME] and [meta]")
    for key, section in data.items():
        if not isinstance(section, dict):
            raise ValueError(f"{key} must hold keys and values, got {section!r}")
    meta = data.get("meta", {})
    for key, value in meta.items():
        check_meta(key, value)
    return Mapping({name: entry(name, given) for name, given in data.get("channels", {}).items()}, dict(meta))


def entry(name: str, given: Any) -> Entry:
    """An entry from the keys of its section; ValueError naming the key and what is allowed there."""
    where, allowed = f"channels.{name}", _TIME_KEYS if name == "time" else _KEYS
    if not isinstance(given, dict):
        raise ValueError(f"{where} must hold keys and values ({', '.join(allowed)}), got {given!r}")
    for key in given:
        if key not in allowed:
            raise ValueError(f"{where} has no key {key!r}; it takes {', '.join(allowed)}")
    for key in ("from", "unit"):
        if not isinstance(given.get(key, ""), str):
            raise ValueError(f"{where}.{key} must be text, got {given[key]!r}")
    source, unit, sign = given.get("from") or name, given.get("unit"), given.get("sign", 1)
    if unit is not None:
        _check_unit(where, name, unit)
    elif name not in KNOWN and name != "time":
        raise ValueError(
            f"{where}: no channel is known as {name!r}, {did_you_mean(name, KNOWN)} (with a unit, any name will do)"
        )
    if isinstance(sign, bool) or sign not in (1, -1):
        raise ValueError(f"{where}.sign must be 1 or -1, got {sign!r}")
    delay, offset = (_number(f"{where}.{key}", given.get(key, 0.0)) for key in ("delay_ms", "offset"))
    return Entry(name, source, unit, float(sign), delay / 1e3, offset)


def parse_entry(text: str) -> Entry:
    """An entry from its compact form, ``handwheel_angle=SteeringWheelAngle[deg],sign=-1,delay_ms=10``.

    The name in the file may hold brackets, but no comma: such a one needs a mapping file. ValueError as :func:`entry`.
    """
    name, equals, rest = (part.strip() for part in text.partition("="))
    if not (name and equals):
        raise ValueError(f"expected NAME=NAME_IN_FILE[unit],sign=-1,delay_ms=10,offset=0.3; got {text!r}")
    source, *settings = (part.strip() for part in rest.split(","))
    given: dict[str, Any] = {"from": source}
    if source.endswith("]"):
        given["from"], _, unit = (part.strip() for part in source[:-1].rpartition("["))
        given["unit"] = unit
    for setting in settings:
        key, equals, value = (part.strip() for part in setting.partition("="))
        if not equals or key in given:
            raise ValueError(f"{text!r}: expected each of key=value once ({', '.join(_KEYS[1:])}), got {setting!r}")
        given[key] = value if key in ("from", "unit") else _read_number(value)
    try:
        return entry(name, given)
    except ValueError as error:
        raise ValueError(f"{text!r}: {error}") from None


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Those of ``names`` that are close to ``name``, or the first thirty if none is, as a clause of a message."""
    names = list(dict.fromkeys(names))
    close = get_close_matches(name, names)
    if close:
        return f"did you mean {' or '.join(close)}?"
    return f"there are {', '.join(names[:30])}{', ...' if len(names) > 30 else ''}"


def _check_unit(where: str, name: str, unit: str) -> None:
    found = understood(unit)
    if found is None:
        raise ValueError(f"{where}.unit {unit!r} is not known; known are {SPELLINGS}")
    expected = "s" if name == "time" else KNOWN.get(name, found[0])
    if found[0] != expected:
        raise ValueError(f"{where}.unit {unit!r} does not fit {name}, which is kept in {expected!r}")


def _read_number(text: str) -> Any:
    try:
        return float(text)
    except ValueError:
        return text


def _number(where: str, value: Any) -> float:
    if isinstance(value, str | bool):  # float() takes them
        raise ValueError(f"{where} must be a number, got {value!r}")
    return number(where, value)
