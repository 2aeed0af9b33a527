"""``modelDescription.xml`` of a unit for FMI 3.0. Source: Functional Mock-up Interface 3.0.2, section 2.4 and 4.3."""

from xml.etree import ElementTree

from steer_env.connect.fmu.description import USES, about, experiment, number, text_of, unit_definitions
from steer_env.connect.fmu.variables import Variable
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.subsystems import Subsystem


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
