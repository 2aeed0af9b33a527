"""The way back from a car to the contents of a car file: a mapping, or a file of its own."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from steer_env.friction.numerics.check import parameters_of
from steer_env.vehicle import tyre
from steer_env.vehicle.cars.keys import CONSTRUCTORS, TEXT_KEYS
from steer_env.vehicle.keys import declared_keys
from steer_env.vehicle.steering.by_wire import NoWire
from steer_env.vehicle.steering.kinds import common as kinds
from steer_env.vehicle.suspension.macpherson import MacPherson

if TYPE_CHECKING:
    from steer_env.vehicle.cars.car import Car

_HEADINGS = {
    "": "A car file of steer-env: every key with its meaning, unit and range. Units are SI, left is positive.\n"
    'What is left out of a section with defaults takes them; with base = "compact" a file takes all that it leaves\n'
    "out from that car. The page car_files.md of the documentation tells more.",
    "name": "of the car, in tables and pages",
    "source": "where the numbers come from",
    "assumed": "sections, and keys of chassis and steering, whose numbers have no source",
    "tyre": "a packaged tyre, or a property file *.tir, its path relative to this file",
    "strut": "a packaged strut, placed at the front track",
    "chassis": "Axle distances are those of the centre of gravity of the whole car. Springs and dampers act at the\n"
    "wheel, one for each wheel. Bump is positive.",
    "rack_eps": "This section makes the steering a rack EPS: inertia and damping below the torsion bar and the limit\n"
    "of the assist follow from it. A boost here, in N at the rack, may replace that of the assist. Losses of the gear\n"
    "are friction, which is lugre@rack_eps where none is given.",
    "steer_by_wire": "This section makes the steering a steer-by-wire: torsion bar, boost, damping and functions of\n"
    "the assist go; inertia, damping and the limit of the motor at the rack follow. Torques of the feel are those at\n"
    "the handwheel. The friction is lugre@steer_by_wire where none is given.",
    "column": "What the driver feels through: the handwheel, the torsion bar and what is below it.",
    "assist": "Torques are those at the column.",
    "drivetrain": "Only two tracks have a drivetrain, brakes and a speed hold.",
}
BY_HAND = "was replaced in the car by what no car file gives: change its keys by cars.load(..., changes=...)"


def data(car: "Car") -> dict[str, Any]:
    """Contents of a car file, as :meth:`Car.data` says."""
    given = car.given
    strut = MacPherson.packaged(given["strut"], car.chassis["front_track"])
    if (strut.points, strut.loaded_radius) != (car.strut.points, car.strut.loaded_radius):
        raise ValueError(f"strut {BY_HAND}")
    parts = {section: getattr(car, section) for section in CONSTRUCTORS}
    wire, parts["assist"] = car.assist.wire, car.assist._replace(wire=NoWire())
    if not _same(wire, kinds.wire(given) or NoWire()):
        raise ValueError(f"{car.kind} {BY_HAND}")
    found = {
        **{key: getattr(car, key) for key in TEXT_KEYS},
        "assumed": list(given["assumed"]),
        "tyre": tyre.data(car.tyre),
        "strut": given["strut"],
        "chassis": dict(car.chassis),
        "steering": dict(car.steering),
        **{section: _keys(section, given[section], part) for section, part in parts.items()},
    }
    return found if car.kind == kinds.COLUMN_EPS else _of_kind(found, car.kind, given[car.kind])


def _of_kind(found: dict[str, Any], name: str, section: Mapping[str, Any]) -> dict[str, Any]:
    """The contents with the section of the kind of steering in place of the keys at the column that follow from it."""
    for other, keys in kinds.KINDS[name].at_column(section, found["steering"]["pinion_radius"]).items():
        for key, value in keys.items():
            if found[other].pop(key) != value:
                raise ValueError(f"{other}.{key} follows from the section {name} of the car, and {BY_HAND}")
    place = list(found).index("column")
    return dict([*list(found.items())[:place], (name, dict(section)), *list(found.items())[place:]])


def _keys(section: str, given: Mapping[str, Any], made: Any) -> dict[str, Any]:
    """Every key of a section that is made by a constructor, with the value that gives ``made`` to the bit."""
    make = CONSTRUCTORS[section]
    values = {key: given.get(key, parameter.default) for key, parameter in parameters_of(make).items()}
    again = make(**values)
    # A part that was replaced, for example a boost table, is itself the value of the key of the same name.
    replaced = {
        key: getattr(made, key) for key in values if not _same(getattr(made, key, None), getattr(again, key, None))
    }
    if replaced:
        values |= replaced
        try:
            again = make(**values)
        except ValueError:
            raise ValueError(f"{section} {BY_HAND}") from None
    if not _same(again, made):
        raise ValueError(f"{section} {BY_HAND}")
    return {key: _plain(value) for key, value in values.items() if value is not None}


def _same(one: Any, other: Any) -> bool:
    """Whether two parameters are equal to the bit, also arrays and named tuples of them."""
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return np.array_equal(one, other)
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    return bool(one == other)


def _plain(value: Any) -> Any:
    """A value as JSON and TOML hold it."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value


def write(car: "Car", path: str | os.PathLike[str], comments: bool = False) -> None:
    """Write a car as a car file, ``.toml`` or ``.json``, that :func:`steer_env.vehicle.cars.load` reads to the bit.

    The file has every key and needs no other file: a tyre that is not packaged is in it with its coefficients. The file
    is there as a whole or not at all. With ``comments`` a TOML file tells meaning, unit and range of every key.

    Raises
    ------
    ValueError
        Another suffix, comments in a JSON file, or a car that :meth:`Car.data` refuses.
    """
    place = Path(path)
    if place.suffix not in (".toml", ".json"):
        raise ValueError(f"the name of a car file must end in .toml or .json, got {os.fspath(path)!r}")
    if comments and place.suffix == ".json":
        raise ValueError(f"a JSON file holds no comments: give a name that ends in .toml, got {os.fspath(path)!r}")
    found = (
        text(car, comments) if place.suffix == ".toml" else json.dumps(data(car), indent=2, ensure_ascii=False) + "\n"
    )
    part = place.with_name(f".{place.name}.{os.getpid()}.part")
    try:
        part.write_text(found, encoding="utf-8")
        os.replace(part, place)
    finally:
        part.unlink(missing_ok=True)


def text(car: "Car", comments: bool = False) -> str:
    """The text of the ``.toml`` file that :func:`write` writes, with its errors."""
    return _toml(data(car), key_comments() if comments else {})


def _toml(contents: Mapping[str, Any], comments: Mapping[str, str], section: str = "") -> str:
    """The contents of a car file as TOML: a line for each key, with a comment above it where ``comments`` has one.

    Parameters
    ----------
    contents : mapping
        Text, numbers, lists of them, and mappings, each of which becomes a table.
    comments : mapping
        Comments by section (``"column"``) and by key (``"column.K_tb"``).
    section : str
        The table that ``contents`` is of; empty for the whole file.
    """
    prefix = f"{section}." if section else ""
    lines = [line for line in (_comment(comments, section), f"[{section}]" if section else "") if line]
    for key, value in contents.items():
        if not isinstance(value, Mapping):
            lines += [line for line in (_comment(comments, prefix + key), f"{key} = {_value(value)}") if line]
    tables = [_toml(value, comments, prefix + key) for key, value in contents.items() if isinstance(value, Mapping)]
    return "\n".join([*lines, "", *tables])


def key_comments() -> dict[str, str]:
    """A comment for the file, for each section and for each key, in the form that a written file takes."""
    keys = {
        f"{section}.{key}": f"{about.meaning}{f' [{about.unit}]' if about.unit else ''}; {about.allowed}"
        for section, each in declared_keys().items()
        for key, about in each.items()
    }
    return {**_HEADINGS, **keys}


def _comment(comments: Mapping[str, str], name: str) -> str:
    return "\n".join(f"# {line}" for line in comments.get(name, "").splitlines())


def _value(value: Any) -> str:
    """A value in TOML, which takes JSON's text, numbers and lists; the rows of a table stand below each other."""
    if isinstance(value, list) and value and isinstance(value[0], list):
        return "[\n" + "".join(f"  {_value(row)},\n" for row in value) + "]"
    return json.dumps(value, ensure_ascii=False)
