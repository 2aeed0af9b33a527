"""What a kind of steering declares: the keys at the column axis that follow from a section of the car file.

Everything below the torsion bar turns together, so that every kind is a column and an assist to the plant; by wire the
bar has no stiffness, and the assist has a wire. A kind is a file of this folder and the section of its name in
``data/cars/keys.toml``; a car file with that section has the kind.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from numpy.typing import NDArray

from steer_env.friction.numerics.registry import Registry
from steer_env.vehicle.keys import declared_keys

COLUMN_EPS = "column_eps"  # of a car file without a section of a kind: its sections column and assist are complete

Section = Mapping[str, Any]


class Kind(NamedTuple):
    """A kind of steering."""

    at_column: Callable[[Section, float], dict[str, dict[str, Any]]]  # section, pinion radius [m] -> keys by section
    boost: Callable[[NDArray[Any], float], NDArray[Any]] | None = None  # its own, pinion radius [m] -> at the column
    tables: Mapping[str, Any] = {}  # keys of its section that are no numbers -> what they are where left out
    wire: Callable[[Section, Mapping[str, float]], Any] | None = None  # section, section steering -> wire


KINDS: Registry[Kind] = Registry("steering", "steer_env.vehicle.steering.kinds")


def motor_per_rack(p: Section) -> float:
    """Motor angle over rack travel of a ball screw that a belt turns [rad/m]."""
    return 2.0 * math.pi * p["belt_ratio"] / p["screw_lead"]  # (C10)


def at_pinion(p: Section, pinion_radius: float, pinion_inertia: float = 0.0) -> tuple[float, float, float, float]:
    """Inertia, damping, largest torque and ratio of a rack with a motor, seen at a pinion with its radius [m], SI."""
    n, squared = motor_per_rack(p), pinion_radius**2
    mass = p["rack_mass"] + p["wheels_mass"] + n**2 * p["motor_inertia"]
    I2, C2 = pinion_inertia + squared * mass, squared * p["rack_damping"]  # (C11)
    return I2, C2, pinion_radius * n * p["motor_torque"], pinion_radius * n  # (C12)


def available() -> tuple[str, ...]:
    """Names of the kinds of steering, that of cars without a section of a kind first."""
    return COLUMN_EPS, *KINDS.available()


def follows(name: str) -> set[str]:
    """The keys of a car file, as ``column.I2``, that follow from the section of a kind of steering."""
    if name == COLUMN_EPS:
        return set()
    kind = KINDS[name]
    found = kind.at_column({**dict.fromkeys(declared_keys()[name], 1.0), **kind.tables}, 1.0)
    return {f"{section}.{key}" for section, keys in found.items() for key in keys}


def kind_of_sections(sections: Iterable[str]) -> str:
    """The kind of a car file with these sections; ValueError where there are two."""
    found = [name for name in KINDS.available() if name in sections]
    if len(found) > 1:
        raise ValueError(f"car has sections of several kinds of steering, {', '.join(found)}: give one of them")
    return found[0] if found else COLUMN_EPS


def wire(contents: Mapping[str, Any]) -> Any:
    """What connects handwheel and rack by the contents of a car file; None: a column."""
    name = kind_of_sections(contents)
    if name == COLUMN_EPS or (made := KINDS[name].wire) is None:
        return None
    try:
        return made(contents[name], contents["steering"])
    except ValueError as error:
        raise ValueError(f"{name}.{error}") from None
