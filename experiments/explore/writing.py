"""The folder of the page: what Python knows, written as scripts that a page may load from disk.

A page that is opened from disk may not load modules, data files or the file of a worker. Everything is therefore a
classic script: declarations as JSON, and modules and tables in base64, packed by zlib, which browsers unpack.
"""

import base64
import json
import re
import shutil
import sys
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from inspect import getdoc
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import numpy as np

from steer_env.experiments.explore import (
    carrying,
    characteristics,
    drive_page,
    drives,
    module,
    packing,
    parameters,
    policies,
)
from steer_env.experiments.pages import files, provenance
from steer_env.friction import sites
from steer_env.friction.law import LAWS
from steer_env.friction.numerics.check import one_of
from steer_env.friction.numerics.packing import Leaf, leaves, slices
from steer_env.friction.numerics.packing import numbers as packed
from steer_env.metrics.common import just_noticeable
from steer_env.vehicle import cars, plant
from steer_env.vehicle import chassis as chassis_models
from steer_env.vehicle.cars import Car
from steer_env.vehicle.layout import state_size
from steer_env.vehicle.subsystems import car as whole_car
from steer_env.vehicle.subsystems.machine_code import require_compiled

PAGE_FOLDER = Path(__file__).parent / "page"
MODULES = "modules"
CONTENTS = frozenset(
    (*(file.name for file in PAGE_FOLDER.iterdir()), MODULES, policies.FOLDER, "declared.js", "tables.js")
)
LAWS_SHOWN = ("lugre", "masing", "dahl", "coulomb", "viscous")  # by default, after the friction of the car
PINNED_LAWS = ("coulomb", "masing")  # laws that are pinned first, as they differ in small turns
SHARED_TABLE_SIZE = 1000  # numbers from which on a table is written once for all modules
# Parameters on which the stability of the assist's loop depends, and those that hands and friction need.
_NAMED = ("column.", "assist.", "robot", "rack_limit", "pinion_radius", "friction_torque_scale")


@dataclass(frozen=True)
class Combination:
    """A law, or sites as text, on a chassis: one module."""

    law: str
    chassis: str

    @property
    def file(self) -> str:
        """Path of its script in the folder."""
        law = self.law if self.law in LAWS.available() else f"sites_{provenance.digest(self.law)[:12]}"
        return f"{MODULES}/{self.chassis}_{law}.js"


def _beginning(chassis: str) -> str:
    """Path of the script of the module that begins a drive on a chassis."""
    return f"{MODULES}/{chassis}_beginning.js"


def explore(
    folder: str | Path,
    *,
    vehicle: Any = "compact",
    friction: Sequence[Any] | None = None,
    chassis: Sequence[str] = ("single_track", "two_track"),
    notify: Callable[[float, str], None] = lambda part, what: None,
) -> Path:
    """Write a page in which a car and its friction law are changed by sliders while a manoeuvre is redrawn.

    It needs no server and no Python: ``index.html`` opens from disk, and asks the network for nothing.

    Parameters
    ----------
    folder : str or Path
        A new folder, or that of an earlier page, which is replaced.
    vehicle : str, path, mapping or Car
        A car, or what makes one, as :func:`steer_env.vehicle.cars.load` takes it.
    friction : sequence
        Names of friction laws, or several sites in a form of :func:`steer_env.friction.sites.resolve`; the page begins
        with the first. By default the friction of the car, and five laws at one site.
    chassis : sequence of str
        Names of chassis; the page begins with the first.
    notify : callable
        Receives the part of the work that is done, 0 to 1, and what comes next.

    Returns
    -------
    Path
        The file ``index.html``.

    Raises
    ------
    ValueError
        A bad value, kernels that are not compiled, or a missing package; the message tells what to do.
    """
    for body in chassis:
        one_of("chassis", body, chassis_models.available())
    car = cars.load(vehicle)
    laws = [_checked(each) for each in ((car.friction, *LAWS_SHOWN) if friction is None else friction)]
    if not laws or not chassis:
        raise ValueError("the page needs a friction law and a chassis")
    require_compiled("the page")
    files.usable(Path(folder), CONTENTS)
    wanted = [Combination(law, body) for body in dict.fromkeys(chassis) for law in dict.fromkeys(laws)]
    with files.replaced_directory(Path(folder), CONTENTS) as out:
        (out / MODULES).mkdir()
        shared: dict[str, list[float]] = {}
        for k, each in enumerate(wanted):
            notify(k / len(wanted), f"{each.law}, {each.chassis}")
            if not (out / _beginning(each.chassis)).exists():
                p = parameters.plant(car, module.BEGINNING, each.chassis, {})
                _write(out / _beginning(each.chassis), "steerModule", _packed(module.beginning(p)))
            _write(out / each.file, "steerModule", _module(car, each, shared))
        _write(out / "declared.js", "steerDeclared", declared(car, wanted))
        (out / policies.FOLDER).mkdir()
        for env_id in policies.available():
            _write(out / policies.script_path(env_id), "steerModule", _policy(car, env_id))
        _write(out / "tables.js", "steerTables", {name: _packed(values) for name, values in shared.items()})
        for file in PAGE_FOLDER.iterdir():
            shutil.copyfile(file, out / file.name)
    return Path(folder) / "index.html"


def _checked(friction: Any) -> str:
    """The name of a law, or sites as text."""
    if isinstance(friction, str) and "@" not in friction:
        return one_of("friction", friction, LAWS.available())
    if not isinstance(sites.resolve(friction), sites.Sites):
        raise ValueError(f"the page takes a friction law by its name alone, or several sites, got {friction!r}")
    return sites.as_text(friction)


def _write(path: Path, function: str, data: Any) -> None:
    """A script that hands data to a function of the page."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    files.write_text(path, f"{function}({text});\n")


def _packed(values: Iterable[float] | bytes) -> str:
    data = values if isinstance(values, bytes) else np.asarray(values, "<f8").tobytes()
    return base64.b64encode(zlib.compress(data, 9)).decode()


def _module(car: Car, which: Combination, shared: dict[str, list[float]]) -> dict[str, Any]:
    """What the page needs to run a law on a chassis; large tables go to ``shared``."""
    p = parameters.plant(car, which.law, which.chassis, {})
    tables: list[Any] = []
    for leaf in leaves(p):
        if leaf.table:
            values = _floats(leaf)
            if len(values) >= SHARED_TABLE_SIZE:
                name = ".".join(leaf.path)
                if shared.setdefault(name, values) != values:
                    raise ValueError(f"the chassis have different tables {name}")
                tables.append(name)
            else:
                tables.append(values)
    return {
        "structure": structure(car, which),
        "tables": tables,
        "wasm": _packed(module.advancing(p)),
    }


def _policy(car: Car, env_id: str) -> dict[str, Any]:
    """A policy as the page loads it, with the paths of the courses if it follows one."""
    data = policies.described(env_id)
    ways = policies.paths(car) if data["follows"] else {}
    packed_ways = {name: _packed(way.ravel()) for name, way in ways.items()}
    return data | {"weights": _packed(data["weights"].tobytes()), "courses": packed_ways}


def _floats(leaf: Leaf) -> list[float]:
    if np.ndim(leaf.value):
        return np.ascontiguousarray(leaf.value).view(np.float64).ravel().tolist()
    return [float(leaf.value)]


def structure(car: Car, which: Combination) -> dict[str, Any]:
    """Parameters with their fields, packed numbers and how they follow, and sizes of the arrays of a module."""
    fields = parameters.every(car, which.law, which.chassis)
    p = parameters.plant(car, which.law, which.chassis, {})
    subsystem = whole_car.without_start_state(p)

    def numbers_of(values: Mapping[str, float]) -> Any:
        return packed(parameters.plant(car, which.law, which.chassis, values))

    return {
        "law": which.law,
        "chassis": which.chassis,
        "parameters": [_field(each) for each in fields],
        "numbers": packed(p).tolist(),
        "dependences": packing.as_data(packing.dependences(fields, numbers_of)),
        "states": state_size(p),
        "given": subsystem.given_size,
        "inputs": subsystem.inputs,
        "channels": [name for name, _ in plant.channels(p)],
        "zeroStates": list(subsystem.zero_states),
        "zeroOutputs": list(subsystem.zero_outputs),
        "drive": drive_page.of_module(subsystem),
        "memory": module.law_memory_size(p),
        "path": module.SAMPLES,
        "places": {name: [at.start, at.stop] for name, at in slices(p).items() if name.startswith(_NAMED)},
        **_begun(car, which, p),
    }


def _begun(car: Car, which: Combination, p: plant.Plant) -> dict[str, Any]:
    """Which packed numbers are the law's, and those of the law ``BEGINNING`` in their place."""
    own = [place for name, place in slices(p).items() if name.startswith("friction.")]
    other = parameters.plant(car, module.BEGINNING, which.chassis, {}).friction
    return {"ofLaw": [own[0].start, own[-1].stop], "beginning": packed(other).tolist()}


def _field(q: parameters.Parameter) -> dict[str, Any]:
    """A parameter as JSON, which knows no infinity."""
    return {key: None if value in (np.inf, -np.inf) else value for key, value in q._asdict().items()}


def declared(car: Car, wanted: Sequence[Combination]) -> dict[str, Any]:
    """What the page knows of the program: the car, laws and chassis, manoeuvres with metrics, what drivers notice."""
    bodies = tuple(dict.fromkeys(each.chassis for each in wanted))
    return {
        "version": metadata.version("steer-env"),
        "car": {"name": car.name, "description": car.description, **carrying.car_file(car)},
        "files": carrying.files(),
        "laws": [_law(law) for law in dict.fromkeys(each.law for each in wanted)],
        "chassis": list(bodies),
        "modules": {f"{each.law} {each.chassis}": each.file for each in wanted},
        "opening": _opening(wanted),
        "policies": policies.listed(),
        "beginnings": {body: _beginning(body) for body in bodies},
        "speed": {"name": parameters.SPEED_NAME, "unit": parameters.KPH},
        "drives": drives.declared(bodies),
        "characteristics": characteristics.declared(),
        "drive": drive_page.declared(car),
        "recording": carrying.recording_settings(),
        "noticed": {
            "share": just_noticeable.SHARE,
            "least": just_noticeable.LEAST_STIMULUS,
            "sustained": sorted(just_noticeable.SUSTAINED),
            "words": [just_noticeable.PERCEPTIBLE, just_noticeable.IMPERCEPTIBLE, just_noticeable.UNKNOWN],
        },
    }


def _opening(wanted: Sequence[Combination]) -> str:
    """What the page shows where its address names nothing: its first law in small turns, with two others pinned."""
    first, *others = dict.fromkeys(each.law for each in wanted)
    pinned = sorted(others, key=lambda law: law not in PINNED_LAWS)[:2]
    body = {"chassis": wanted[0].chassis}
    pins = {pin: urlencode({"law": law, **body}) for pin, law in zip("AB", pinned)}
    return urlencode({"law": first, **body, "manoeuvre": "small-turns", **pins})


def _law(law: str) -> dict[str, Any]:
    """A law, or sites as text, by its name and label, what it is, and what ``friction=`` takes for it."""
    given = parameters.friction_argument(law)
    if law in LAWS.available():
        return {"name": law, "label": law.replace("_", " "), "about": _law_description(law), "given": given}
    words = {site: site.replace("_", " ") for site in given}
    label = re.sub(r"@(\w+)(\+?)", lambda found: f" at {words[found[1]]}{found[2] and ' + '}", law)
    about = "; ".join(f"{words[site]}: {_law_description(own['law'])}" for site, own in given.items())
    return {"name": law, "label": label, "about": about, "given": given}


def _law_description(law: str) -> str:
    """What the module of a law says of it, in its first line."""
    text = getdoc(sys.modules[LAWS[law].parameters.__module__]) or ""
    return text.splitlines()[0].rstrip(".") if text else law
