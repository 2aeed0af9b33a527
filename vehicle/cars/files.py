"""Car files: each packaged or own file, checked key by key, becomes a :class:`Car`."""

import json
import re
from functools import lru_cache
from inspect import signature
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from steer_env.friction.numerics import toml
from steer_env.vehicle import tyre
from steer_env.vehicle.cars.car import Car
from steer_env.vehicle.cars.keys import CHASSIS, CONSTRUCTORS, SECTIONS, SIZE, STEERING, numbers, require, require_known
from steer_env.vehicle.suspension import kinematics_table
from steer_env.vehicle.suspension.macpherson import MacPherson

DATA = Path(__file__).parents[1] / "data" / "cars"


def from_data(data: dict[str, Any]) -> Car:
    """A car from the contents of a data file.

    Raises
    ------
    ValueError
        An unknown or missing key, or a value outside its range, named with its section.
    """
    require("car", data, SECTIONS)
    chassis = numbers("chassis", data["chassis"], CHASSIS, SIZE)
    rest = chassis["mass"] - chassis["sprung_mass"] - chassis["front_unsprung_mass"]
    if rest <= 0.0:
        raise ValueError(
            f"chassis.mass must exceed sprung_mass + front_unsprung_mass, the rear axle is left {rest:g} kg"
        )
    if rest > 3.0 * chassis["front_unsprung_mass"]:
        raise ValueError(
            "chassis.mass leaves the rear axle an unsprung mass of"
            f" {rest:g} kg, more than 3 times front_unsprung_mass; change sprung_mass with it"
        )
    for section, make in CONSTRUCTORS.items():
        require_known(section, data[section], signature(make).parameters)
    steering = numbers("steering", data["steering"], STEERING)
    assumed = {*data, *chassis, *steering}
    for key in data["assumed"]:
        if key not in assumed:
            raise ValueError(f"assumed names {key!r}, which is neither a section nor a key of chassis or steering")
    strut = MacPherson.load(data["strut"]).at_track(chassis["front_track"])
    return Car(
        name=data["name"],
        description=data["description"],
        source=data["source"],
        chassis=chassis,
        steering=steering,
        **{section: make(**data[section]) for section, make in CONSTRUCTORS.items()},
        tyre=tyre.load(data["tyre"]),
        strut=strut,
        kinematics_table=kinematics_table.build(strut),
    )


def available() -> tuple[str, ...]:
    """Names of the packaged cars."""
    return tuple(sorted(file.stem for file in DATA.glob("*.json")))


def load(name: str | PathLike[str] = "compact") -> Car:
    """A packaged car by name, or a car of your own from a ``.toml`` or ``.json`` file.

    A file has the sections of the packaged ones (``vehicle/data/cars``), in SI units. With a key ``base`` it takes from
    that packaged car what it does not give itself. The path of a tyre file (``tyre = "my.tir"``) is relative to the
    folder of the car file.

    Raises
    ------
    ValueError
        An unknown name (the message lists the known ones); or in a file, with its name and line: a syntax error, an
        unknown or missing key, a value outside its range.
    OSError
        A file that cannot be read.
    """
    if not isinstance(name, str | PathLike):
        raise ValueError(f"vehicle must be a name or a path, got a {type(name).__name__}")
    return _from_file(Path(name)) if _is_file(name) else _packaged(fspath(name))


def _is_file(name: str | PathLike[str]) -> bool:
    return fspath(name).endswith((".toml", ".json"))


@lru_cache
def _packaged(name: str) -> Car:
    return from_data(_data(name))


def _data(name: str) -> dict[str, Any]:
    if name not in available():
        raise ValueError(f"vehicle must be a .toml or .json file or one of {', '.join(available())}, got {name!r}")
    return json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))


def _from_file(path: Path) -> Car:
    text, data = _parsed(path)
    try:
        return from_data(_completed(path, data))
    except (ValueError, OSError) as error:
        raise ValueError(f"{path}:{_line(text, str(error))} {error}") from None


def _parsed(path: Path) -> tuple[str, Any]:
    """Text and contents of a file."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{path}: expected text in UTF-8") from None
    try:
        return text, toml.loads(text) if path.suffix == ".toml" else json.loads(text)
    except ValueError as error:  # both parsers tell the line
        raise ValueError(f"{path}: {error}") from None


def _completed(path: Path, data: Any) -> Any:
    """The contents of a file with what it takes from its base, and with the place of its tyre file."""
    if isinstance(data, dict) and "base" not in data and not set(SECTIONS) <= set(data):
        require_known("car", data, SECTIONS)
        lacking = ", ".join(key for key in SECTIONS if key not in data)
        raise ValueError(f"car lacks {lacking}; give them, or a base: {', '.join(available())}")
    if isinstance(data, dict) and "base" in data:
        if data["base"] not in available():
            raise ValueError(f"base must be one of {', '.join(available())}, got {data['base']!r}")
        base = _data(data.pop("base"))
        require_known("car", data, SECTIONS)
        sections = {key: {**base[key], **value} for key, value in data.items() if isinstance(value, dict)}
        data = {**base, "name": path.stem, **data, **sections}
    if isinstance(data, dict) and str(data.get("tyre", "")).endswith(".tir"):
        data["tyre"] = str(path.parent / data["tyre"])
    return data


def _line(text: str, message: str) -> str:
    """Number of the first line that sets a key which the message names, with a colon; empty if there is none."""
    named = set(re.findall(r"\w+", message.split(";")[0]))
    for pattern in (r"""\s*["']?(\w+)["']?\s*[=:]\s*(?!\{)""", r"""\s*(?:\[|["'])(\w+)"""):  # keys, then sections
        for i, line in enumerate(text.splitlines(), 1):
            key = re.match(pattern, line)
            if key and key.group(1) in named:
                return f"{i}:"
    return ""


def every_key(name: str | PathLike[str]) -> dict[str, Any]:
    """The data of a car with the defaults of every section: every key that a car file may set, in SI units.

    ``name`` and errors are those of :func:`load`.
    """
    load(name)
    path = Path(name)
    data = _completed(path, _parsed(path)[1]) if _is_file(name) else _data(fspath(name))
    for section, make in CONSTRUCTORS.items():
        defaults = {key: p.default for key, p in signature(make).parameters.items()}
        data[section] = {**defaults, **data[section]}
    return data
