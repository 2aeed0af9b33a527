"""What a kind of steering declares: the keys at the column axis that follow from a section of the car file.

Everything below the torsion bar turns together, so that every kind is a column and an assist to the plant. A kind is a
file of this folder and the section of its name in ``data/cars/keys.toml``; a car file with that section has the kind.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from numpy.typing import NDArray

from steer_env.friction.numerics.registry import Registry
from steer_env.vehicle.keys import declared_keys

COLUMN_EPS = "column_eps"  # of a car file without a section of a kind: its sections column and assist are complete

Section = Mapping[str, float]


class Kind(NamedTuple):
    """A kind of steering."""

    at_column: Callable[[Section, float], dict[str, dict[str, float]]]  # section, pinion radius [m] -> keys by section
    boost: Callable[[NDArray[Any], float], NDArray[Any]]  # its own boost table, pinion radius [m] -> that at the column


KINDS: Registry[Kind] = Registry("steering", "steer_env.vehicle.steering.kinds")


def available() -> tuple[str, ...]:
    """Names of the kinds of steering, that of cars without a section of a kind first."""
    return COLUMN_EPS, *KINDS.available()


def follows(name: str) -> set[str]:
    """The keys of a car file, as ``column.I2``, that follow from the section of a kind of steering."""
    if name == COLUMN_EPS:
        return set()
    found = KINDS[name].at_column(dict.fromkeys(declared_keys()[name], 1.0), 1.0)
    return {f"{section}.{key}" for section, keys in found.items() for key in keys}


def kind_of_sections(sections: Iterable[str]) -> str:
    """The kind of a car file with these sections; ValueError where there are two."""
    found = [name for name in KINDS.available() if name in sections]
    if len(found) > 1:
        raise ValueError(f"car has sections of several kinds of steering, {', '.join(found)}: give one of them")
    return found[0] if found else COLUMN_EPS
