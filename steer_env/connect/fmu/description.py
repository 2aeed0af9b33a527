"""``modelDescription.xml`` of an FMU, for FMI 2.0 and 3.0, and the terminals and the build description of FMI 3.0.

The outputs depend on no input at a communication point: a new input acts from the next step on, so that an importer
finds no algebraic loop. Sources: Functional Mock-up Interface 2.0.4, section 2.2 and 4.3, and 3.0.2, section 2.4, 2.6
and 4.3; the names of the quantities are those of the Modelica Standard Library.
"""

import math
import os
import re
from collections.abc import Sequence
from datetime import datetime, timezone
from importlib import metadata
from typing import Any, NamedTuple
from xml.etree import ElementTree

from steer_env.connect.variables import Variable
from steer_env.vehicle.chassis.common.interface import WHEELS
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.subsystems import Subsystem
from steer_env.vehicle.subsystems.chassis import HELD_SPEED

# Unit -> powers of the base units.
_BASE_UNIT_POWERS: dict[str, dict[str, int]] = {
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


AUTHOR = "The steer-env authors"
COPYRIGHT = f"Copyright (c) 2026 {AUTHOR}"
# Unit -> the one in which a driver reads it, and its factor.
DISPLAY = {
    "rad": ("deg", math.degrees(1.0)),
    "rad/s": ("deg/s", math.degrees(1.0)),
    "m/s": ("km/h", 3.6),
    "m": ("mm", 1000.0),
}


class Kind(NamedTuple):
    """A type that variables refer to."""

    name: str
    unit: str
    quantity: str
    nominal: float = 1.0  # usual size [unit]
    displayed: bool = False  # whether in the unit of ``DISPLAY``


_VEHICLE_SPEED = Kind("VehicleSpeed", "m/s", "Velocity", 10.0, True)
_TRAVEL = Kind("Travel", "m", "Length", 0.01, True)
_ROTATION = Kind("RotationalSpeed", "rad/s", "AngularVelocity", 100.0)
_BY_NAME = {
    **dict.fromkeys((*HELD_SPEED, "longitudinal_speed", "vehicle_speed", "target_speed"), _VEHICLE_SPEED),
    **dict.fromkeys(("rack_travel", "rack_limit", *(f"travel_{wheel}" for wheel in WHEELS)), _TRAVEL),
    **dict.fromkeys(("assist.bandwidth", *(f"wheel_angular_velocity_{wheel}" for wheel in WHEELS)), _ROTATION),
    **dict.fromkeys((f"chassis.drive.{way}_{end}" for way in ("up", "down") for end in ("closed", "open")), _ROTATION),
}
_BY_UNIT = {
    kind.unit: kind
    for kind in (
        Kind("Angle", "rad", "Angle", 0.1, True),
        Kind("AngularVelocity", "rad/s", "AngularVelocity", 0.1, True),
        Kind("Torque", "N m", "Torque"),
        Kind("Force", "N", "Force", 1000.0),
        Kind("Length", "m", "Length"),
        Kind("Velocity", "m/s", "Velocity"),
        Kind("Acceleration", "m/s2", "Acceleration"),
        Kind("Mass", "kg", "Mass", 100.0),
        Kind("MomentOfInertia", "kg m2", "MomentOfInertia"),
        Kind("Time", "s", "Time"),
        Kind("TemperatureDifference", "K", "TemperatureDifference"),
        Kind("Pressure", "Pa", "Pressure", 1e5),
        Kind("RotationalStiffness", "N m/rad", "RotationalSpringConstant", 100.0),
        Kind("RotationalDamping", "N m s/rad", "RotationalDampingConstant"),
        Kind("Stiffness", "N/m", "TranslationalSpringConstant", 1e4),
        Kind("Damping", "N s/m", "TranslationalDampingConstant", 1e3),
    )
}


def type_of_variable(v: Variable) -> Kind | None:
    """The type of a variable; None for a boolean, and where its unit has no name of a quantity."""
    return _BY_NAME.get(v.name) or _BY_UNIT.get(v.unit)


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
            if match is None or match[1] not in _BASE_UNIT_POWERS:
                return None
            for base, power in _BASE_UNIT_POWERS[match[1]].items():
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


def xml_text(root: ElementTree.Element) -> bytes:
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
        if name in DISPLAY:
            shown, factor = DISPLAY[name]
            ElementTree.SubElement(each, "DisplayUnit", name=shown, factor=number(factor))


def type_definitions(root: ElementTree.Element, variables: list[Variable], version: int) -> None:
    """The types of the variables, with quantity, unit and usual size."""
    kinds = sorted({kind for kind in map(type_of_variable, variables) if kind is not None})
    if kinds:
        parent = ElementTree.SubElement(root, "TypeDefinitions")
    for kind in kinds:
        about_it = {"quantity": kind.quantity, "unit": kind.unit, "nominal": number(kind.nominal)}
        if kind.displayed:
            about_it["displayUnit"] = DISPLAY[kind.unit][0]
        if version == 2:
            ElementTree.SubElement(ElementTree.SubElement(parent, "SimpleType", name=kind.name), "Real", about_it)
        else:
            ElementTree.SubElement(parent, "Float64Type", {"name": kind.name, **about_it})


def real(v: Variable) -> dict[str, str]:
    """Attributes of a real variable that both versions have."""
    kind = type_of_variable(v)
    found = {"declaredType": kind.name} if kind else {}
    if v.unit:
        found["unit"] = v.unit
    for name, value in (("min", v.low), ("max", v.high)):
        if math.isfinite(value):
            found[name] = number(value)
    if v.use not in ("OUTPUT", "INDEPENDENT"):
        found["start"] = number(v.start)
    return found


def date() -> str:
    """Time of the export in UTC; that of ``SOURCE_DATE_EPOCH`` [s], so that the same export gives the same bytes.

    Raises
    ------
    ValueError
        The variable of the environment holds no whole number.
    """
    given = os.environ.get("SOURCE_DATE_EPOCH", "")
    if given and not given.isdecimal():
        raise ValueError(f"SOURCE_DATE_EPOCH must be a whole number of seconds since 1970, got {given!r}")
    made = datetime.fromtimestamp(int(given), timezone.utc) if given else datetime.now(timezone.utc)
    return made.strftime("%Y-%m-%dT%H:%M:%SZ")


def description_attributes(subsystem: Subsystem, description: str, token_name: str, token: str) -> dict[str, str]:
    """Attributes of the description that both versions have."""
    return {
        "modelName": f"steer-env {subsystem.name}",
        token_name: token,
        "description": f"{subsystem.title}. {description} {STEP_NOTE}",
        "author": AUTHOR,
        "version": metadata.version("steer-env"),
        "copyright": COPYRIGHT,
        "license": "MIT",
        "generationTool": f"steer-env {metadata.version('steer-env')}",
        "generationDateAndTime": date(),
        "variableNamingConvention": "structured",
    }


def experiment(root: ElementTree.Element) -> None:
    """The default experiment: ten seconds in steps of a millisecond."""
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0.0", stopTime="10.0", stepSize=number(SAMPLE_TIME))


def fmi2(
    subsystem: Subsystem,
    variables: list[Variable],
    identifier: str,
    token: str,
    description: str,
    sources: Sequence[str] = (),
) -> bytes:
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
    sources : sequence of str
        The files in ``sources`` that are to be compiled.
    """
    root = ElementTree.Element(
        "fmiModelDescription", {"fmiVersion": "2.0", **description_attributes(subsystem, description, "guid", token)}
    )
    capabilities: dict[str, Any] = {
        "modelIdentifier": identifier,
        "canHandleVariableCommunicationStepSize": "true",
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
    }
    simulation = ElementTree.SubElement(root, "CoSimulation", capabilities)
    if sources:
        files = ElementTree.SubElement(simulation, "SourceFiles")
        for name in sources:
            ElementTree.SubElement(files, "File", name=name)
    unit_definitions(root, variables)
    type_definitions(root, variables, 2)
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
        ElementTree.SubElement(each, "Real", real(v))
    structure = ElementTree.SubElement(root, "ModelStructure")
    results = [str(i) for i, v in enumerate(variables, 1) if v.use == "OUTPUT"]
    for name, attributes in (("Outputs", {"dependencies": ""}), ("InitialUnknowns", {})):
        parent = ElementTree.SubElement(structure, name)
        for index in results:
            ElementTree.SubElement(parent, "Unknown", {"index": index, **attributes})
    return xml_text(root)


def fmi3(subsystem: Subsystem, variables: list[Variable], identifier: str, token: str, description: str) -> bytes:
    """The description of a unit; the arguments are those of :func:`steer_env.connect.fmu.description.fmi2`."""
    about_unit = description_attributes(subsystem, description, "instantiationToken", token)
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
    type_definitions(root, variables, 3)
    categories = ElementTree.SubElement(root, "LogCategories")
    ElementTree.SubElement(categories, "Category", name="logStatusError", description="Errors")
    experiment(root)
    listed = ElementTree.SubElement(root, "ModelVariables")
    for i, v in enumerate(variables):
        attributes = {"name": v.name, "valueReference": str(i), "description": v.description, **USES[v.use]}
        attributes |= {"start": "true" if v.start else "false"} if v.boolean else real(v)
        ElementTree.SubElement(listed, "Boolean" if v.boolean else "Float64", attributes)
    structure = ElementTree.SubElement(root, "ModelStructure")
    results = [str(i) for i, v in enumerate(variables) if v.use == "OUTPUT"]
    for name, more in (("Output", {"dependencies": ""}), ("InitialUnknown", {})):
        for reference in results:
            ElementTree.SubElement(structure, name, {"valueReference": reference, **more})
    return xml_text(root)


def build_description(identifier: str, sources: Sequence[str]) -> bytes:
    """``buildDescription.xml`` of FMI 3.0, section 2.5.2: the files in ``sources`` that are to be compiled."""
    root = ElementTree.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ElementTree.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = ElementTree.SubElement(configuration, "SourceFileSet", language="C11")
    for name in sources:
        ElementTree.SubElement(files, "SourceFile", name=name)
    ElementTree.SubElement(configuration, "Library", name="m", description="mathematics of the C library")
    return xml_text(root)


# Terminal -> what it is, and its variables by the names that they have in it, of which a unit may lack some.
_TERMINALS: dict[str, tuple[str, dict[str, str]]] = {
    "hands": (
        "Handwheel: its motion and torque, and what the hands give",
        {
            **{"angle": "handwheel_angle", "speed": "handwheel_speed", "torque": "handwheel_torque"},
            **{"given_angle": "hand_angle", "given_speed": "hand_speed", "given_torque": "hand_torque"},
        },
    ),
    "rack": (
        "Rack between steering and wheels: travel and speed are positive where they steer left, the force against that",
        {"travel": "rack_travel", "speed": "rack_speed", "force": "rack_force", "disturbance": "rack_disturbance"},
    ),
    **{
        f"wheel_{wheel}": (
            f"{wheel.replace('_', ' ').capitalize()} wheel: its pose, motion and the forces of the road on its tyre",
            {
                **({"steer_angle": f"road_wheel_angle_{wheel[6:]}"} if wheel.startswith("front") else {}),
                **{part: f"wheel_{part}_{wheel}" for part in ("x", "y", "z", "heading", "inclination")},
                **{"travel": f"travel_{wheel}", "angular_velocity": f"wheel_angular_velocity_{wheel}"},
                **{f"{way}_force": f"{way}_force_{wheel}" for way in ("longitudinal", "lateral")},
                **{"load": f"wheel_load_{wheel}", "aligning_torque": f"aligning_torque_{wheel}"},
                **{f"road_{what}": f"road_{what}_{wheel}" for what in ("height", "slope", "friction")},
            },
        )
        for wheel in WHEELS
    },
}


def terminals(variables: list[Variable]) -> bytes:
    """``terminalsAndIcons.xml`` of a unit of FMI 3.0: its mechanical interfaces, and the size of its icon."""
    names = {v.name for v in variables}
    root = ElementTree.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    corners = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    drawn = ElementTree.SubElement(root, "GraphicalRepresentation")
    ElementTree.SubElement(drawn, "CoordinateSystem", {**corners, "suggestedScalingFactorTo_mm": "0.1"})
    ElementTree.SubElement(drawn, "Icon", corners)
    parent = ElementTree.SubElement(root, "Terminals")
    for name, (text, members) in _TERMINALS.items():
        there = {member: variable for member, variable in members.items() if variable in names}
        if not there:
            continue
        terminal = ElementTree.SubElement(parent, "Terminal", name=name, matchingRule="plug", description=text)
        for member, variable in there.items():
            about_it = {"variableName": variable, "memberName": member, "variableKind": "signal"}
            ElementTree.SubElement(terminal, "TerminalMemberVariable", about_it)
    return xml_text(root)
