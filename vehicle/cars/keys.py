"""Sections of a car file, and the check of the keys and numbers of a section."""

from collections.abc import Callable, Iterable
from typing import Any

from steer_env.vehicle.chassis.two_track import brakes, drivetrain, speed_hold
from steer_env.vehicle.keys import checked, declared_keys
from steer_env.vehicle.steering import column, eps
from steer_env.vehicle.steering.kinds.common import KINDS

# Sections whose keys are the keyword arguments of a constructor, which also checks them.
CONSTRUCTORS: dict[str, Callable[..., Any]] = {
    "column": column.make,
    "assist": eps.make,
    "drivetrain": drivetrain.make,
    "brakes": brakes.make,
    "speed_hold": speed_hold.make,
}
TEXT_KEYS = ("name", "description", "source")
TABLES = ("chassis", "steering", *CONSTRUCTORS)
SECTIONS = (*TEXT_KEYS, "assumed", "tyre", "strut", *TABLES)
OF_KINDS = KINDS.available()  # sections of which a car has one at most


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
    """The numbers of a section without constructor, with their defaults, checked; ValueError names section and key.

    Without ``required`` keys may be missing that have no default.
    """
    keys = declared_keys()[section]
    found = {name: key.default for name, key in keys.items() if key.default is not None}
    if required:
        needed = tuple(name for name, key in keys.items() if key.default is None and not key.optional)
        require(section, given, needed, tuple(name for name in keys if name not in needed))
    else:
        require_known(section, given, keys)
    for name, value in given.items():
        found[name] = checked(section, name, value, f"{section}.{name}")
    return found
