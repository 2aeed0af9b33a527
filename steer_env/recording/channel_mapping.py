"""Mappings: which column of a measured file holds which channel, with its unit, sign, delay and offset.

A mapping is a small TOML file; every key of a section may be left out:

    [channels.handwheel_angle]
    from = "SteeringWheelAngle"   # name in the file, with or without its unit; by default the same name as here
    unit = "deg"                  # needed where the file names no unit, or a wrong one
    sign = -1                     # 1 or -1
    delay_ms = 10                 # delay of the channel, which is corrected
    offset = 0.3                  # reading of the sensor at zero, in `unit`, before the sign is changed
    scale = 1.02                  # factor on the reading, for a sensor that reads too little or in counts
    sign_from = "LWS.ANGLE_SIGN"  # in a CAN log: the signal that is 1 where the reading, a magnitude, is negative
    [meta]
    manoeuvre = "weave"
    speed_m_s = 27.8

The value in SI is sign * scale * (reading - offset) in the unit. ``[channels.time]`` names the time base of a file that
uses another name; it takes ``from`` and ``unit`` only. The unit ``counts`` is that of a sensor without a calibration:
the channel is read, and metrics that need it in its own unit are refused. A record of friction
(:mod:`steer_env.recording.friction_record`) has the channels of ``FRICTION``. A channel that no metric knows has a name
that begins with ``own_``, and a unit.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from os import PathLike
from typing import Any, NamedTuple

from steer_env.friction.numerics import toml
from steer_env.friction.numerics.check import did_you_mean, number, read_number
from steer_env.recording.recording import check_meta
from steer_env.recording.units import COUNTS, SPELLINGS, parse_unit
from steer_env.vehicle import plant
from steer_env.vehicle.chassis import two_track

# Known channels -> unit in memory.
KNOWN = {
    **dict(plant.CHANNELS),
    **dict(two_track.CHANNELS),
    "vehicle_speed": "m/s",
    "sideslip_angle": "rad",
    "assistance_active": "1",  # not zero while something else than the hands steers, as lane keeping does
}
# Channels of a record of friction -> the units in memory that each may have: those of an angle or of a travel.
FRICTION = {
    "displacement": ("rad", "m"),
    "displacement_speed": ("rad/s", "m/s"),
    "friction": ("N m", "N"),
    "load": ("N", "N m"),
}
OWN_PREFIX = "own_"  # begins the names of further channels, which no metric reads; they need a unit

SIGNED = " signed by "  # between the names of a magnitude and of the signal of its sign

_ENTRY_KEYS = ("from", "unit", "sign", "delay_ms", "offset", "scale", "sign_from")
_TIME_KEYS = ("from", "unit")


class Entry(NamedTuple):
    """How one channel is read; made and checked by :func:`entry` or :func:`parse_entry`."""

    name: str  # name of the channel in the recording
    source: str  # name in the file
    unit: str | None  # unit in the file; None: the unit that the file names
    sign: float = 1.0  # 1 or -1 [1]
    delay: float = 0.0  # delay of the channel [s]
    offset: float = 0.0  # subtracted before the sign is changed [unit of the file]
    scale: float = 1.0  # factor on what remains [1]
    sign_from: str | None = None  # signal of a CAN log that is 1 where the reading is negative; None: it has its sign

    @property
    def column(self) -> str:
        """The column of the file: the source, with the signal of its sign."""
        return self.source if self.sign_from is None else f"{self.source}{SIGNED}{self.sign_from}"


@dataclass(frozen=True)
class Mapping:
    """Entries by channel name, and meta that replaces the meta of the file."""

    channels: dict[str, Entry] = field(default_factory=dict)
    meta: dict[str, Any] = field(default_factory=dict)

    def with_entries(self, entries: Iterable[Entry]) -> "Mapping":
        """The mapping with further entries, which replace those of the same channel; for flags on the command line."""
        return replace(self, channels={**self.channels, **{entry.name: entry for entry in entries}})

    def plain(self) -> dict[str, Any]:
        """The mapping as text, numbers and mappings, for the trace of a result."""
        return {"channels": {name: entry._asdict() for name, entry in self.channels.items()}, "meta": self.meta}


def load(path: str | PathLike[str]) -> Mapping:
    """A mapping from a TOML file.

    Raises
    ------
    ValueError
        If the file is not a mapping. The message names the file, and the key with what is allowed there or the line of
        a syntax error.
    OSError
        If the file cannot be opened.
    """
    data = toml.read(path)
    try:
        return from_data(data)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def from_data(data: dict[str, Any]) -> Mapping:
    """A mapping from the contents of a file; a ValueError names the wrong key and what is allowed there."""
    for key in data:
        if key not in ("channels", "meta"):
            raise ValueError(f"no section {key!r} in a mapping; it takes [channels.NAME] and [meta]")
    for key, section in data.items():
        if not isinstance(section, dict):
            raise ValueError(f"{key} must hold keys and values, got {section!r}")
    meta = data.get("meta", {})
    for key, value in meta.items():
        check_meta(key, value)
    entries = [entry(name, given) for name, given in data.get("channels", {}).items()]
    return Mapping({found.name: found for found in entries}, dict(meta))


def entry(name: str, given: Any) -> Entry:
    """An entry from the keys of its section; a ValueError names the wrong key and what is allowed there."""
    where = f"channels.{name}"
    allowed = _TIME_KEYS if name == "time" else _ENTRY_KEYS
    if not isinstance(given, dict):
        raise ValueError(f"{where} must hold keys and values ({', '.join(allowed)}), got {given!r}")
    for key in given:
        if key not in allowed:
            raise ValueError(f"{where} has no key {key!r}; it takes {', '.join(allowed)}")
    for key in ("from", "unit", "sign_from"):
        if not isinstance(given.get(key, ""), str):
            raise ValueError(f"{where}.{key} must be text, got {given[key]!r}")
    source, unit, sign = given.get("from") or name, given.get("unit"), given.get("sign", 1)
    known = (*KNOWN, *FRICTION)
    if name not in known and name != "time" and not (name.startswith(OWN_PREFIX) and unit is not None):
        hint = f"{did_you_mean(name, known)} (a channel of your own begins with {OWN_PREFIX} and has a unit)"
        raise ValueError(f"{where}: no channel is known as {name!r}, {hint}")
    if unit is not None:
        _check_unit(where, name, unit)
    if isinstance(sign, bool) or sign not in (1, -1):
        raise ValueError(f"{where}.sign must be 1 or -1, got {sign!r}")
    delay, offset = (number(f"{where}.{key}", given.get(key, 0.0)) for key in ("delay_ms", "offset"))
    scale = number(f"{where}.scale", given.get("scale", 1.0), minimum=0.0, above=True)
    return Entry(name, source, unit, float(sign), delay / 1e3, offset, scale, given.get("sign_from"))


def parse_entry(text: str) -> Entry:
    """An entry from its compact form, ``handwheel_angle=SteeringWheelAngle[deg],sign=-1,delay_ms=10``.

    The name in the file may contain brackets but no comma; a name with a comma needs a mapping file. Errors are those
    of :func:`entry`.
    """
    name, equals, rest = (part.strip() for part in text.partition("="))
    if not (name and equals):
        raise ValueError(f"expected NAME=NAME_IN_FILE[unit],sign=-1,delay_ms=10,offset=0.3,scale=1.02; got {text!r}")
    source, *settings = (part.strip() for part in rest.split(","))
    given: dict[str, Any] = {"from": source}
    if source.endswith("]"):
        given["from"], _, unit = (part.strip() for part in source[:-1].rpartition("["))
        given["unit"] = unit
    for setting in settings:
        key, equals, value = (part.strip() for part in setting.partition("="))
        if not equals or key in given:
            raise ValueError(
                f"{text!r}: expected each of key=value once ({', '.join(_ENTRY_KEYS[1:])}), got {setting!r}"
            )
        given[key] = value if key in ("from", "unit", "sign_from") else read_number(value)
    try:
        return entry(name, given)
    except ValueError as error:
        raise ValueError(f"{text!r}: {error}") from None


def _check_unit(where: str, name: str, unit: str) -> None:
    found = parse_unit(unit)
    if found is None:
        raise ValueError(f"{where}.unit {unit!r} is not known; known are {SPELLINGS}")
    expected = ("s",) if name == "time" else (KNOWN[name],) if name in KNOWN else FRICTION.get(name, found[:1])
    if found[0] not in (*expected, COUNTS):
        kept = " or ".join(map(repr, expected))
        raise ValueError(f"{where}.unit {unit!r} does not fit {name}, which is kept in {kept}")
