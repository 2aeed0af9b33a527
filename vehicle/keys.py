"""What ``data/cars/keys.toml`` declares of every key of a car file, and the check of a number against it."""

import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from steer_env.friction import level
from steer_env.friction.numerics import toml
from steer_env.friction.numerics.check import number

FILE = Path(__file__).parent / "data" / "cars" / "keys.toml"
LARGEST = 1e30  # value of a key without a limit of its own: powers of larger ones exceed the numbers of a computer
JUDGEMENT = "engineering judgement"


class Key(NamedTuple):
    """What ``keys.toml`` declares of a key of a car file."""

    meaning: str
    unit: str
    allowed: str  # in words
    low: float = 0.0  # least value [unit]
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


def checked(section: str, key: str, value: Any, name: str = "") -> float:
    """``value`` as a float within the range that is declared of a key; ValueError names the key, or ``name``."""
    about = declared_keys()[section][key]
    found = number(name or key, value, minimum=about.low, maximum=about.high, above=about.above)
    return found if found <= LARGEST else number(name or key, value, maximum=LARGEST)
