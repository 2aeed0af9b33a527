"""``modelDescription.xml`` of an FMU, for FMI 2.0 and 3.0.

The outputs depend on no input at a communication point: a new input acts from the next step on, so that an importer
finds no algebraic loop. Sources: Functional Mock-up Interface 2.0.4, section 2.2 and 4.3, and 3.0.2, section 2.4 and
4.3.
"""

import re
from importlib import metadata
from typing import Any
from xml.etree import ElementTree

from steer_env.connect.fmu.variables import Variable
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.subsystems import Subsystem

# Unit -> powers of the base units.
_KNOWN: dict[str, dict[str, int]] = {
    "1": {},
    "kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "Hz": {"s": -1},
    "K": {"K": 1},
}


def base_unit(unit: str) -> dict[str, int] | None:
    """Powers of the base units in a unit such as ``"N m s/rad"`` or ``"m/s2"``; None where a part of it is unknown.

    Parameters
    ----------
    unit : str
        Products with spaces, powers as digits behind a symbol, and at most one stroke, behind which everything divides.
    """
    powers: dict[str, int] = {}
    over, _, under = unit.partition("/")
    for text, sign in ((over, 1), (under.strip("() "), -1)):
        for word in text.split():
            match = re.fullmatch(r"([A-Za-z]+|1)(\d?)", word)
            if match is None or match[1] not in _KNOWN:
                return None
            for base, power in _KNOWN[match[1]].items():
                powers[base] = powers.get(base, 0) + sign * power * int(match[2] or 1)
    return {base: power for base, power in powers.items() if power}


STEP_NOTE = (
    "The internal step is 1 ms. A communication step is a whole number of milliseconds, to 1e-9 s. Inputs hold over a "
    "communication step; a prescribed handwheel angle is reached at its end."
)
USES: dict[str, dict[str, str]] = {
    "INPUT": {"causality": "input", "variability": "continuous"},  # whose start value is always exact
    "OUTPUT": {"causality": "output", "variability": "continuous", "initial": "calculated"},
    "FIXED": {"causality": "parameter", "variability": "fixed", "initial": "exact"},
    "TUNABLE": {"causality": "parameter", "variability": "tunable", "initial": "exact"},
    "INDEPENDENT": {"causality": "independent", "variability": "continuous"},
}


def text_of(root: ElementTree.Element) -> bytes:
    """An XML file."""
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text


def number(value: float) -> str:
    """A float without loss."""
    return repr(float(value))


def unit_definitions(root: ElementTree.Element, variables: list[Variable]) -> None:
    """The units of the variables, in terms of SI where all parts of a unit are known."""
    units = sorted({v.unit for v in variables if v.unit})
    if units:
        parent = ElementTree.SubElement(root, "UnitDefinitions")
    for name in units:
        powers = base_unit(name)
        each = ElementTree.SubElement(parent, "Unit", name=name)
        if powers is not None:
            ElementTree.SubElement(each, "BaseUnit", {base: str(power) for base, power in powers.items()})


def about(subsystem: Subsystem, description: str, token_name: str, token: str) -> dict[str, str]:
    """Attributes of the description that both versions have."""
    return {
        "modelName": f"steer-env {subsystem.name}",
        token_name: token,
        "description": f"{subsystem.title}. {description} {STEP_NOTE}",
        "version": metadata.version("steer-env"),
        "license": "MIT",
        "generationTool": f"steer-env {metadata.version('steer-env')}",
        "variableNamingConvention": "structured",
    }


def experiment(root: ElementTree.Element) -> None:
    """The default experiment: ten seconds in steps of a millisecond."""
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0.0", stopTime="10.0", stepSize=number(SAMPLE_TIME))


def fmi2(subsystem: Subsystem, variables: list[Variable], identifier: str, token: str, description: str) -> bytes:
    """The description of a unit.

    Parameters
    ----------
    subsystem : Subsystem
    variables : list of Variable
        Whose position is the value reference.
    identifier : str
        Name of the binary without suffix, a C identifier.
    token : str
        The GUID, which binary and description share.
    description : str
        Sentences that tell the car, the friction law and the chassis.
    """
    root = ElementTree.Element(
        "fmiModelDescription", {"fmiVersion": "2.0", **about(subsystem, description, "guid", token)}
    )
    capabilities: dict[str, Any] = {
        "modelIdentifier": identifier,
        "canHandleVariableCommunicationStepSize": "true",
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
    }
    ElementTree.SubElement(root, "CoSimulation", capabilities)
    unit_definitions(root, variables)
    ElementTree.SubElement(
        ElementTree.SubElement(root, "LogCategories"), "Category", name="logStatusError", description="Errors"
    )
    experiment(root)
    listed = ElementTree.SubElement(root, "ModelVariables")
    for reference, v in enumerate(variables):
        about_it = {"name": v.name, "valueReference": str(reference), "description": v.description, **USES[v.use]}
        each = ElementTree.SubElement(listed, "ScalarVariable", about_it)
        if v.boolean:
            ElementTree.SubElement(each, "Boolean", start="true" if v.start else "false")
            continue
        real = {"unit": v.unit} if v.unit else {}
        if v.not_negative:
            real["min"] = number(0.0)
        if v.use != "OUTPUT":
            real["start"] = number(v.start)
        ElementTree.SubElement(each, "Real", real)
    structure = ElementTree.SubElement(root, "ModelStructure")
    results = [str(i) for i, v in enumerate(variables, 1) if v.use == "OUTPUT"]
    for name, attributes in (("Outputs", {"dependencies": ""}), ("InitialUnknowns", {})):
        parent = ElementTree.SubElement(structure, name)
        for index in results:
            ElementTree.SubElement(parent, "Unknown", {"index": index, **attributes})
    return text_of(root)


def fmi3(subsystem: Subsystem, variables: list[Variable], identifier: str, token: str, description: str) -> bytes:
    """The description of a unit; the arguments are those of :func:`steer_env.connect.fmu.description.fmi2`."""
    about_unit = about(subsystem, description, "instantiationToken", token)
    root = ElementTree.Element("fmiModelDescription", {"fmiVersion": "3.0", **about_unit})
    capabilities = {
        "modelIdentifier": identifier,
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "canHandleVariableCommunicationStepSize": "true",
        "fixedInternalStepSize": number(SAMPLE_TIME),
    }
    ElementTree.SubElement(root, "CoSimulation", capabilities)
    unit_definitions(root, variables)
    categories = ElementTree.SubElement(root, "LogCategories")
    ElementTree.SubElement(categories, "Category", name="logStatusError", description="Errors")
    experiment(root)
    listed = ElementTree.SubElement(root, "ModelVariables")
    for i, v in enumerate(variables):
        attributes = {"name": v.name, "valueReference": str(i), "description": v.description, **USES[v.use]}
        if v.unit:
            attributes["unit"] = v.unit
        if v.not_negative:
            attributes["min"] = number(0.0)
        if v.boolean:
            attributes["start"] = "true" if v.start else "false"
        elif v.use not in ("OUTPUT", "INDEPENDENT"):
            attributes["start"] = number(v.start)
        ElementTree.SubElement(listed, "Boolean" if v.boolean else "Float64", attributes)
    structure = ElementTree.SubElement(root, "ModelStructure")
    results = [str(i) for i, v in enumerate(variables) if v.use == "OUTPUT"]
    for name, more in (("Output", {"dependencies": ""}), ("InitialUnknown", {})):
        for reference in results:
            ElementTree.SubElement(structure, name, {"valueReference": reference, **more})
    return text_of(root)
