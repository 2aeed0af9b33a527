"""Numbers and names as a reader sees them, in reports and tables."""

import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# Ends of names that are units, as a reader sees them.
_UNITS = {"m_s2": "m/s²", "deg_s": "deg/s", "nm": "N m", "hz": "Hz", "g": "g", "s": "s"}
_QUANTITY = re.compile(rf"_(\d+)(?:p(\d+))?_?({'|'.join(_UNITS)})(?=_|$)")
_METRIC_WORDS = {
    **{"deadband": "dead band", "tb": "TB", "rms": "RMS", "time to 90": "time to 90\u00a0%"},
    **{"quasi static": "quasi-static", "steady state": "steady-state"},
}


def number(x: float | None, digits: int = 3, pad: bool = False) -> str:
    """A number, ``pad`` with trailing zeros; a dash for None and NaN."""
    if x is None or math.isnan(x):
        return "–"
    if math.isinf(x):
        return "∞" if x > 0 else "−∞"
    text = f"{x:{'#' if pad else ''}.{digits}g}"
    if "e+" in text:
        text = f"{x:.0f}"
    mantissa, _, exponent = text.partition("e")
    power = f"·10{str(int(exponent)).translate(_SUPERSCRIPT)}" if exponent else ""
    return mantissa.rstrip(".").replace("-", "−") + power


def percent(x: float | None, digits: int = 2) -> str:
    """A share of 1 in per cent."""
    return number(None if x is None else 100.0 * x, digits) + "\u00a0%"


def change(x: float) -> str:
    """A signed share of 1 in per cent, with three digits, but not beyond a hundredth."""
    if not math.isfinite(x):
        return number(x)
    places = next((n for n in (2, 1) if abs(round(100.0 * x, n)) < 10.0 ** (3 - n)), 0)
    return f"{100.0 * x:+.{places}f}\u00a0%".replace("-", "−")


def within(x: float, half: float) -> str:
    """A value with half the width of its interval, both to a place that says something: three digits at most."""
    if not math.isfinite(half):
        return number(x)
    if half == 0.0 or x == 0.0:
        return f"{number(x)} ± {number(half, 1)}"
    # The first digit of the half width is the last place of the value, unless that has three digits before it.
    first, third = math.floor(math.log10(float(f"{half:.0e}"))), math.floor(math.log10(abs(x))) - 2
    value = round(x, -max(first, third))
    digits = 3 if value == 0.0 else max(math.floor(math.log10(abs(value))) - max(first, third) + 1, 1)
    return f"{number(value, digits, pad=digits > 1)} ± {number(half, 1)}"


def law_name(law: str) -> str:
    """Name of a law in words; one with parameters or sites as it was given."""
    return law if "=" in law or "@" in law else law.replace("_", " ")


def label(metric: str) -> str:
    """Name of a metric in words, with units as they are written: ``torque_gain_at_1hz`` is "torque gain at 1 Hz"."""
    text = _QUANTITY.sub(lambda m: f" {m[1]}{'.' + m[2] if m[2] else ''}\u00a0{_UNITS[m[3]]}", metric).replace("_", " ")
    for word, written in _METRIC_WORDS.items():
        text = re.sub(rf"\b{word}\b", written, text)
    return text


def unit(name: str) -> str:
    """A unit as it is written; nothing for the unit 1."""
    return "" if name == "1" else name.replace("m/s2", "m/s²").replace("rad/s2", "rad/s²")


def prose(text: str) -> str:
    """A definition with units and signs as they are written."""
    return text.replace("+-", "±").replace("m/s2", "m/s²")


def span(limits: Iterable[float]) -> str:
    """A range in words, which a minus sign does not garble; one number where both ends are written alike."""
    return " to ".join(dict.fromkeys(number(x) for x in limits))


def plain(value: Any) -> str:
    """Value of a parameter."""
    if isinstance(value, list):
        return "[" + ", ".join(plain(x) for x in value) + "]"
    return f"{value:.6g}".replace("-", "−") if isinstance(value, float) else str(value)


def capital(text: str) -> str:
    """A text with a capital at its beginning."""
    return text[:1].upper() + text[1:]


def in_words(words: Sequence[str]) -> str:
    """Words in a list: "a, b and c"."""
    return f"{', '.join(words[:-1])} and {words[-1]}" if len(words) > 1 else "".join(words)
