"""Numbers and names as a reader sees them, in reports and tables."""

import math
from typing import Any

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_WORDS = {"0g": "0 g", "0p1g": "0.1 g", "0nm": "0 N m"}


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
    """A signed share of 1 in per cent, to a hundredth."""
    return "–" if math.isnan(x) else f"{100.0 * x:+.2f}\u00a0%".replace("-", "−")


def label(metric: str) -> str:
    """Name of a metric in words."""
    return " ".join(_WORDS.get(word, word) for word in metric.split("_"))


def plain(value: Any) -> str:
    """Value of a parameter."""
    if isinstance(value, list):
        return "[" + ", ".join(plain(x) for x in value) + "]"
    return f"{value:.6g}".replace("-", "−") if isinstance(value, float) else str(value)
