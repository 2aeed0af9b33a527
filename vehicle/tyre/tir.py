"""Tyre property files (.tir) of the Magic Formula: read, check, write. :func:`tyre.from_file` interprets them.

A file has lines ``KEY = value`` under headings ``[SECTION]``; text is quoted, and ``$`` and ``!`` start a comment.
FITTYP in [MODEL], or PROPERTY_FILE_FORMAT of ADAMS, selects the equations: 5.2 (FITTYP 5, 6, 21, 51, 52; 'PAC2002',
'MF_05'), those of the 2006 book (60), 6.1 (61) and 6.2 (62).

[UNITS] hold for dimensions, loads, speeds, pressures, stiffnesses and ranges. The coefficients of the formula are in
radians and ratios whatever [UNITS] states, as in MF-Tyre and ADAMS.

An empty value is none. What the equations of the version do not use is kept in the file and named by
:attr:`PropertyFile.foreign` or :attr:`PropertyFile.notes`; :func:`tyre.from_file` refuses what would change a force.

Source: the keys of public files and readers; ``magic_formula`` names the equations that they enter.
"""

import os
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

_UNITS: dict[str, dict[str, float]] = {
    "LENGTH": {"meter": 1.0, "metre": 1.0, "m": 1.0, "km": 1e3, "mile": 1609.344}
    | dict.fromkeys(("mm", "millimeter", "millimetre"), 1e-3)
    | dict.fromkeys(("cm", "centimeter", "centimetre"), 1e-2)
    | {"inch": 0.0254, "in": 0.0254, "foot": 0.3048, "ft": 0.3048},
    "FORCE": {"newton": 1.0, "n": 1.0, "kilonewton": 1e3, "knewton": 1e3, "kn": 1e3}
    | dict.fromkeys(("kgf", "kilogram_force"), 9.80665)
    | dict.fromkeys(("lbf", "pound_force"), 4.4482216152605)
    | {"kpound_force": 4448.2216152605},
    "ANGLE": {"radian": 1.0, "rad": 1.0} | dict.fromkeys(("degree", "deg"), 0.017453292519943295),
    "TIME": {"second": 1.0, "sec": 1.0, "s": 1.0, "millisecond": 1e-3, "ms": 1e-3, "minute": 60.0, "hour": 3600.0},
    "PRESSURE": {
        "pascal": 1.0,
        "pa": 1.0,
        "kpa": 1e3,
        "kilopascal": 1e3,
        "mpa": 1e6,
        "bar": 1e5,
        "psi": 6894.757293168,
    },
}

# Exponents of the units of the numbers that a tyre takes from a file; every other number is kept unchanged.
_DIMENSIONS: dict[str, dict[str, int]] = {
    **{key: {"LENGTH": 1} for key in ("UNLOADED_RADIUS", "WIDTH")},
    "LONGVL": {"LENGTH": 1, "TIME": -1},
    **{key: {"FORCE": 1} for key in ("FNOMIN", "FZMIN", "FZMAX")},
    **{f"{way}_STIFFNESS": {"FORCE": 1, "LENGTH": -1} for way in ("VERTICAL", "LONGITUDINAL", "LATERAL")},
    **{key: {"PRESSURE": 1} for key in ("INFLPRES", "NOMPRES", "IP", "IP_NOM", "PRESMIN", "PRESMAX")},
    **{key: {"ANGLE": 1} for key in ("ALPMIN", "ALPMAX", "CAMMIN", "CAMMAX")},
}
_NUMBERS = {*_DIMENSIONS, "PFZ1", "QPFZ1", "PCFX3", "PCFY3", "KPUMIN", "KPUMAX"}  # of sections without coefficients


def _keys(text: str) -> tuple[str, ...]:
    """Names from ``PDX1-3 RCX1``, where ``1-3`` stands for each number."""
    names: list[str] = []
    for word in text.split():
        stem, first, last = re.fullmatch(r"(.*?)(?:(\d+)-(\d+))?", word).groups()  # type: ignore[union-attr]
        names += [f"{stem}{i}" for i in range(int(first), int(last) + 1)] if first else [word]
    return tuple(names)


# Coefficients by section and version: keys of all, of 5.2, of 60, 61 and 62, of 61 and 62.
_SETS: dict[str, tuple[str, str, str, str]] = {
    "SCALING_COEFFICIENTS": (
        "LFZO LCZ LCX LMUX LEX LKX LHX LVX LCY LMUY LEY LKY LHY LVY LTR LRES LXAL LYKA LVYKA LS LSGKP LSGAL LMX LVMX"
        " LMY",
        "LGAX LGAY LGAZ LGYR",
        "LKYC LKZC LMP",
        "",
    ),
    "LONGITUDINAL_COEFFICIENTS": (
        "PCX1 PDX1-3 PEX1-4 PKX1-3 PHX1-2 PVX1-2 RBX1-2 RCX1 REX1-2 RHX1",
        "PTX1-3",
        "RBX3 PPX1-4",
        "",
    ),
    "OVERTURNING_COEFFICIENTS": ("QSX1-3", "", "", "QSX4-14 PPMX1"),
    "LATERAL_COEFFICIENTS": (
        "PCY1 PDY1-3 PEY1-4 PKY1-3 PHY1-2 PVY1-4 RBY1-3 RCY1 REY1-2 RHY1-2 RVY1-6",
        "PHY3 PTY1-2",
        "PEY5 PKY4-7 RBY4 PPY1-5",
        "",
    ),
    "ROLLING_COEFFICIENTS": ("QSY1-4", "", "", "QSY5-8"),
    "ALIGNING_COEFFICIENTS": (
        "QBZ1-3 QBZ5 QBZ9-10 QCZ1 QDZ1-4 QDZ6-9 QEZ1-5 QHZ1-4 SSZ1-4",
        "QBZ4 QTZ1 MBELT",
        "QDZ10-11 PPZ1-2",
        "QBZ4",
    ),
    "TURNSLIP_COEFFICIENTS": (
        "",
        "",
        "PDXP1-3 PKYP1 PDYP1-4 PHYP1-4 PECP1-2 QDTP1 QCRP1-2 QBRP1 QDRP1-2",
        "",
    ),
}
# The one coefficient that only the 2006 book has, and those that PAC2002 adds to the equations of 5.2.
_MORE = {"ALIGNING_COEFFICIENTS": {60: ("QBZ6",)}}
_OF_PAC2002 = {
    "LONGITUDINAL_COEFFICIENTS": "PPX1-4",
    "OVERTURNING_COEFFICIENTS": "QSX4-11 QPX1",
    "LATERAL_COEFFICIENTS": "PPY1-4",
    "ROLLING_COEFFICIENTS": "QSY5-8",
    "ALIGNING_COEFFICIENTS": "QPZ1-2",
}
# Keys of effects that no version here evaluates: friction that decreases with the sliding speed, scales of the pressure
# and of the camber stiffness of PAC2002, and the damping of ADAMS at low speed.
_UNUSED = {
    "SCALING_COEFFICIENTS": ("LMUV", "LIP", "LKG", "LKYG"),
    "LONGITUDINAL_COEFFICIENTS": ("PTX4",),
    "LATERAL_COEFFICIENTS": ("PTY3",),
}
# Values that change nothing, of the keys that are no factor (1) and no coefficient (0).
_NEUTRAL = {"LMUV": (0.0,), "PKY4": (2.0,), "QSY7": (0.0, 1.0)}

SCALING = "SCALING_COEFFICIENTS"
COEFFICIENTS = tuple(name for name in _SETS if name != SCALING)
VERSIONS = (52, 60, 61, 62)
_FITTYP = {5: 52, 6: 52, 21: 52, 51: 52, 52: 52, 60: 60, 61: 61, 62: 62}
_FORMATS = {"PAC2002": 52, "MF_05": 52, "MF-TYRE": 52}
_REQUIRED: dict[str, tuple[str, ...]] = {
    "UNITS": (),  # those of the numbers that the file has
    "MODEL": ("LONGVL",),
    "DIMENSION": ("UNLOADED_RADIUS",),
    "VERTICAL": ("FNOMIN",),
    "SCALING_COEFFICIENTS": (),
    "LONGITUDINAL_COEFFICIENTS": ("PCX1", "PDX1", "PKX1"),
    "LATERAL_COEFFICIENTS": ("PCY1", "PDY1", "PKY1", "PKY2"),
    "ALIGNING_COEFFICIENTS": ("QBZ1", "QCZ1", "QDZ1"),
}
_RANGES = {
    "INFLATION_PRESSURE_RANGE": ("PRESMIN", "PRESMAX"),
    "VERTICAL_FORCE_RANGE": ("FZMIN", "FZMAX"),
    "LONG_SLIP_RANGE": ("KPUMIN", "KPUMAX"),
    "SLIP_ANGLE_RANGE": ("ALPMIN", "ALPMAX"),
    "INCLINATION_ANGLE_RANGE": ("CAMMIN", "CAMMAX"),
}
# Sections of keys and values; any other section is an extension and is kept line by line.
_KEYED = (
    *("MDI_HEADER", "UNITS", "MODEL", "DIMENSION", "OPERATING_CONDITIONS", "TIRE_CONDITIONS", "INERTIA", "VERTICAL"),
    *("STRUCTURAL", "CONTACT_PATCH", *_RANGES, *_SETS),
)


def coefficients(section: str, version: int, pac2002: bool = False) -> tuple[str, ...]:
    """Keys of a coefficient section that the equations of ``version`` (52, 60, 61 or 62) use.

    ``pac2002`` asks for those of PAC2002, which are the equations of 52 with further terms of M_x, M_y and pressure.
    """
    common, old, new, newest = (_keys(text) for text in _SETS[section])
    keys = common + (old if version == 52 else new) + (newest if version >= 61 else ())
    keys += _MORE.get(section, {}).get(version, ())
    return keys + (_keys(_OF_PAC2002.get(section, "")) if pac2002 and version == 52 else ())


# Section of each coefficient of any version and of each range; readers that ignore sections take them from anywhere.
_HOME = {key: section for section, keys in _RANGES.items() for key in keys} | {
    key: section
    for section in _SETS
    for version in VERSIONS
    for key in (*coefficients(section, version, pac2002=True), *_UNUSED.get(section, ()))
}


def home(key: str) -> str:
    """The section of a coefficient or of a range."""
    return _HOME[key]


class Foreign(NamedTuple):
    """A key that the equations of a file do not use, with a value that is not the neutral one."""

    section: str
    key: str
    value: float  # as in the file, a factor or coefficient
    neutral: float  # value that changes nothing


@dataclass(frozen=True)
class PropertyFile:
    """Contents of a file, in its own units. Equal files have equal versions, sections and extensions."""

    version: int
    sections: Mapping[str, Mapping[str, float | str]]  # by section and key, in the order of the file
    extensions: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # other sections, line by line
    notes: tuple[str, ...] = field(default=(), compare=False)  # what was taken though nothing uses it
    places: Mapping[tuple[str, str], str] = field(default_factory=dict, compare=False)  # ``file:line: `` of keys

    def has(self, section: str, key: str) -> bool:
        """Whether the file gives a value, which an empty one is not."""
        return self.sections.get(section, {}).get(key, "") != ""

    def get(self, section: str, key: str, default: float = 0.0) -> float:
        """A number in SI units and radians, or ``default`` where the file has none."""
        if not self.has(section, key):
            return default
        value = float(self.sections[section][key])
        for unit, exponent in _DIMENSIONS.get(key, {}).items():
            value *= self._unit(unit) ** exponent
        return value

    def _unit(self, unit: str) -> float:
        units = self.sections["UNITS"]
        if unit == "PRESSURE" and not self.has("UNITS", unit):
            return self._unit("FORCE") / self._unit("LENGTH") ** 2
        return _UNITS[unit][_unit_name(unit, units[unit])]

    @property
    def pac2002(self) -> bool:
        """Whether the file asks for PAC2002 of ADAMS."""
        given = self.sections.get("MODEL", {}).get("PROPERTY_FILE_FORMAT", "")
        return self.version == 52 and str(given).upper() == "PAC2002"

    def keys(self, section: str) -> tuple[str, ...]:
        """Keys of a coefficient section that the equations of the file use."""
        return coefficients(section, self.version, self.pac2002)

    @property
    def foreign(self) -> list[Foreign]:
        """Keys of coefficient sections that the version does not use, where they are not neutral."""
        return [
            Foreign(section, key, float(value), neutral(key)[0])
            for section in _SETS
            for key, value in self.sections.get(section, {}).items()
            if _HOME.get(key) == section and key not in self.keys(section)
            if isinstance(value, float) and value not in neutral(key)
        ]


def neutral(key: str) -> tuple[float, ...]:
    """Values of a coefficient that change nothing where its equations do not use it."""
    return _NEUTRAL.get(key, (1.0,) if _HOME.get(key) == SCALING else (0.0,))


def _unit_name(unit: str, given: float | str) -> str:
    """The name of a unit as ``_UNITS`` has it: in lower case and in the singular."""
    name = str(given).strip().lower()
    return name if name in _UNITS[unit] else {"feet": "foot", "inches": "inch"}.get(name, name.removesuffix("s"))


# Python's float also takes underscores, digits of other scripts and words.
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eEdD][-+]?[0-9]+)?")  # d: of Fortran


def _value(text: str) -> float | str:
    """A number, or the text within quotes or up to a comment."""
    quoted = re.match(r"'([^']*)'|\"([^\"]*)\"", text)
    if quoted:
        return quoted[1] if quoted[1] is not None else quoted[2]
    text = re.split(r"[$!]", text, maxsplit=1)[0].strip()
    return float(text.lower().replace("d", "e")) if _NUMBER.fullmatch(text) else text


class _Reader:
    """What has been read of a file, and where."""

    def __init__(self, path: str | os.PathLike) -> None:
        self.path = path
        self.sections: dict[str, dict[str, float | str]] = {}
        self.extensions: dict[str, list[str]] = {}
        self.lines: dict[tuple[str, str], int] = {}  # of headings (key '') and keys
        self.notes: list[str] = []
        self.number = 0

    def error(self, line: int, key: str, message: str) -> ValueError:
        return ValueError(f"{self.path}:{line}: {key}: {message}")

    def read(self, text: str) -> None:
        """Sections, keys and values, and the lines of other sections."""
        section = ""
        for self.number, whole in enumerate(text.splitlines(), 1):
            line = whole.strip()
            heading = re.match(r"\[\s*([^\]]*?)\s*\]", line)
            if heading or line[:1] == "(":  # (COMMENTS) and other blocks within a section hold lines without keys
                section = heading[1].upper() if heading else f"{section} {line.upper()}"
                self._begin(section)
            elif section in self.extensions:
                self.extensions[section].append(whole.rstrip())
                key, equals, rest = (part.strip() for part in line.partition("="))
                if equals:
                    self._require_home(section, key.upper(), _value(rest))
            elif line and line[0] not in "$!#{":
                key, equals, rest = (part.strip() for part in line.partition("="))
                if not equals or not key or not section:
                    expected = "expected [SECTION], KEY = value, or a comment after $ or !"
                    raise self.error(self.number, key.upper() or line, expected)
                self._enter(section, key.upper(), _value(rest))

    def _begin(self, section: str) -> None:
        if (section, "") in self.lines:
            self.notes.append(f"[{section}] a second time")
        self.lines.setdefault((section, ""), self.number)
        if section in _KEYED:
            self.sections.setdefault(section, {})
        else:
            self.extensions.setdefault(section, [])

    def _enter(self, section: str, key: str, value: float | str) -> None:
        self._require_home(section, key, value)
        before = self.sections[section].get(key, "")
        if (section, key) in self.lines:
            if before not in ("", value) and value != "":
                first = self.lines[section, key]
                message = f"expected once, is in line {first} already, there {before!r} and here {value!r}"
                raise self.error(self.number, key, message)
            self.notes.append(f"{key} a second time")
        if before == "":
            self.sections[section][key] = value
            self.lines[section, key] = self.number

    def _require_home(self, section: str, key: str, value: float | str) -> None:
        """Refuse a coefficient or a range in the section of another one, where it would be lost."""
        home = _HOME.get(key, section)
        if home != section and value != "" and value not in neutral(key):
            message = f"expected in [{home}], is in [{section}], where it is not read; got {value!r}"
            raise self.error(self.number, key, message)


def read(path: str | os.PathLike) -> PropertyFile:
    """A property file, checked as a whole.

    Taken, and told in the notes: a section or key twice with the same values, an empty value, and in a coefficient
    section text, or an unknown key with a neutral value. The key of another version is in
    :attr:`PropertyFile.foreign` unless its value is neutral, which the notes tell.

    Raises
    ------
    ValueError
        ``file:line: KEY: what was expected``, at the first of: a line that is no heading, key or comment; a key with
        two values; a coefficient or range in the section of others; a missing section or key; an unknown unit or
        version; a value that is no finite number; a key in a coefficient section that no version knows.
    OSError
        No such file.
    """
    raw = Path(path).read_bytes()
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    found = _Reader(path)
    found.read(text)
    sections, lines, error = found.sections, found.lines, found.error
    for name, keys in _REQUIRED.items():
        if name not in sections:
            raise error(found.number, f"[{name}]", "expected this section, the file ends without it")
        for key in keys:
            if key not in sections[name]:
                raise error(lines[name, ""], key, f"expected in [{name}]")
    version = _version(sections["MODEL"], lines, error, found.notes)
    for (name, key), line in lines.items():
        if key and name in sections:
            value = sections[name][key]
            _check_number(name, key, value, partial(error, line, key))
            _check_units(key, value, sections["UNITS"], lines, error)
    file = PropertyFile(
        version,
        sections,
        {name: _trim(body) for name, body in found.extensions.items()},
        places={place: f"{path}:{line}: " for place, line in lines.items()},
    )
    return replace(file, notes=(*found.notes, *_notes(file)))


def _trim(body: list[str]) -> tuple[str, ...]:
    """Lines without the comment and blank lines at the end, which belong to the next heading."""
    last = len(body)
    while last and (not body[last - 1].strip() or body[last - 1].lstrip()[0] in "$!"):
        last -= 1
    return tuple(body[:last])


def _version(
    model: dict[str, Any], lines: dict[tuple[str, str], Any], error: Callable[..., Exception], notes: list[str]
) -> int:
    found, given = {}, {key: value for key, value in model.items() if value != ""}
    for key, known in (("FITTYP", _FITTYP), ("PROPERTY_FILE_FORMAT", _FORMATS)):
        if key not in given:
            continue
        value: Any = (
            _value(given[key].upper()) if isinstance(given[key], str) else given[key]
        )  # a number may be in quotes
        if value in known:
            found[key] = known[value]
        elif key == "FITTYP" or "FITTYP" not in found:
            raise error(lines["MODEL", key], key, f"expected one of {', '.join(map(str, known))}, got {given[key]!r}")
    if not found:
        raise error(lines["MODEL", ""], "FITTYP", "expected in [MODEL], or PROPERTY_FILE_FORMAT")
    if len(set(found.values())) > 1:
        notes.append(f"PROPERTY_FILE_FORMAT {given['PROPERTY_FILE_FORMAT']!r}, as FITTYP {found['FITTYP']} decides")
    return next(iter(found.values()))


def _check_number(section: str, key: str, value: Any, error: Callable[[str], Exception]) -> None:
    """Raise for text where a number is needed, and for a key of a coefficient section that no version knows."""
    of_coefficients = section in _SETS
    needed = any(key in keys for keys in _REQUIRED.values())
    if not (_HOME.get(key) == section or key in _NUMBERS):
        if of_coefficients and isinstance(value, float) and value != (1.0 if section == SCALING else 0.0):
            raise error(f"expected a key of [{section}], or 0; no version knows it, so what it changes is unknown")
    elif not (isinstance(value, float) and abs(value) < float("inf")) and (value != "" or needed):
        comma = " with a decimal point" if "," in str(value) else ""
        raise error(f"expected a number{comma}, got {value!r}")


def _notes(file: PropertyFile) -> Iterator[str]:
    """Keys whose values change nothing, with the values; those of another version that are not neutral are foreign."""
    for section, entries in file.sections.items():
        of_coefficients = section in _SETS
        for key, value in entries.items():
            if value == "":
                if of_coefficients or key in _NUMBERS:
                    yield f"{key} (empty)"
            elif of_coefficients and key not in file.keys(section) and (key not in _HOME or value in neutral(key)):
                yield f"{key} = {value:g}" if isinstance(value, float) else f"{key} = {value!r}"


def _check_units(
    key: str, value: Any, units: Mapping[str, Any], lines: dict[tuple[str, str], Any], error: Callable[..., Exception]
) -> None:
    """Raise for a number whose unit is missing or unknown."""
    for unit in _DIMENSIONS.get(key, {}) if value != "" else ():
        given = units.get(unit, "")
        if given == "" and unit != "PRESSURE":
            raise error(lines["UNITS", ""], unit, f"expected in [UNITS], because {key} has this unit")
        if given != "" and _unit_name(unit, given) not in _UNITS[unit]:
            raise error(lines["UNITS", unit], unit, f"expected one of {', '.join(_UNITS[unit])}, got {given!r}")


def write(path: str | os.PathLike, file: PropertyFile) -> None:
    """Write a property file that :func:`read` returns equal; the path always holds the complete old or new file.

    Raises
    ------
    ValueError
        The file is one that :func:`read` refuses, with the same message; nothing is written.
    """
    target = Path(path)
    body: list[str] = []
    for name, entries in file.sections.items():
        label = name.lower().removesuffix("_coefficients")
        body += [f"${label:->70}", f"[{name}]"]
        for key, value in entries.items():
            body.append(
                f"{key:<25}= " + (f"'{value}'" if isinstance(value, str) else repr(float(value)).removesuffix(".0"))
            )
    for name, kept in file.extensions.items():
        body += [f"${name.lower():->70}", f"[{name}]", *kept]
    handle, temporary = tempfile.mkstemp(suffix=".tir", dir=target.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as stream:
            stream.write("\n".join(body) + "\n")
        if read(temporary) != file:
            raise ValueError(f"{path}: a version, key or text that the format cannot hold")
        os.replace(temporary, target)
    except BaseException as problem:
        os.unlink(temporary)
        if isinstance(problem, ValueError):
            raise ValueError(str(problem).replace(temporary, str(path))) from None
        raise
