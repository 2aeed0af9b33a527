"""Tyre property files (.tir) of the Magic Formula: read, check, write. :func:`tyre.from_file` interprets them.

A file has lines ``KEY = value`` under headings ``[SECTION]``; text is quoted, and ``$`` and ``!`` start a comment.
FITTYP in [MODEL], or PROPERTY_FILE_FORMAT of ADAMS, selects the equations: 5.2 (FITTYP 5, 6, 21, 51, 52; 'PAC2002',
'MF_05'), those of the 2006 book (60), 6.1 (61) and 6.2 (62).

[UNITS] hold for dimensions, loads, speeds, pressures, stiffnesses and ranges. The coefficients of the formula are in
radians and ratios whatever [UNITS] states, as in MF-Tyre and ADAMS.

Source: the keys of public files and readers; ``magic_formula`` names the equations that they enter.
"""

import os
import re
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

_UNITS: dict[str, dict[str, float]] = {
    "LENGTH": {"meter": 1.0, "m": 1.0, "mm": 1e-3, "millimeter": 1e-3, "cm": 1e-2, "centimeter": 1e-2, "km": 1e3}
    | {"inch": 0.0254, "foot": 0.3048},
    "FORCE": {"newton": 1.0, "n": 1.0, "kilonewton": 1e3, "kn": 1e3, "kgf": 9.80665, "kilogram_force": 9.80665}
    | {"lbf": 4.4482216152605, "pound_force": 4.4482216152605},
    "ANGLE": {"radians": 1.0, "radian": 1.0, "rad": 1.0}
    | dict.fromkeys(("degrees", "degree", "deg"), 0.017453292519943295),
    "MASS": {
        "kg": 1.0,
        "kilogram": 1.0,
        "gram": 1e-3,
        "g": 1e-3,
        "tonne": 1e3,
        "pound_mass": 0.45359237,
        "slug": 14.593903,
    },
    "TIME": {"second": 1.0, "sec": 1.0, "s": 1.0, "millisecond": 1e-3, "ms": 1e-3, "minute": 60.0, "hour": 3600.0},
    "PRESSURE": {"pascal": 1.0, "pa": 1.0, "kpa": 1e3, "kilopascal": 1e3, "bar": 1e5, "psi": 6894.757293168},
}

# Exponents of the units of the numbers that a tyre takes from a file; every other number is kept unchanged.
_DIMENSIONS: dict[str, dict[str, int]] = {
    **{key: {"LENGTH": 1} for key in ("UNLOADED_RADIUS", "WIDTH")},
    "LONGVL": {"LENGTH": 1, "TIME": -1},
    **{key: {"FORCE": 1} for key in ("FNOMIN", "FZMIN", "FZMAX")},
    **{f"{way}_STIFFNESS": {"FORCE": 1, "LENGTH": -1} for way in ("VERTICAL", "LONGITUDINAL", "LATERAL")},
    **{key: {"PRESSURE": 1} for key in ("INFLPRES", "NOMPRES")},
    **{key: {"ANGLE": 1} for key in ("ALPMIN", "ALPMAX", "CAMMIN", "CAMMAX")},
}
_NUMBERS = {*_DIMENSIONS, "PFZ1", "PCFX3", "PCFY3", "KPUMIN", "KPUMAX"}  # of sections without coefficients


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
        "LGAX LGAY LGAZ",
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
# The one coefficient that only the 2006 book has, and factors of effects that this model lacks: friction that decreases
# with the sliding speed, the gyroscopic couple, a scale of the pressure.
_MORE = {"ALIGNING_COEFFICIENTS": {60: ("QBZ6",)}}
_UNUSED = {"SCALING_COEFFICIENTS": ("LMUV", "LGYR", "LIP", "LKYG"), "LONGITUDINAL_COEFFICIENTS": ("PTX4",)}
_NEUTRAL = {"LMUV": (0.0,), "PKY4": (2.0,), "QSY7": (0.0, 1.0), "PTX4": None}  # others: factors 1, coefficients 0

SCALING = "SCALING_COEFFICIENTS"
COEFFICIENTS = tuple(name for name in _SETS if name != SCALING)
VERSIONS = (52, 60, 61, 62)
_FITTYP = {5: 52, 6: 52, 21: 52, 51: 52, 52: 52, 60: 60, 61: 61, 62: 62}
_FORMATS = {"PAC2002": 52, "MF_05": 52, "MF-TYRE": 52}
_REQUIRED: dict[str, tuple[str, ...]] = {
    "UNITS": ("LENGTH", "FORCE", "ANGLE", "MASS", "TIME"),
    "MODEL": ("LONGVL",),
    "DIMENSION": ("UNLOADED_RADIUS",),
    "VERTICAL": ("FNOMIN",),
    "SCALING_COEFFICIENTS": (),
    "LONGITUDINAL_COEFFICIENTS": ("PCX1", "PDX1", "PKX1"),
    "LATERAL_COEFFICIENTS": ("PCY1", "PDY1", "PKY1", "PKY2"),
    "ALIGNING_COEFFICIENTS": ("QBZ1", "QCZ1", "QDZ1"),
}
# Sections of keys and values; any other section is an extension and is kept line by line.
_KEYED = (
    *("MDI_HEADER", "UNITS", "MODEL", "DIMENSION", "OPERATING_CONDITIONS", "INERTIA", "VERTICAL", "STRUCTURAL"),
    *("CONTACT_PATCH", "INFLATION_PRESSURE_RANGE", "VERTICAL_FORCE_RANGE", "LONG_SLIP_RANGE", "SLIP_ANGLE_RANGE"),
    *("INCLINATION_ANGLE_RANGE", *_SETS),
)


def coefficients(section: str, version: int) -> tuple[str, ...]:
    """Keys of a coefficient section that the equations of ``version`` (52, 60, 61 or 62) use."""
    common, old, new, newest = (_keys(text) for text in _SETS[section])
    keys = common + (old if version == 52 else new) + (newest if version >= 61 else ())
    return keys + _MORE.get(section, {}).get(version, ())


@dataclass(frozen=True)
class PropertyFile:
    """Contents of a file, in its own units. Equal files have equal versions, sections and extensions."""

    version: int
    sections: Mapping[str, Mapping[str, float | str]]  # by section and key, in the order of the file
    extensions: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # other sections, line by line

    def get(self, section: str, key: str, default: float = 0.0) -> float:
        """A number in SI units and radians, or ``default`` where the file has none."""
        if key not in self.sections.get(section, {}):
            return default
        value = float(self.sections[section][key])
        for unit, exponent in _DIMENSIONS.get(key, {}).items():
            value *= self._unit(unit) ** exponent
        return value

    def _unit(self, unit: str) -> float:
        units = self.sections["UNITS"]
        if unit == "PRESSURE" and unit not in units:
            return self._unit("FORCE") / self._unit("LENGTH") ** 2
        return _UNITS[unit][str(units[unit]).lower()]


def _value(text: str) -> float | str:
    """A number, or the text within quotes or up to a comment."""
    quoted = re.match(r"'([^']*)'|\"([^\"]*)\"", text)
    if quoted:
        return quoted[1] if quoted[1] is not None else quoted[2]
    text = re.split(r"[$!]", text, maxsplit=1)[0].strip()
    try:
        return float(re.sub(r"(?<=[\d.])[dD](?=[-+]?\d)", "e", text))  # Fortran's exponents
    except ValueError:
        return text


def read(path: str | os.PathLike) -> PropertyFile:
    """A property file, checked as a whole.

    Raises
    ------
    ValueError
        ``file:line: KEY: what was expected``, at the first of: a line that is no heading, key or comment; a section or
        key twice; a missing section or key; an unknown unit or version; a value that is no finite number; a key in a
        coefficient section that its version does not know; a coefficient of another version, or a scaling factor, that
        would have to be ignored.
    OSError
        No such file.
    """
    raw = Path(path).read_bytes()
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")

    def error(line: int, key: str, message: str) -> ValueError:
        return ValueError(f"{path}:{line}: {key}: {message}")

    sections: dict[str, dict[str, float | str]] = {}
    extensions: dict[str, list[str]] = {}
    lines: dict[tuple[str, str], int] = {}  # of headings (key '') and keys
    section = ""
    number = 0
    for number, whole in enumerate(text.splitlines(), 1):
        line = whole.strip()
        heading = re.match(r"\[\s*([^\]]*?)\s*\]", line)
        if heading:
            section = heading[1].upper()
            if (section, "") in lines:
                raise error(number, f"[{section}]", f"expected once, is in line {lines[section, '']} already")
            lines[section, ""] = number
            if section in _KEYED:
                sections[section] = {}
            else:
                extensions[section] = []
        elif section in extensions:
            extensions[section].append(whole.rstrip())
        elif line and line[0] not in "$!#{":
            key, equals, rest = line.partition("=")
            key = key.strip().upper()
            if not equals or not key or not section:
                raise error(number, key or line, "expected [SECTION], KEY = value, or a comment after $ or !")
            if (section, key) in lines:
                raise error(number, key, f"expected once, is in line {lines[section, key]} already")
            lines[section, key] = number
            sections[section][key] = _value(rest.strip())

    for name, keys in _REQUIRED.items():
        if name not in sections:
            raise error(number, f"[{name}]", "expected this section, the file ends without it")
        for key in keys:
            if key not in sections[name]:
                raise error(lines[name, ""], key, f"expected in [{name}]")
    for unit, known in _UNITS.items():
        given = sections["UNITS"].get(unit)
        if given is not None and str(given).lower() not in known:
            raise error(lines["UNITS", unit], unit, f"expected one of {', '.join(known)}, got {given!r}")
    version = _version(sections["MODEL"], lines, error)
    for (name, key), line_number in lines.items():
        if key and name in sections:
            _check(name, key, sections[name][key], version, partial(error, line_number, key))
    return PropertyFile(version, sections, {name: _trimmed(body) for name, body in extensions.items()})


def _trimmed(body: list[str]) -> tuple[str, ...]:
    """Lines without the comment and blank lines at the end, which belong to the next heading."""
    last = len(body)
    while last and (not body[last - 1].strip() or body[last - 1].lstrip()[0] in "$!"):
        last -= 1
    return tuple(body[:last])


def _version(model: dict[str, Any], lines: dict[tuple[str, str], Any], error: Callable[..., Exception]) -> int:
    for key, known in (("FITTYP", _FITTYP), ("PROPERTY_FILE_FORMAT", _FORMATS)):
        if key in model:
            value = model[key].upper() if isinstance(model[key], str) else model[key]
            if value in known:
                return known[value]
            if key == "FITTYP" or "FITTYP" not in model:
                raise error(
                    lines["MODEL", key], key, f"expected one of {', '.join(map(str, known))}, got {model[key]!r}"
                )
    raise error(lines["MODEL", ""], "FITTYP", "expected in [MODEL], or PROPERTY_FILE_FORMAT")


def _check(section: str, key: str, value: Any, version: int, error: Callable[[str], Exception]) -> None:
    """Raise for a key that the model would have to ignore, and for a value that is no finite number."""
    if key == "FE_METHOD" and str(value).upper() == "YES":
        raise error("expected 'NO', because the weights G combine the slips, not a friction ellipse; got 'YES'")
    if section not in _SETS:
        if key in _NUMBERS and not (isinstance(value, float) and abs(value) < float("inf")):
            raise error(f"expected a number, got {value!r}")
        return
    known = coefficients(section, version)
    everywhere = {each for other in VERSIONS for each in coefficients(section, other)} | {*_UNUSED.get(section, ())}
    if key not in everywhere:
        raise error(f"expected a key of [{section}]")
    if not (isinstance(value, float) and abs(value) < float("inf")):
        raise error(f"expected a number, got {value!r}")
    neutral = _NEUTRAL.get(key, (1.0,) if section == "SCALING_COEFFICIENTS" else (0.0,))
    if key not in known and neutral is not None and value not in neutral:
        raise error(f"expected {neutral[0]:g}, because the equations of version {version} do not use it; got {value:g}")


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
