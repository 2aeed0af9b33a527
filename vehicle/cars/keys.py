"""Sections and keys of a car file, which ``data/cars/keys.toml`` declares, and the check of a section."""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from steer_env.friction import level
from steer_env.friction.numerics import toml
from steer_env.friction.numerics.check import number
from steer_env.vehicle.chassis.two_track import brakes, drivetrain, speed_hold
from steer_env.vehicle.steering import column, eps

FILE = Path(__file__).parents[1] / "data" / "cars" / "keys.toml"
JUDGEMENT = "engineering judgement"


class Key(NamedTuple):
    """What ``keys.toml`` declares of a key of a car file."""

    meaning: str
    unit: str
    allowed: str  # in words
    low: float = 0.0  # least value [unit]; this and the following of chassis and steering, and of no other section
    high: float = math.inf  # [unit]
    above: bool = False  # whether the least value itself is excluded
    default: float | None = None  # of a key that may be left out [unit]
    optional: bool = False  # whether a car may be without it
    usual: tuple[float, float] | None = None  # what passenger cars have [unit]
    source: str = JUDGEMENT  # of what is usual


def _key(
    name: str,
    *,
    meaning: str,
    unit: str = "",
    allowed: str = "",
    range: Sequence[float] | None = None,
    above: bool = False,
    default: float | None = None,
    optional: bool = False,
    usual: Sequence[float] | None = None,
    source: str = JUDGEMENT,
) -> Key:
    """A key from its line of the file; the conditions of the level of friction have their ranges from there."""
    low, high = map(float, range or level.LIMITS.get(name.removeprefix("friction_"), (0.0, math.inf)))
    if not allowed:
        end = "" if math.isinf(high) else f"{high:g}"
        start = f"above {low:g}, at most " if above else f"{low:g} to " if end else f"at least {low:g}"
        allowed = start + end if end else start.removesuffix(", at most ")
    return Key(
        meaning,
        unit,
        allowed,
        low,
        high,
        above,
        None if default is None else float(default),
        optional,
        (float(usual[0]), float(usual[1])) if usual else None,
        source,
    )


@cache
def declared_keys() -> dict[str, dict[str, Key]]:
    """Section -> key -> what is declared of it."""
    sections = toml.loads(FILE.read_text(encoding="utf-8"))
    return {section: {name: _key(name, **entry) for name, entry in keys.items()} for section, keys in sections.items()}


# Sections whose keys are the keyword arguments of a constructor, which also checks them.
CONSTRUCTORS: dict[str, Callable[..., Any]] = {
    "column": column.make,
    "assist": eps.make,
    "drivetrain": drivetrain.make,
    "brakes": brakes.make,
    "speed_hold": speed_hold.make,
}
TEXTS = ("name", "description", "source")
TABLES = ("chassis", "steering", *CONSTRUCTORS)
SECTIONS = (*TEXTS, "assumed", "tyre", "strut", *TABLES)


def require_known(where: str, given: Any, allowed: Iterable[str]) -> None:
    """Raise ValueError for a section that is no mapping or has a key that is not allowed."""
    if not isinstance(given, dict):
        raise ValueError(f"{where} must hold keys and values, got {given!r}")
    for key in given:
        if key not in allowed:
            raise ValueError(f"{where} has no key {key!r}; it takes: {', '.join(allowed)}")


def require(where: str, given: Any, allowed: tuple[str, ...], optional: tuple[str, ...] = ()) -> None:
    """Raise ValueError for an unknown key or a missing one."""
    require_known(where, given, (*allowed, *optional))
    for key in allowed:
        if key not in given:
            raise ValueError(f"{where} lacks the key {key!r}")


def numbers(section: str, given: dict, required: bool = True) -> dict[str, float]:
    """The numbers of ``chassis`` or ``steering`` with their defaults, checked; ValueError names section and key.

    Without ``required`` keys may be missing that have no default.
    """
    keys = declared_keys()[section]
    checked = {name: key.default for name, key in keys.items() if key.default is not None}
    if required:
        needed = tuple(name for name, key in keys.items() if key.default is None and not key.optional)
        require(section, given, needed, tuple(name for name in keys if name not in needed))
    else:
        require_known(section, given, keys)
    for name, value in given.items():
        key = keys[name]
        checked[name] = number(f"{section}.{name}", value, minimum=key.low, maximum=key.high, above=key.above)
    return checked
