"""The file of a friction law that a record was fitted with, ``friction="fitted.json"``: how it is read.

    {"friction": {"law": "lugre", "F_c": 0.93, ...}, "units": {"displacement": "rad", "torque": "N m"}, ...}

The law stands under ``friction``, or alone as the mapping ``{"law": ...}``; in its place may stand a mapping of sites,
``{"upper_column": {"law": ...}, ...}``. Everything else is about the fit and is
left to its reader; ``units`` are those of the record, and a law of other units is refused.
"""

import json
import os
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from steer_env.friction.numerics import toml
from steer_env.friction.numerics.check import number

SUFFIX = ".json"
UNITS = {"displacement": "rad", "torque": "N m"}  # of every law that drives a plant


def is_file_name(friction: Any) -> bool:
    """Whether a form of a friction law is the name of such a file."""
    return isinstance(friction, str | os.PathLike) and os.fspath(friction).endswith(SUFFIX)


def read(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The mapping of the law that a file holds, ``{"law": name, parameter: value}``, or of sites with such mappings.

    Warns of a level by load, direction or position, which is of the plant, and of one that the record did not
    determine.

    Raises
    ------
    ValueError
        If the file cannot be read, holds no law, or one of other units than rad and N m; with the file and the remedy.
    """
    data, law = _contents(path)
    units = {**UNITS, **_mapping(path, data, "units")}
    if {name: units[name] for name in UNITS} != UNITS:
        raise ValueError(
            f"{path} is of a record in {units['displacement']} and {units['torque']}, and a steering column needs rad "
            "and N m: fit it again with --lever METRES (the radius at which the force acts) or --to-column (the level "
            "and the pre-sliding distance of a column)"
        )
    level = {name: number(f"level.{name} of {path}", value) for name, value in _mapping(path, data, "level").items()}
    shape = () if level.get("position") else ("order", "peak")  # without effect
    level = {name: value for name, value in level.items() if value and name not in shape}
    if level:
        told = ", ".join(f"{name} {value:g}" for name, value in level.items())
        keys = ", ".join(f"steering.friction_{name}" for name in level)
        warnings.warn(
            f"{path}: the level of this friction ({told}) is of the car and not of the law: set {keys} in the car",
            stacklevel=2,
        )
    undetermined = data.get("undetermined") or ()
    if not isinstance(undetermined, list | tuple):
        raise ValueError(f"{path}: undetermined must be a list of parameters, got {undetermined!r}")
    unsure = _undetermined_levels(law, undetermined)
    if unsure:
        warnings.warn(
            f"{path}: the record does not determine the level of this friction ({', '.join(unsure)}), which may be far "
            "from what was measured: fit a record of several speeds and wider loops, or another law",
            stacklevel=2,
        )
    return dict(law)


def of_sites(path: str | os.PathLike[str]) -> bool:
    """Whether a file holds a mapping of sites, and not one law; ValueError as of :func:`read` for no file of a law."""
    return "law" not in _contents(path)[1]


def _contents(path: str | os.PathLike[str]) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """All that a file holds, and its law or sites."""
    try:
        data = toml.read(path, json.loads)
    except OSError as error:
        raise ValueError(
            f"{path}: {error.strerror}: friction takes a file that 'steer-env fit-friction' wrote"
        ) from None
    law = data.get("friction", data) if isinstance(data, Mapping) else None
    given = law if isinstance(law, Mapping) else {}
    held = [given] if "law" in given else [*given.values()]
    if not (held and all(isinstance(each, Mapping) and isinstance(each.get("law"), str) for each in held)):
        example = '{"friction": {"law": "lugre", "F_c": 1.2}}'
        raise ValueError(f"{path} holds no friction law: it must be a mapping as {example}")
    return data, given


def _mapping(path: Any, data: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """What stands under a key of the file, which may be left out or null; ValueError if it is no mapping."""
    value = data.get(key) or {}
    if not isinstance(value, Mapping):
        raise ValueError(f"{path}: {key} must be a mapping as 'steer-env fit-friction' writes it, got {value!r}")
    return value


def _undetermined_levels(law: Mapping[str, Any], undetermined: Sequence[str]) -> list[str]:
    """What the record leaves open of the saturated torque; a break-away that equals the sliding torque is neutral."""
    names = [name for name in ("F_c", "F_s") if name in undetermined and name in law]
    return [f"{name} {law[name]} N m" for name in names if name == "F_c" or law[name] != law.get("F_c")]
