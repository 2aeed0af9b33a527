"""Checks of parameter values at construction: one message, with the name, the value and what is allowed; warnings."""

import inspect
import math
import operator
import warnings
from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray


def number(
    name: str, value: Any, *, minimum: float = -math.inf, maximum: float = math.inf, above: bool = False
) -> float:
    """``value`` as a float, if it is finite and within ``[minimum, maximum]`` (``above``: not at the minimum).

    Text and truth values are no numbers; :func:`read_number` reads text.

    Raises
    ------
    ValueError
        Naming the parameter, the value received and the range.
    """
    try:
        if isinstance(value, str | bytes | bool):  # float() takes them
            raise TypeError
        result = float(value)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} must be a number, got {value!r}") from None
    if not math.isfinite(result) or result < minimum or result > maximum or (above and result == minimum):
        low = f"greater than {minimum:g}" if above else f"at least {minimum:g}"
        parts = [low] * (minimum > -math.inf) + [f"at most {maximum:g}"] * (maximum < math.inf)
        raise ValueError(f"{name} must be finite{''.join(' and ' + part for part in parts)}, got {value!r}")
    return result


def read_number(text: str) -> Any:
    """The number that a text gives, or else the text itself, which :func:`number` then refuses by name."""
    try:
        return float(text)
    except ValueError:
        return text


def flag(name: str, value: Any) -> bool:
    """``value`` as a truth value: True or False, 1 or 0, or the words, as the command line gives them.

    Raises
    ------
    ValueError
        Naming the parameter and the value received.
    """
    words = {"true": True, "false": False}
    known = words.get(value.lower()) if isinstance(value, str) else value
    if isinstance(known, bool | int | float) and known in (0, 1):
        return bool(known)
    raise ValueError(f"{name} must be True or False (1 or 0), got {value!r}")


def whole(name: str, value: Any, minimum: int) -> int:
    """``value`` as an int, if it is a whole number, of Python or of numpy, and not below ``minimum``.

    Raises
    ------
    ValueError
        Naming the parameter, the value received and the range.
    """
    try:
        if isinstance(value, bool):  # a bool is an int
            raise TypeError
        result = operator.index(value)
        if result >= minimum:
            return result
    except TypeError:
        pass
    raise ValueError(f"{name} must be a whole number of at least {minimum}, got {value!r}")


def one_of(name: str, value: Any, allowed: Iterable[Any]) -> Any:
    """``value``, if it is one of those that are allowed.

    Raises
    ------
    ValueError
        Naming the parameter, what is allowed and the value received.
    """
    known = list(allowed)
    if value not in known:
        raise ValueError(f"{name} must be one of {', '.join(map(str, known))}, got {value!r}")
    return value


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """A clause of a message with those of ``names`` that are similar to ``name``, or with the first thirty names."""
    names = list(dict.fromkeys(names))
    close = [entry for entry in names if entry.endswith((f".{name}", f":{name}"))] or get_close_matches(name, names)
    if close:
        return f"did you mean {' or '.join(close)}?"
    return f"there are {', '.join(names[:30])}{', ...' if len(names) > 30 else ''}"


def positive(name: str, value: Any) -> float:
    """A finite float above zero."""
    return number(name, value, minimum=0.0, above=True)


def not_negative(name: str, value: Any) -> float:
    """A finite float, zero allowed."""
    return number(name, value, minimum=0.0)


def numbers(name: str, values: Any) -> NDArray[np.float64]:
    """``values`` as a new one-dimensional array of finite floats, at least one; a lone number counts as one.

    Raises
    ------
    ValueError
        Naming the parameter and what is wrong: the type, the shape, or the first value that is not finite.
    """
    try:
        result = np.array(values, dtype=float, ndmin=1)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} must be a one-dimensional array of numbers, got {values!r}") from None
    if result.ndim != 1 or result.size == 0:
        raise ValueError(f"{name} must be one-dimensional with at least one value, got shape {result.shape}")
    if not np.isfinite(result).all():
        first = int(np.argmin(np.isfinite(result)))
        raise ValueError(f"{name} must be finite, got {result[first]} at index {first}")
    return result


@lru_cache(maxsize=256)
def parameters_of(make: Callable[..., Any]) -> Mapping[str, inspect.Parameter]:
    """The parameters of a function by name, read once: every car that is made asks for those of all constructors."""
    return inspect.signature(make).parameters


def construct(what: str, make: Callable[..., Any], given: Mapping[str, Any]) -> Any:
    """``make(**given)``, if these are its parameters.

    Raises
    ------
    ValueError
        For a parameter that ``make`` does not take or that is missing, with those that it takes.
    """
    known = parameters_of(make)
    takes = f"it takes: {', '.join(known)}" if known else "it takes none"
    for key in given:
        if key not in known:
            raise ValueError(f"{what} has no parameter {key!r}; {takes}")
    for key, parameter in known.items():
        if key not in given and parameter.default is parameter.empty:
            raise ValueError(f"{what} lacks {key!r}; {takes}")
    return make(**given)


_WARNED: set[str] = set()


def warn_once(text: str, category: type[Warning], stacklevel: int) -> None:
    """Warn of what a file or its values have, each text once in a process; ``stacklevel`` as for the caller."""
    if text not in _WARNED:
        _WARNED.add(text)
        warnings.warn(text, category, stacklevel=stacklevel + 1)
