"""A small vehicle of somebody else as a unit (FMU), whole or with a fault, and a mapping for it."""

import subprocess
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import fmpy

# Name -> causality, variability, unit; the position is the value reference.
VARIABLES = {
    "Rack.q": ("input", "continuous", "mm"),
    "Init.speed": ("parameter", "fixed", "km/h"),
    "breaks": ("parameter", "fixed", "s"),
    "ends": ("parameter", "fixed", "s"),
    "Rack.force": ("output", "continuous", "kN"),
    "Body.ay": ("output", "continuous", "g"),
    "Body.yaw": ("output", "continuous", None),
    "Body.v": ("output", "continuous", "km/h"),
    "Body.x": ("output", "continuous", "m"),
}
MAPPING = """
fmu = "foreign.fmu"
[inputs]
rack_travel = {variable = "Rack.q", sign = -1}
start_speed = {variable = "Init.speed"}
[outputs]
rack_force = {variable = "Rack.force", sign = -1}
lateral_acceleration = {variable = "Body.ay"}
yaw_rate = {variable = "Body.yaw", unit = "deg/s"}
vehicle_speed = {variable = "Body.v"}
x = {variable = "Body.x"}
"""
BINARY = f"binaries/{fmpy.platform}/foreign{fmpy.sharedLibraryExtension}"


def library(folder: Path) -> bytes:
    """The compiled unit."""
    include = f"-I{Path(fmpy.__file__).parent / 'c-code'}"
    source, out = Path(__file__).with_name("foreign.c"), folder / "foreign.so"
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", include, source, "-o", out, "-lm"], check=True)
    return out.read_bytes()


def description(version: str = "2.0", kind: str = "CoSimulation", identifier: str = "foreign") -> str:
    """``modelDescription.xml``."""
    root = ElementTree.Element("fmiModelDescription", fmiVersion=version, modelName="foreign", guid="1")
    ElementTree.SubElement(root, kind, modelIdentifier=identifier)
    units, variables, structure = (
        ElementTree.SubElement(root, name) for name in ("UnitDefinitions", "ModelVariables", "ModelStructure")
    )
    for unit in dict.fromkeys(unit for *_, unit in VARIABLES.values() if unit):
        ElementTree.SubElement(units, "Unit", name=unit)
    outputs = ElementTree.SubElement(structure, "Outputs")
    for i, (name, (causality, variability, unit)) in enumerate(VARIABLES.items()):
        about = {"name": name, "valueReference": str(i), "causality": causality, "variability": variability}
        each = ElementTree.SubElement(variables, "ScalarVariable", about)
        real = ElementTree.SubElement(each, "Real", {"unit": unit} if unit else {})
        if causality == "output":
            ElementTree.SubElement(outputs, "Unknown", index=str(i + 1))
        else:
            real.set("start", "0")
    return ElementTree.tostring(root, encoding="unicode")


def write(folder: Path, files: dict[str, bytes | str]) -> Path:
    """A unit of these files, with its mapping beside it; the path of the mapping."""
    with zipfile.ZipFile(folder / "foreign.fmu", "w") as archive:
        for name, contents in files.items():
            archive.writestr(name, contents)
    (folder / "vehicle.toml").write_text(MAPPING, encoding="utf-8")
    return folder / "vehicle.toml"
