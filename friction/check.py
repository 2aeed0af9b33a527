"""Checks of parameter values at construction: one message, with the name, the value and what is allowed."""

import math
from typing import Any


def number(
    name: str, value: Any, *, minimum: float = -math.inf, maximum: float = math.inf, above: bool = False
) -> float:
    """``value`` as a float, if it is finite and within ``[minimum, maximum]`` (``above``: not at the minimum).

    Raises
    ------
    ValueError
        Naming the parameter, the value received and the range.
    """
    try:
        result = float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be a number, got {value!r}") from None
    if not math.isfinite(result) or result < minimum or result > maximum or (above and result == minimum):
        low = f"greater than {minimum:g}" if above else f"at least {minimum:g}"
        parts = [low] * (minimum > -math.inf) + [f"at most {maximum:g}"] * (maximum < math.inf)
        raise ValueError(f"{name} must be finite{''.join(' and ' + part for part in parts)}, got {value!r}")
    return result


def positive(name: str, value: Any) -> float:
    """A finite float above zero."""
    return number(name, value, minimum=0.0, above=True)


def not_negative(name: str, value: Any) -> float:
    """A finite float, zero allowed."""
    return number(name, value, minimum=0.0)
