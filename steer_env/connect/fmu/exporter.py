"""Export of a unit: kernels, C layer, description and documentation in one archive."""

import hashlib
import io
import json
import math
import re
import tempfile
import uuid
import zipfile
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from steer_env.connect.fmu import binary, description
from steer_env.connect.fmu.description import STEP_NOTE
from steer_env.connect.fmu.object_code import PLATFORMS, SOURCE, Processor, module_text, object_code, processor
from steer_env.connect.variables import Variable, variables, with_road
from steer_env.friction.numerics.check import one_of
from steer_env.friction.sites import as_mapping, friction_name
from steer_env.vehicle import cars, subsystems
from steer_env.vehicle.subsystems import Subsystem
from steer_env.vehicle.subsystems.poses import with_poses

VERSIONS = (2, 3)
ICONS = {2: "model.png", 3: "terminalsAndIcons/icon.png"}
# Of every file in the archive. The same export gives the same bytes, but for the date in the description, which
# SOURCE_DATE_EPOCH sets.
_DATE = (1980, 1, 1, 0, 0, 0)


def export(
    path: str | Path,
    *,
    subsystem: str = "car",
    friction: Any = None,
    vehicle: Any = "compact",
    chassis: str = "single_track",
    speed: float = 100.0 / 3.6,
    robot: bool = False,
    road_friction: float = 1.0,
    platforms: Sequence[str] = ("linux64",),
    fmi: int = 2,
    cpu: str = "x86-64-v3",
) -> Path:
    """Write a co-simulation unit (FMU) that needs no Python where it runs.

    Parameters
    ----------
    path : str or Path
        File to write, ending with ``.fmu``.
    subsystem : {"car", "steering", "chassis"}
        What the unit contains.
    friction : str, mapping or parameters
        A friction law, or sites, as :func:`steer_env.friction.resolve` takes them; the chassis alone has none.
    vehicle : str, path, mapping or Car
        A car, or what makes one, as :func:`steer_env.vehicle.cars.load` takes it.
    chassis : str
        A name of :func:`steer_env.vehicle.chassis.available`; the steering alone has none.
    speed : float
        Start value of the held speed [m/s], which can be set; of the steering alone that of the vehicle's speed.
    robot : bool
        Start value of the parameter ``robot``: whether the handwheel angle is prescribed, and not the hand torque.
    road_friction : float
        Friction of the road over that of the tyre measurements [1].
    platforms : sequence of {"linux64", "win64", "aarch64", "macos", "source"}
        Platforms to include binaries for; ``"source"`` includes C sources, which gcc or clang compiles for Linux on
        x86-64 and ARM.
    fmi : {2, 3}
        Version of FMI, 2.0 or 3.0.
    cpu : str
        Least processor of the machine that runs the unit: ``"x86-64-v3"``, another level of x86-64, or ``"native"`` for
        that of this machine.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ValueError
        A bad value, also of SOURCE_DATE_EPOCH, a missing compiler or package; the message tells what to do.
    """
    wanted = _checked(Path(path), subsystem, fmi, platforms)
    loaded = vehicle if isinstance(vehicle, cars.Car) else cars.load(vehicle)
    p = loaded.plant(friction, speed, robot, road_friction, chassis)
    name, rolls = friction_name(p.friction), f"chassis {chassis}, held speed {speed:.6g} m/s"
    contents, label = {
        "car": (f"friction law {name}, {rolls}", name),
        "steering": (f"friction law {name}", name),
        "chassis": (rolls, chassis),
    }[subsystem]
    told = f"Car {loaded.name}, {contents}; processor level {cpu}."
    made = with_poses(with_road(subsystems.make(subsystem, p, speed)))
    files = _files(made, re.sub(r"\W", "_", f"steer_{subsystem}_{label}"), told, wanted, fmi, processor(cpu))
    made_of = {
        **{"part": subsystem, "chassis": chassis, "speed_m_s": speed, "robot": robot, "road_friction": road_friction},
        **{"friction": as_mapping(p.friction), "car": loaded.data()},
    }
    files["resources/made_of.json"] = json.dumps(made_of, indent=1).encode()
    _pack(Path(path), files)
    return Path(path)


def _checked(path: Path, subsystem: str, fmi: int, platforms: Sequence[str]) -> tuple[str, ...]:
    """The platforms, each once, after a look at what else may be wrong before long work begins."""
    if path.suffix != ".fmu":
        raise ValueError(f"the file of a unit must end with .fmu, got {path}")
    for name, value, allowed in (("subsystem", subsystem, subsystems.SUBSYSTEMS), ("fmi", fmi, VERSIONS)):
        one_of(name, value, allowed)
    for platform in platforms:
        one_of("platform", platform, (*PLATFORMS, SOURCE))
        binary.compiler(platform)
    if fmi == 2 and {"linux64", "aarch64"} <= set(platforms):
        raise ValueError("FMI 2.0 has one folder for Linux, linux64: export one unit for each processor, or FMI 3.0")
    if not platforms:
        raise ValueError(f"a unit needs a platform: {', '.join((*PLATFORMS, SOURCE))}")
    binary.headers()
    return tuple(dict.fromkeys(platforms))


def _pack(path: Path, files: dict[str, bytes]) -> None:
    """Write an archive at once, so that nothing half-written stays."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, contents in files.items():
            packed.writestr(zipfile.ZipInfo(name, _DATE), contents, zipfile.ZIP_DEFLATED)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(archive.getvalue())


def _files(
    subsystem: Subsystem, identifier: str, told: str, platforms: Sequence[str], version: int, level: Processor
) -> dict[str, bytes]:
    """Contents of the archive by path: description, icon, documentation, binaries, sources; no ``made_of.json``."""
    listed = variables(subsystem, version)
    module = module_text(subsystem)
    objects = {platform: object_code(module, platform, level) for platform in platforms if platform != SOURCE}
    kernels = binary.c_kernels(module, level) if SOURCE in platforms else ""
    texts = [file.read_text(encoding="utf-8") for file in sorted(binary.SOURCES.iterdir())]
    parts = (
        binary.c_data(subsystem, listed, level, ""),
        told,
        *texts,
        str(version),
        *(code.hex() for code in objects.values()),
        kernels,
    )
    token = f"{{{uuid.UUID(hashlib.sha256(' '.join(parts).encode()).hexdigest()[:32])}}}"
    data = binary.c_data(subsystem, listed, level, token)
    sources = binary.sources(version, data, kernels) if kernels else {}
    compiled = [name for name in sources if name.endswith(".c")]
    if version == 2:
        text = description.fmi2(subsystem, listed, identifier, token, told, compiled)
    else:
        text = description.fmi3(subsystem, listed, identifier, token, told)
        if sources:
            sources["buildDescription.xml"] = description.build_description(identifier, compiled)
    files: dict[str, bytes] = {
        "modelDescription.xml": text,
        ICONS[version]: _icon(),
        **({"terminalsAndIcons/terminalsAndIcons.xml": description.terminals(listed)} if version == 3 else {}),
        "documentation/index.html": _page(subsystem, listed, level, told).encode(),
        **{f"sources/{name}": contents for name, contents in sources.items()},
    }
    for platform, code in objects.items():
        with tempfile.TemporaryDirectory() as folder:
            linked = binary.link(platform, version, data, code, identifier, Path(folder))
            files[f"binaries/{PLATFORMS[platform].folders[version]}/{linked.name}"] = linked.read_bytes()
    return files


_GROUPS = {
    "Inputs": "INPUT",
    "Outputs": "OUTPUT",
    "Tunable parameters": "TUNABLE",
    "Fixed parameters": "FIXED",
    "Independent variable": "INDEPENDENT",
}
_ICON_PIXELS = 100  # of the icon [pixels]


def _page(subsystem: Subsystem, variables: list[Variable], processor: Processor, told: str) -> str:
    """The page as HTML."""
    from jinja2 import Environment, FileSystemLoader

    folder = Path(__file__).parent / "templates"
    listed = {heading: [v for v in variables if v.use == use] for heading, use in _GROUPS.items()}
    return (
        Environment(loader=FileSystemLoader(folder), autoescape=True, trim_blocks=True, lstrip_blocks=True)
        .get_template("index.html")
        .render(
            title=subsystem.title,
            infinity=math.inf,
            told=told,
            step_note=STEP_NOTE,
            processor=processor.name,
            groups=[(heading, group) for heading, group in listed.items() if group],
            version=metadata.version("steer-env"),
        )
    )


def _icon() -> bytes:
    """A handwheel with three spokes, as PNG."""
    from matplotlib.image import imsave

    y, x = np.mgrid[-1.0 : 1.0 : _ICON_PIXELS * 1j, -1.0 : 1.0 : _ICON_PIXELS * 1j]
    radius = np.hypot(x, y)
    rim, hub = np.abs(radius - 0.8) < 0.12, radius < 0.25
    spokes = (radius < 0.8) & ((np.abs(y) < 0.08) | ((np.abs(x) < 0.08) & (y > 0.0)))
    image = np.zeros((_ICON_PIXELS, _ICON_PIXELS, 4))
    image[rim | hub | spokes] = (0.13, 0.29, 0.53, 1.0)
    file = io.BytesIO()
    imsave(file, image, format="png")
    return file.getvalue()
