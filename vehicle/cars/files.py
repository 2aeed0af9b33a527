"""Car files: each packaged or own file, checked key by key, becomes a :class:`Car`."""

import copy
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, lru_cache, partial
from numbers import Real
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics import toml
from steer_env.friction.numerics.check import number, one_of, parameters_of, warn_once
from steer_env.friction.numerics.frozen import frozen
from steer_env.vehicle import tyre
from steer_env.vehicle.cars import contradictions, plausible
from steer_env.vehicle.cars.car import Car
from steer_env.vehicle.cars.keys import (
    CONSTRUCTORS,
    OF_KINDS,
    SECTIONS,
    TABLES,
    TEXT_KEYS,
    numbers,
    require,
    require_known,
)
from steer_env.vehicle.keys import LARGEST, declared_keys
from steer_env.vehicle.steering import wire_loops
from steer_env.vehicle.steering.assist.by_speed import table
from steer_env.vehicle.steering.kinds import common as kinds
from steer_env.vehicle.suspension import kinematics_table
from steer_env.vehicle.suspension.macpherson import MacPherson

CAR_FOLDER = Path(__file__).parents[1] / "data" / "cars"
PRESSED = 0.006  # rack travel beyond the limit that the end stop gives way under 12 kN [m]


def from_data(data: dict[str, Any]) -> Car:
    """A car from the contents of a data file.

    Raises
    ------
    ValueError
        An unknown or missing key, a value outside its range, or values that contradict each other, named with their
        section.

    Warns
    -----
    UnusualCar
        For each quantity that passenger cars do not usually have, once.
    """
    car = _checked(data)
    for text in plausible.unusual(car):
        warn_once(f"car {car.name}: {text}", plausible.UnusualCar, stacklevel=2)
    return car


def _checked(data: dict[str, Any]) -> Car:
    require("car", data, SECTIONS, OF_KINDS)
    _require_text(data)
    chassis = numbers("chassis", data["chassis"])
    steering = numbers("steering", data["steering"])
    data = _at_column(data, steering["pinion_radius"])
    assumed = {*data, *chassis, *steering}
    for key in data["assumed"]:
        if key not in assumed:
            raise ValueError(f"assumed names {key!r}, which is neither a section nor a key of chassis or steering")
    strut = MacPherson.packaged(data["strut"], chassis["front_track"])
    parts = {section: _construct(section, data[section]) for section in CONSTRUCTORS}
    if wire := kinds.wire(data):
        parts["assist"] = frozen(parts["assist"]._replace(wire=wire))
        wire_loops.check(parts["column"], parts["assist"])
    elif not parts["column"].K_tb:
        number("column.K_tb", 0.0, minimum=0.0, above=True)
    car = Car(
        name=data["name"],
        description=data["description"],
        source=data["source"],
        chassis=chassis,
        steering=steering,
        **parts,
        tyre=_tyre(data["tyre"]),
        strut=strut,
        kinematics_table=_kinematics(strut, steering["rack_limit"]),
        given=copy.deepcopy({**data, "tyre": None}),
    )
    contradictions.check(car)
    return car


@lru_cache(maxsize=32)
def _kinematics(strut: MacPherson, rack_limit: float) -> kinematics_table.KinematicsTable:
    """The table of a strut as far as the rack goes when it is pressed against its stop; cars share it."""
    try:
        return kinematics_table.tabulate_strut(strut, rack=rack_limit + PRESSED)
    except ValueError as error:
        raise ValueError(
            f"steering.rack_limit must leave the strut {1e3 * PRESSED:g} mm beyond it, got {rack_limit:g}: {error}"
        ) from None


def _at_column(data: dict[str, Any], pinion_radius: float) -> dict[str, Any]:
    """The contents of a file with the keys at the column that follow from its kind of steering, complete and checked.

    A boost table in the units of the kind becomes that of the assist, which the tools of the assist then change.
    """
    name = kinds.kind_of_sections(data)
    if name == kinds.COLUMN_EPS:
        return data
    kind, found = kinds.KINDS[name], dict(data)
    require_known(name, data[name], (*declared_keys()[name],))
    for other in ("column", "assist"):
        require_known(other, data[other], parameters_of(CONSTRUCTORS[other]))
    section = dict(data[name])
    if kind.boost is not None and "boost" in section:
        if "boost" in data["assist"]:
            raise ValueError(f"{name}.boost and assist.boost are both given: give one of them")
        own = _boost(name, section.pop("boost"))
        found["assist"] = {**data["assist"], "boost": kind.boost(own, pinion_radius).tolist()}
    tables = {key: section.pop(key, default) for key, default in kind.tables.items()}
    _require_forms(name, tables, kind.tables)
    found[name] = {**numbers(name, section), **tables}
    for other, keys in kind.at_column(found[name], pinion_radius).items():
        for key, value in keys.items():
            if (given := found[other].get(key, value)) != value:
                raise ValueError(
                    f"{other}.{key} of a car with {name} follows from its section {name} and the pinion radius: leave "
                    f"it out, or give {value!r}, got {given!r}"
                )
        found[other] = {**found[other], **keys}
    return found


def _boost(name: str, given: Any) -> NDArray[Any]:
    """The boost table of a kind of steering, checked in its own unit; the assist compares its shape with its own."""
    _require_numbers(f"{name}.boost", given)
    found = table(f"{name}.boost", given)
    if found.ndim != 2 or not found.size or not np.all((found >= 0.0) & (found <= LARGEST)) or np.any(found[:, 0]):
        unit = declared_keys()[name]["boost"].unit
        raise ValueError(
            f"{name}.boost must have rows of numbers [{unit}], not negative, at most {LARGEST:g}, and zero at zero "
            f"torque, got {found.tolist()}"
        )
    return found


def _tyre(given: Any) -> tyre.Tyre:
    """The tyre of a car; ValueError where there is no such file."""
    try:
        return tyre.load(given)
    except OSError as error:
        raise ValueError(f"tyre file {error.filename}: {error.strerror}") from None


def _require_text(data: dict[str, Any]) -> None:
    """Raise ValueError unless names and descriptions are text."""
    for key in (*TEXT_KEYS, "tyre", "strut"):
        if not isinstance(data[key], str | PathLike) and not (key == "tyre" and isinstance(data[key], Mapping)):
            raise ValueError(f"{key} must be text, got {data[key]!r}")
    keys = data["assumed"]
    if isinstance(keys, str) or not isinstance(keys, Sequence) or not all(isinstance(key, str) for key in keys):
        raise ValueError(f"assumed must be a list of keys, got {keys!r}")


def _leaves(value: Any) -> Iterator[Any]:
    """The values of a list and of the lists in it."""
    if isinstance(value, list | tuple | np.ndarray):
        for each in value:
            yield from _leaves(each)
    else:
        yield value


def _require_numbers(name: str, given: Any) -> None:
    """Raise ValueError unless a list holds numbers only: float() takes True and "1"."""
    for leaf in _leaves(given):
        if isinstance(leaf, bool) or not isinstance(leaf, Real):
            raise ValueError(f"{name} must hold numbers only, got {leaf!r}")


_FORMS = ("a number", "a list of numbers", "a list of rows, each a list of numbers")


def _depth(value: Any) -> int:
    """How deep lists are nested: 0 for a number, 1 for a list of numbers, 2 for a table."""
    if isinstance(value, np.ndarray):
        return value.ndim
    return 1 + max(map(_depth, value), default=0) if isinstance(value, list | tuple) else 0


def _construct(section: str, given: Any) -> Any:
    """The parameters of a section that has a constructor."""
    make = CONSTRUCTORS[section]
    known = parameters_of(make)
    require_known(section, given, known)
    _require_forms(section, given, {key: parameter.default for key, parameter in known.items()})
    try:
        return make(**given)
    except ValueError as error:
        raise ValueError(f"{section}.{error}") from None


def _require_forms(section: str, given: Mapping[str, Any], defaults: Mapping[str, Any]) -> None:
    """Raise ValueError unless each value of a section is text or holds numbers, nested as deep as its default."""
    for key, value in given.items():
        wanted = _depth(defaults[key])
        if _depth(value) > wanted:
            raise ValueError(f"{section}.{key} must be {_FORMS[wanted]}, got {value!r}")
        if isinstance(defaults[key], str):
            if not isinstance(value, str):
                raise ValueError(f"{section}.{key} must be text, got {value!r}")
            continue
        _require_numbers(f"{section}.{key}", value)


def available() -> tuple[str, ...]:
    """Names of the packaged cars."""
    return tuple(sorted(file.stem for file in CAR_FOLDER.glob("*.json")))


def load(
    name: str | PathLike[str] | Mapping[str, Any] | Car = "compact",
    changes: Mapping[str, Any] | None = None,
    steering: str | None = None,
) -> Car:
    """A packaged car by name, or a car of your own from a ``.toml`` or ``.json`` file or a mapping with its contents.

    A :class:`Car` is itself.

    A file has the sections of the packaged ones (``vehicle/data/cars``), in SI units. With a key ``base`` it takes from
    that packaged car what it does not give itself. The path of a tyre file (``tyre = "my.tir"``) is relative to the
    folder of the car file, in a mapping to the working directory. A tyre may also be a mapping, as ``Car.data()`` gives
    one that is not packaged.

    ``changes`` set keys of the car that ``name`` gives: ``{"column.K_tb": 143.0, "tyre": "my.tir"}``.

    ``steering`` asks for a kind of steering, ``column_eps``, ``rack_eps`` or ``steer_by_wire``: a car that has it is
    itself, and a packaged car that has another one is the packaged ``NAME_KIND``, as ``compact_rack_eps`` for
    ``compact``.

    Raises
    ------
    ValueError
        An unknown name (the message lists the known ones); or in a file, with its name and line: a syntax error, an
        unknown or missing key, a value outside its range, values that contradict each other, a tyre file that is
        missing.
    OSError
        A file that cannot be read.

    Warns
    -----
    UnusualCar
        As in :func:`from_data`, with the name of the file and the line.
    """
    if isinstance(name, Car):
        car = name
    elif isinstance(name, Mapping):
        car = from_data(_complete(name, "mapping", Path()))
    elif not isinstance(name, str | PathLike):
        raise ValueError(
            f"vehicle must be a name, a path, a Car or a mapping as a car file, got a {type(name).__name__}"
        )
    else:
        car = _from_file(Path(name)) if _is_file(name) else _packaged_car(fspath(name))
    if steering is not None:
        car = _with_steering(car, steering)
    return _change(*_contents(car), changes) if changes else car


def _with_steering(car: Car, kind: str) -> Car:
    """The car if it has this kind of steering, else its packaged counterpart; ValueError where there is none."""
    if car.kind == one_of("steering", kind, kinds.available()):
        return car
    counterpart = f"{car.name}_{kind}"
    if car.name not in available() or counterpart not in available() or _packaged_car(car.name) is not car:
        there = ", ".join(name for name in available() if _packaged_car(name).kind == kind)
        raise ValueError(
            f"steering={kind!r}: {car.name} has {car.kind}, and no packaged car is its counterpart; give a car that "
            f"has it ({there}), or a car file" + (f" with a section {kind}" if kind in OF_KINDS else "")
        )
    return _packaged_car(counterpart)


def changer(car: Car) -> Callable[[Mapping[str, Any]], Car]:
    """What makes a car with ``changes``, as :func:`load` does, of many of which its contents are read once."""
    known = cache(partial(_contents, car))
    return lambda changes: _change(*known(), changes) if changes else car


def _contents(car: Car) -> tuple[dict[str, Any], list[str]]:
    """The contents of a car, and what is unusual of it."""
    return car.data(), plausible.unusual(car)


def _change(known: Mapping[str, Any], usual_before: Sequence[str], changes: Mapping[str, Any]) -> Car:
    """A car of known contents with other values of some keys, with a warning of what is unusual only since."""
    kind = kinds.kind_of_sections(known)
    data = {key: dict(value) if isinstance(value, dict) else value for key, value in known.items()}
    for name, value in changes.items():
        section, _, key = name.partition(".")
        if name in (*TEXT_KEYS, "assumed", "tyre", "strut"):
            data[name] = value
        elif key and (section in TABLES or (section in OF_KINDS and section == kind)):
            data[section][key] = value
            if section in OF_KINDS and key == "boost" and "assist.boost" not in changes:
                data["assist"].pop("boost", None)  # which is that of the kind at the column
        else:
            sections = (*TABLES, *(name for name in OF_KINDS if name == kind))
            tables = ", ".join(f"{name}.KEY" for name in sections)
            raise ValueError(f"a car has no {name!r}; it has {tables}, {', '.join(TEXT_KEYS)}, assumed, tyre and strut")
    changed = _checked(data)
    for text in plausible.unusual(changed):
        if text not in usual_before:
            warn_once(f"car {changed.name}: {text}", plausible.UnusualCar, stacklevel=3)
    return changed


def _is_file(name: str | PathLike[str]) -> bool:
    return fspath(name).endswith((".toml", ".json"))


@lru_cache
def _packaged_car(name: str) -> Car:
    return from_data(_data(name))


def _data(name: str) -> dict[str, Any]:
    if name not in available():
        raise ValueError(f"vehicle must be a .toml or .json file or one of {', '.join(available())}, got {name!r}")
    data = json.loads((CAR_FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    return _complete(data, name, CAR_FOLDER) if "base" in data else data


def _from_file(path: Path) -> Car:
    text, data = _parse(path)
    try:
        car = _checked(_complete(data, path.stem, path.parent))
    except ValueError as error:
        raise ValueError(f"{path}:{_line(text, str(error))} {error}") from None
    for message in plausible.unusual(car):
        warn_once(f"{path}:{_line(text, message)} {message}", plausible.UnusualCar, stacklevel=3)
    return car


def _parse(path: Path) -> tuple[str, Any]:
    """Text and contents of a file."""
    text = toml.text(path)
    return text, toml.parse_file(path, text, toml.loads if path.suffix == ".toml" else json.loads)


def _complete(given: Any, name: str, folder: Path) -> Any:
    """The contents of a file with what it takes from its base, there its usual name, and the place of its tyre file."""
    data = dict(given) if isinstance(given, Mapping) else given
    if isinstance(data, dict) and "base" not in data and not set(SECTIONS) <= set(data):
        require_known("car", data, ("base", *SECTIONS, *OF_KINDS))
        lacking = ", ".join(key for key in SECTIONS if key not in data)
        raise ValueError(f"car lacks {lacking}; give them, or a base: {', '.join(available())}")
    if isinstance(data, dict) and "base" in data:
        one_of("base", data["base"], available())
        base = _data(data.pop("base"))
        require_known("car", data, ("base", *SECTIONS, *OF_KINDS))
        base = _of_kind(base, {key: value for key, value in data.items() if isinstance(value, dict)})
        sections = {
            key: {**base.get(key, {}), **data[key]} for key in (*TABLES, *OF_KINDS) if isinstance(data.get(key), dict)
        }
        if data.keys() - set(TEXT_KEYS):  # numbers of its own, of which the source of the base says nothing
            base["source"] = f"not told of what the file gives itself; of the rest: {base['source']}"
        data = {**base, "name": name, **data, **sections}
    if isinstance(data, dict) and str(data.get("tyre", "")).endswith(".tir"):
        data["tyre"] = str(folder / data["tyre"])
    return data


def _of_kind(base: dict[str, Any], data: dict[str, Any]) -> dict[str, Any]:
    """The contents of a base without what follows from the kind of steering that a file gives itself."""
    found = dict(base)
    for name in [name for name in OF_KINDS if name in data]:
        replaced = kinds.follows(name) | ({"assist.boost"} if "boost" in data[name] else set())
        for section in {each.partition(".")[0] for each in replaced}:
            found[section] = {key: value for key, value in found[section].items() if f"{section}.{key}" not in replaced}
        for other in OF_KINDS:
            if other != name:
                found.pop(other, None)
    return found


def _line(text: str, message: str) -> str:
    """Number of the line that sets the first key which the message names, with a colon; empty if there is none."""
    for pattern in (r"""\s*["']?(\w+)["']?\s*[=:](?!\s*\{)""", r"""\s*(?:\[|["'])(\w+)"""):  # keys, then sections
        found = [re.match(pattern, line) for line in text.splitlines()]
        lines = {key[1]: i for i, key in reversed(list(enumerate(found, 1))) if key}
        for word in re.findall(r"\w+", message.split(";")[0]):
            if word in lines:
                return f"{lines[word]}:"
    return ""


def every_key(name: str | PathLike[str] | Mapping[str, Any]) -> dict[str, Any]:
    """:meth:`Car.data` of a car that :func:`load` takes by this name, with its errors."""
    return load(name).data()
