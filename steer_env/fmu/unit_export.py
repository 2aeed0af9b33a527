"""Export of a unit: kernels, C layer, description and documentation in one archive."""

import hashlib
import tempfile
import uuid
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from steer_env.fmu import car, description, documentation, link
from steer_env.fmu.c_data import c_data
from steer_env.fmu.object_code import PLATFORMS, module_text, object_code
from steer_env.fmu.part import Part
from steer_env.fmu.processor import processor
from steer_env.fmu.variables import variables
from steer_env.friction import law_of, resolve
from steer_env.vehicle import cars

PARTS = ("car",)
VERSIONS = (2,)
_DATE = (1980, 1, 1, 0, 0, 0)  # of every file in the archive, so that the same export gives the same bytes


def export(
    path: str | Path,
    *,
    part: str = "car",
    friction: Any = "lugre",
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
    part : {"car"}
        What the unit contains.
    friction : str, mapping or parameters
        A friction law as :func:`steer_env.friction.resolve` takes it.
    vehicle : str, path or mapping
        A car as :func:`steer_env.vehicle.cars.load` takes it.
    chassis : str
        A name of :func:`steer_env.vehicle.chassis.available`.
    speed : float
        Held speed [m/s], for which the unit is made.
    robot : bool
        Start value of the parameter ``robot``: whether the handwheel angle is prescribed, and not the hand torque.
    road_friction : float
        Friction of the road over that of the tyre measurements [1].
    platforms : sequence of {"linux64", "win64"}
        Platforms to include binaries for.
    fmi : {2}
        Version of FMI.
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
        A bad value, a missing compiler or a missing package; the message tells what to do.
    """
    target = Path(path)
    if target.suffix != ".fmu":
        raise ValueError(f"the file of a unit must end with .fmu, got {target}")
    for name, value, allowed in (("part", part, PARTS), ("fmi", fmi, VERSIONS)):
        if value not in allowed:
            raise ValueError(f"{name} must be one of {', '.join(map(str, allowed))}, got {value!r}")
    wanted = tuple(dict.fromkeys(platforms))
    for platform in wanted:
        if platform not in PLATFORMS:
            raise ValueError(f"platform must be one of {', '.join(PLATFORMS)}, got {platform!r}")
        link.compiler(platform)
    if not wanted:
        raise ValueError(f"a unit needs a platform: {', '.join(PLATFORMS)}")
    link.headers()
    law = resolve(friction)
    loaded = cars.load(vehicle)
    p = loaded.plant(law, speed, robot, road_friction, chassis)
    told = (
        f"Car {loaded.name}, friction law {law_of(law).name}, chassis {chassis}, held speed {speed:.6g} m/s, "
        f"processor level {cpu}."
    )
    _write(target, car.part(p), f"steer_{part}_{law_of(law).name}", told, wanted, fmi, cpu)
    return target


def _write(
    target: Path, part: Part, identifier: str, told: str, platforms: Sequence[str], version: int, cpu: str
) -> None:
    level, listed = processor(cpu), variables(part)
    module = module_text(
        part.advance, part.parameters, part.start.size, part.given_size, part.inputs, len(part.outputs)
    )
    objects = {platform: object_code(module, platform, level) for platform in platforms}
    parts = (c_data(part, listed, level, ""), told, *(code.hex() for code in objects.values()))
    token = f"{{{uuid.UUID(hashlib.sha256(' '.join(parts).encode()).hexdigest()[:32])}}}"
    data = c_data(part, listed, level, token)
    text = description.fmi2(part, listed, identifier, token, told)
    files: dict[str, bytes] = {
        "modelDescription.xml": text.encode(),
        "model.png": documentation.icon(),
        "documentation/index.html": documentation.page(part, listed, level, told).encode(),
    }
    for platform, code in objects.items():
        with tempfile.TemporaryDirectory() as folder:
            binary = link.link(platform, version, data, code, identifier, Path(folder))
            files[f"binaries/{platform}/{binary.name}"] = binary.read_bytes()
    target.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, contents in files.items():
            archive.writestr(zipfile.ZipInfo(name, _DATE), contents, zipfile.ZIP_DEFLATED)
