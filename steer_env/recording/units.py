"""Units of recordings in memory and in files, and the spellings that files from other programs use.

In memory all quantities are in SI units with angles in radians. A file contains angles in degrees and all other
quantities in SI units. The reading of an uncalibrated sensor stays in counts.
"""

import re

from steer_env.vehicle.constants import GRAVITY

DEGREE = 0.017453292519943295  # [rad]

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
    "counts": ("counts", 1.0),
}
COUNTS = "counts"  # readings of a sensor that nobody has calibrated; any channel may be in it

# Further spellings, in the form that `_normalised` returns -> (unit in memory, value in memory of one).
_OTHERS = {
    "°": ("rad", DEGREE),
    "°/s": ("rad/s", DEGREE),
    "°/s2": ("rad/s2", DEGREE),
    "degree": ("rad", DEGREE),
    "degrees": ("rad", DEGREE),
    "mrad": ("rad", 1e-3),
    "mm": ("m", 1e-3),
    "cm": ("m", 1e-2),
    "um": ("m", 1e-6),
    "km": ("m", 1e3),
    "mm/s": ("m/s", 1e-3),
    "um/s": ("m/s", 1e-6),
    "km/h": ("m/s", 1 / 3.6),
    "kmh": ("m/s", 1 / 3.6),
    "kph": ("m/s", 1 / 3.6),
    "mph": ("m/s", 0.44704),
    "g": ("m/s2", GRAVITY),
    "ms": ("s", 1e-3),
    "us": ("s", 1e-6),
    "sec": ("s", 1.0),
    "kN": ("N", 1e3),
    "mN": ("N", 1e-3),
    "Ncm": ("N m", 1e-2),
    "Nmm": ("N m", 1e-3),
    "mNm": ("N m", 1e-3),
    "kNm": ("N m", 1e3),
    "kW": ("W", 1e3),
    "mA": ("A", 1e-3),
    "mV": ("V", 1e-3),
    "%": ("1", 1e-2),
    "-": ("1", 1.0),
}
# Names in databases of Volkswagen's CAN, in the same form.
_DATABASE_NAMES = {
    "Unit/DegreOfArc": ("rad", DEGREE),
    "Unit/DegreOfArcPerSecon": ("rad/s", DEGREE),
    "Unit/NewtoMeter": ("N m", 1.0),
    "Unit/centiNewtoMeter": ("N m", 1e-2),
    "Unit/KiloMeterPerHour": ("m/s", 1 / 3.6),
    "Unit/MeterPerSeconSquar": ("m/s2", 1.0),
}
_SPELLINGS = {suffix.replace("_", "/"): (unit, size) for unit, (suffix, size) in FILE_UNITS.items()}
_SPELLINGS |= {unit.replace(" ", ""): (unit, 1.0) for unit in FILE_UNITS}
_SPELLINGS |= _OTHERS
# In any case; but short ones such as "MS" and "NM" may have another meaning.
_ANY_CASE = {text.lower(): text for text in _SPELLINGS if len(text) > 2}
_SUFFIXES = sorted((text.replace("/", "_") for text in _SPELLINGS if text != "-"), key=lambda text: -len(text))
_BRACKETED = re.compile(r"(.*\S)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))")

SPELLINGS = ", ".join(_SPELLINGS)  # for messages


def parse_unit(text: str) -> tuple[str, float] | None:
    """Unit in memory of a spelling such as "deg/s", "°/s", "deg_s" or "N*m", and the value of one; None if unknown."""
    plain = _normalise(text)
    return _SPELLINGS.get(plain) or _DATABASE_NAMES.get(plain) or _SPELLINGS.get(_ANY_CASE.get(plain.lower(), ""))


def spellings(unit: str | None) -> str:
    """The spellings of a unit in memory and of a reading in counts, with commas; of every unit for None."""
    return ", ".join(text for text, (found, _) in _SPELLINGS.items() if unit is None or found in (unit, COUNTS))


def file_unit(unit: str) -> str:
    """Spelling of the file unit for a unit in memory, in files that keep units apart from names."""
    return unit.replace("rad", "deg")


def split_unit(column: str) -> tuple[str, str | None]:
    """Name and unit of a column such as "SWA [deg]", "SWA (deg)" or "SWA_deg"; the unit is None if there is none.

    Text in brackets is the unit whether it is known or not; a suffix is a unit only if it is known.
    """
    bracketed = _BRACKETED.fullmatch(column)
    if bracketed:
        return bracketed[1], bracketed[2] if bracketed[2] is not None else bracketed[3]
    for suffix in _SUFFIXES:
        name = column.removesuffix(f"_{suffix}")
        if name and name != column:
            return name, suffix
    return column, None


def _normalise(text: str) -> str:
    """The spelling without spaces, and with one way to write products, powers and degrees."""
    for old, new in (("²", "2"), ("º", "°"), ("µ", "u"), ("μ", "u"), ("_", "/")):
        text = text.replace(old, new)
    return re.sub(r"[\s^*·.]", "", text).replace("/s/s", "/s2")
