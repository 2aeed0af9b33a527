"""Provenance of results as JSON: versions, machine, parameters."""

import hashlib
import inspect
import json
import os
import platform
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import datetime, timezone
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

import steer_env
from steer_env import experiments, friction, vehicle
from steer_env.friction import defaults
from steer_env.friction.law import law_of
from steer_env.friction.sites import Sites, as_mapping
from steer_env.vehicle.cars import Car, declared_keys
from steer_env.vehicle.steering import motor
from steer_env.vehicle.steering.assist import functions
from steer_env.vehicle.steering.eps import SAMPLE_TIME

PACKAGES = ("numpy", "numba", "llvmlite", "scipy", "control", "gymnasium", "matplotlib", "jinja2", "rich")

SOURCES = frozenset({".py", ".pyi", ".json", ".toml", ".tir", ".npz", ".gz", ".j2", ".css"})  # of sources, data


def versions() -> dict[str, Any]:
    """Versions of the project (with a digest of its sources), of Python and of the packages; machine and date."""
    return {
        "version": metadata.version("steer-env"),
        "sources": _digest_of_sources(),
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "packages": {name: metadata.version(name) for name in PACKAGES},
        "random_numbers": "none: every run is deterministic",
    }


def trace(
    *,
    command: Sequence[str] | None = None,
    result: str | None = None,
    car: Car | None = None,
    friction: Mapping[str, Any] | None = None,
    inputs: Sequence[Mapping[str, str]] = (),
    mapping: Any = None,
    seed: int | None = None,
) -> dict[str, Any]:
    """What a result was made from, so that it can be read off and made again: the record ``trace`` of a result file.

    It holds text, numbers, lists and mappings only, and nothing that differs from one run to the next.

    Parameters
    ----------
    command : sequence of str, optional
        The words of the command line after ``steer-env``; without it the result cannot be run again by itself.
    result : str, optional
        Name of the file or of the directory that the command writes.
    car : Car, optional
        With its data, and the digests of its tyre and its strut.
    friction : mapping, optional
        Label -> parameters of a friction law.
    inputs : sequence of mapping
        Of :func:`input_file`.
    mapping : optional
        What a measurement was read through, as text, numbers, lists and mappings.
    seed : int, optional
    """
    found = {
        "version": metadata.version("steer-env"),
        "sources": _digest_of_sources(),
        "packages": {name: metadata.version(name) for name in PACKAGES},
        "command": None if command is None else list(command),
        "result": result,
        "friction": friction and {label: _law_in_short(p) for label, p in friction.items()},
        "inputs": [dict(each) for each in inputs] or None,
        "mapping": mapping,
        "seed": seed,
    }
    if car is not None:
        strut = [sorted(car.strut.points.items()), car.strut.loaded_radius]
        found |= {
            "car": car.data(),
            "tyre": {"name": car.tyre.name, "sha256": digest(asdict(car.tyre))},
            "strut": {"name": car.given["strut"], "sha256": digest(strut)},
        }
    return {key: value for key, value in found.items() if value is not None}


def input_file(name: str, content: bool = False) -> dict[str, str]:
    """Name of an input file as the command line has it, its digest, and with ``content`` its text."""
    raw = Path(name).read_bytes()
    return {
        "name": name,
        "sha256": hashlib.sha256(raw).hexdigest(),
        **({"text": raw.decode("utf-8-sig")} if content else {}),
    }


def digest(value: Any) -> str:
    """SHA-256 of numbers and text, by their JSON."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def _law_in_short(p: Any) -> dict[str, Any]:
    """Name of a friction law, and its parameters; of sites the mapping that gives them."""
    if isinstance(p, Sites):
        return {"sites": as_mapping(p)}
    return {"law": law_of(p).name, "parameters": {name: _plain(value) for name, value in p._asdict().items()}}


def friction_from_trace(short: Mapping[str, Any]) -> dict[str, Any]:
    """A friction of a trace in a form that ``friction.resolve`` takes; KeyError for one that is none."""
    return short["sites"] if "sites" in short else {"law": short["law"], **short["parameters"]}


@lru_cache
def _digest_of_sources() -> str:
    """Short digest of all source and data files, which does not depend on version control.

    It is the same in a checkout, where three packages are linked folders, and in an installed package.
    """
    digest = hashlib.sha256()
    for name, file in sorted(source_files().items()):
        digest.update(f"{name}\0".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def source_files() -> dict[str, Path]:
    """All source and data files by their path in the package ``steer_env``, each once.

    Each package is listed by itself, as ``Path.rglob`` does not enter linked folders with every version of Python.
    """
    found: dict[str, Path] = {}
    for prefix, package in {
        "": steer_env,
        "friction/": friction,
        "vehicle/": vehicle,
        "experiments/": experiments,
    }.items():
        root = Path(package.__file__ or "").parent
        for file in root.rglob("*"):
            if file.suffix in SOURCES and file.is_file():
                found.setdefault(prefix + file.relative_to(root).as_posix(), file)
    return found


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor() or platform.machine()
    found = re.search(r"^model name\s*:\s*(.+)$", text, re.MULTILINE)
    return found.group(1) if found else platform.machine()


def parameter_fields(p: Any) -> dict[str, dict[str, Any]]:
    """Every field of a NamedTuple of parameters with its value, and the comment beside it (meaning and unit).

    A field that holds such parameters itself is taken apart: ``level.load``.
    """
    comments = dict(re.findall(r"^ +(\w+): [^#\n]+#\s*(.+)$", inspect.getsource(type(p)), re.MULTILINE))
    found: dict[str, dict[str, Any]] = {}
    for name, value in p._asdict().items():
        if hasattr(value, "_fields"):
            found |= {f"{name}.{key}": about for key, about in parameter_fields(value).items()}
        else:
            found[name] = {"value": _plain(value), "meaning": comments.get(name, "")}
    return found


def calibration() -> dict[str, Any]:
    """The calibration that the defaults of the laws share: its source, and every value with its basis."""
    comments = re.findall(r"^([A-Z]\w*) = [^#\n]+#\s*(.+)$", inspect.getsource(defaults), re.MULTILINE)
    return {
        "source": _prose(defaults),
        "values": {name: {"value": getattr(defaults, name), "meaning": text} for name, text in comments},
    }


def law(p: Any) -> dict[str, Any]:
    """Name, definition and parameters of a friction law."""
    return {
        "law": law_of(p).name,
        "definition": _prose(sys.modules[type(p).__module__]),
        "parameters": parameter_fields(p),
    }


def car(c: Car) -> dict[str, Any]:
    """Source, assumptions and parameters of a car, SI."""
    keys, own = declared_keys()["assist"], functions.keys(c.assist.functions, SAMPLE_TIME) | motor.keys(c.assist.motor)
    assist = {name: about for name, about in parameter_fields(c.assist).items() if name not in ("functions", "motor")}
    for name, value in own.items():
        assist[name] = {"value": _plain(value), "meaning": f"{keys[name].meaning} [{keys[name].unit}]"}
    return {
        "name": c.name,
        "description": c.description,
        "source": c.source,
        "assumed": list(c.given["assumed"]),
        "chassis": _with_units("chassis", c.chassis),
        "steering": _with_units("steering", c.steering),
        **({c.kind: _with_units(c.kind, c.given[c.kind])} if c.kind in c.given else {}),
        "column": parameter_fields(c.column),
        "assist": assist,
    }


def _with_units(section: str, values: dict[str, float]) -> dict[str, dict[str, Any]]:
    keys = declared_keys()[section]
    return {name: {"value": value, "unit": keys[name].unit} for name, value in values.items()}


def _prose(module: Any) -> str:
    """The docstring of a module without marks: a role as :mod:`a.b.name` is the name."""
    text = (inspect.getdoc(module) or "").replace("``", "")
    return re.sub(r":\w+:`~?(?:[^`]*\.)?([^`.]+)`", lambda found: found[1].replace("_", " "), text)


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value
