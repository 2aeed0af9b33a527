"""Where numbers come from: versions, machine, parameters, all as plain JSON."""

import hashlib
import inspect
import json
import os
import platform
import re
import sys
from datetime import datetime, timezone
from importlib import metadata
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

import steer_env
from steer_env import experiments, friction, vehicle
from steer_env.friction import defaults
from steer_env.friction.law import law_of
from steer_env.vehicle.cars import Car

PACKAGES = ("numpy", "numba", "llvmlite", "scipy", "control", "gymnasium", "matplotlib", "jinja2", "rich")

# Of the numbers in a car's data file: unit -> names.
_NAMES = {
    "kg": "mass sprung_mass front_unsprung_mass",
    "kg m2": "roll_inertia yaw_inertia pitch_inertia wheel_inertia",
    "m": "length width front_axle rear_axle sprung_height front_track rear_track rear_roll_centre pinion_radius"
    " rack_limit front_bump_clearance rear_bump_clearance",
    "m2": "drag_area front_lift_area rear_lift_area",
    "s": "compliance_time speed_hold_time",
    "N/m": "front_spring rear_spring bump_stiffness",
    "N s/m": "front_damper rear_damper",
    "N m/rad": "front_anti_roll rear_anti_roll compliance",
    "rad/m": "rear_bump_steer rear_camber_gain",
    "rad/N": "rear_lateral_compliance",
    "1": "friction_load",
}
UNITS = {name: unit for unit, names in _NAMES.items() for name in names.split()}


def versions() -> dict[str, Any]:
    """Version of the project and a digest of its sources, of Python and the packages; machine and date."""
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


def _digest_of_sources() -> str:
    """Short digest of every source and data file, whatever version control there is."""
    digest = hashlib.sha256()
    for package in (friction, vehicle, steer_env, experiments):
        root = Path(package.__file__ or "").parent
        for file in sorted(path for path in root.rglob("*") if path.suffix in {".py", ".json", ".j2", ".css"}):
            digest.update(f"{root.name}/{file.relative_to(root).as_posix()}\0".encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor() or platform.machine()
    found = re.search(r"^model name\s*:\s*(.+)$", text, re.MULTILINE)
    return found.group(1) if found else platform.machine()


def parameters(p: Any) -> dict[str, dict[str, Any]]:
    """Every field of a NamedTuple of parameters with its value and the comment that declares it (meaning and unit)."""
    comments = dict(re.findall(r"^ +(\w+): [^#\n]+#\s*(.+)$", inspect.getsource(type(p)), re.MULTILINE))
    return {name: {"value": _plain(value), "meaning": comments.get(name, "")} for name, value in p._asdict().items()}


def calibration() -> dict[str, Any]:
    """The calibration that the laws' defaults share: its source, and every value with what it rests on."""
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
        "parameters": parameters(p),
    }


def car(c: Car) -> dict[str, Any]:
    """Source, what is assumed, and the parameters of a packaged car, SI."""
    data = json.loads(files(vehicle).joinpath("data", "cars", f"{c.name}.json").read_text(encoding="utf-8"))
    return {
        "name": c.name,
        "description": c.description,
        "source": c.source,
        "assumed": data["assumed"],
        "chassis": _with_units(c.chassis),
        "steering": _with_units(c.steering),
        "column": parameters(c.column),
        "assist": parameters(c.assist),
    }


def _with_units(values: dict[str, float]) -> dict[str, dict[str, Any]]:
    return {name: {"value": value, "unit": UNITS[name]} for name, value in values.items()}


def _prose(module: Any) -> str:
    return (inspect.getdoc(module) or "").replace("``", "")


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value
