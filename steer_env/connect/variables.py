"""The variables of a unit: inputs, outputs and parameters, each with its unit, description, bounds and start value.

The parameters are the numbers of the subsystem's parameters. One that is a key of a car file has the meaning and the
range that ``keys.toml`` declares. Unit and description of the others come from the comment beside the field, which the
style of the project asks for, and of a friction law's field from the units that the law registers.
"""

import inspect
import math
import re
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from steer_env.friction import sites
from steer_env.friction.law import LAWS
from steer_env.friction.numerics.packing import Leaf, leaves
from steer_env.vehicle.cars.car import ROAD_FRICTION
from steer_env.vehicle.chassis import chassis_of
from steer_env.vehicle.chassis.two_track.parameters import Body
from steer_env.vehicle.keys import Key, declared_keys
from steer_env.vehicle.road import FRICTION, HEIGHT, Road, WheelRoad
from steer_env.vehicle.subsystems import Subsystem, poses
from steer_env.vehicle.subsystems.chassis import HELD_SPEED
from steer_env.vehicle.tyre.coefficients import MagicFormula

# Sections whose parameters may change while the unit runs; those of the others belong to the settled start.
TUNABLE = ("column", "assist", "friction", "level", "friction_load", "friction_torque_scale", "robot")
# Axes of tables, by the end of the path to them: their values have to ascend, which a single value cannot keep.
AXES = ("assist.speeds", "assist.torques", "functions.speeds", "motor.speeds")
_MU = ("chassis.mu", "chassis.body.mu")
BOOLEAN = ("robot",)
# Bounds of the inputs that are the road under each wheel, by the start of their names; that of the slope is assumed.
_ROAD = {"height": HEIGHT, "slope": (-2.0, 2.0), "friction": FRICTION}
# Units of what would give energy below zero, or friction that shrinks with its load.
_PASSIVE = ("kg m2", "N m/rad", "N m s/rad", "1/N", "1/(N m)")
# Section of a car file and start of its keys, by the path to the fields.
_SECTIONS = {
    "column": ("column", ""),
    "assist": ("assist", ""),
    "assist.motor": ("assist", "motor_"),
    "level": ("steering", "friction_"),
    "": ("steering", ""),
    "chassis": ("chassis", ""),
    "chassis.body": ("chassis", ""),
    "chassis.drive": ("drivetrain", ""),
    "chassis.brakes": ("brakes", ""),
    "chassis.hold": ("speed_hold", ""),
}
# Keys of the chassis by the fields that hold them under another name, where the unit is theirs.
_CHASSIS_KEYS = {
    "m": "mass",
    "m_s": "sprung_mass",
    "m_uf": "front_unsprung_mass",
    "a": "front_axle",
    "b": "rear_axle",
    "I_z": "yaw_inertia",
    "I_w": "wheel_inertia",
    "t_f": "front_track",
    "t_r": "rear_track",
    "h_r": "rear_roll_centre",
    "K_r": "rear_spring",
    "C_r": "rear_damper",
    "clearance_f": "front_bump_clearance",
    "clearance_r": "rear_bump_clearance",
    "K_stop": "bump_stiffness",
    "steer_r": "rear_bump_steer",
    "camber_r": "rear_camber_gain",
    "compliance_steer_r": "rear_lateral_compliance",
    "stiffness_f": "front_cornering_stiffness_factor",
    "stiffness_r": "rear_cornering_stiffness_factor",
    "T_rack": "compliance_time",
    "T_drive": "speed_hold_time",
}
_RECORDS: tuple[Any, ...] = (Body, MagicFormula)  # classes that the kernels take as records


class Variable(NamedTuple):
    """A variable of a unit."""

    name: str
    unit: str  # "" where none is known, or for a boolean
    description: str
    array: str  # of the unit: NUMBERS, GIVEN, OUTPUTS, POSES or TIME
    place: int  # position there
    use: str  # INPUT, OUTPUT, FIXED, TUNABLE or INDEPENDENT
    boolean: bool
    start: float  # in the unit of the variable
    low: float = -math.inf  # values below are refused
    high: float = math.inf  # values above are refused


@cache
def _comments(owner: type) -> dict[str, tuple[str, str]]:
    """Description and unit of each field of a class, from the comments beside them; none without source text."""
    try:
        source = inspect.getsource(owner)
    except (OSError, TypeError):
        return {}
    found = {}
    for name, comment in re.findall(r"^\s+(\w+)\s*:[^#\n]*#\s*(.*?)\s*$", source, re.MULTILINE):
        *_, unit = (None, *re.finditer(r" ?\[([^\[\]]+)\]", comment))  # the last in brackets
        text = comment[: unit.start()] + comment[unit.end() :] if unit else comment
        text = re.sub(r"^\([\w, ]+\) ", "", text)  # the shape of an array
        found[name] = text, ("1" if unit[1] == "-" else unit[1]) if unit else ""
    return found


def comment_and_unit(leaf: Leaf, field: str, owner: type | None) -> tuple[str, str]:
    """What the comment beside a field says, and its unit."""
    text, unit = _comments(owner).get(field, ("", "")) if owner else ("", "")
    law = LAWS.of(owner)
    return text or field.replace("_", " "), law.units.get(field, unit) if law else unit


def _key(name: str, field: str, unit: str) -> tuple[str, Key] | None:
    """The key of a car file that a parameter is, with its name there; None where it is none."""
    owner = re.sub(r"^friction\.\w+\.level$", "level", name.rpartition(".")[0])  # a site's is as the car's
    section, start = _SECTIONS.get(owner, ("", ""))
    named = _CHASSIS_KEYS.get(field, field) if section == "chassis" else f"{start}{field}"
    found = declared_keys().get(section, {}).get(named)
    return (named, found) if found is not None and found.unit == unit else None


def _table_position(subsystem: Subsystem, name: str) -> str:
    """Where in a table of the assist a parameter stands, as the end of a sentence."""
    if curve := re.fullmatch(r"assist\.motor\.torques\[(\d+)\]", name):
        return f"; at {subsystem.parameters.assist.motor.speeds[int(curve[1]) - 1]:.4g} rad/s"
    found = re.fullmatch(r"assist\.(?:boost|damping|functions\.\w+\.gain)\[(\d+)(?:,(\d+))?\]", name)
    if found is None:
        return ""
    assist = subsystem.parameters.assist
    speeds = assist.functions.speeds if "functions" in name else assist.speeds
    speed = f"; at {speeds[int(found[1]) - 1]:.4g} m/s"
    return speed + (f" and {assist.torques[int(found[2]) - 1]:.4g} N m" if found[2] else "")


def _bounds(subsystem: Subsystem, name: str, unit: str, key: Key | None, value: float) -> tuple[float, float]:
    """Least and largest value of a parameter: its key's, else from zero where it is positive or of such a unit."""
    if name in HELD_SPEED:
        return chassis_of(subsystem.parameters.chassis).speeds
    if name in _MU:
        return ROAD_FRICTION
    if key is not None:
        return key.low, key.high
    return (0.0 if value > 0.0 or (value == 0.0 and unit in _PASSIVE) else -math.inf), math.inf


def _elements(leaf: Leaf) -> Iterator[tuple[str, str, type | None, int, float]]:
    """Name, field, class of the field, position and value of each float of a leaf."""
    name, field = ".".join(leaf.path), leaf.path[-1]
    names = getattr(getattr(leaf.value, "dtype", None), "names", None)
    if names:
        owner = next((kind for kind in _RECORDS if kind._fields == names), None)
        for i, key in enumerate(names):
            yield f"{name}.{key}", key, owner, leaf.start + i, float(leaf.value[key][0])
    elif np.ndim(leaf.value):
        for i, place in enumerate(np.ndindex(leaf.value.shape)):
            index = ",".join(str(k + 1) for k in place)
            yield f"{name}[{index}]", field, leaf.owner, leaf.start + i, float(leaf.value[place])
    else:
        yield name, field, leaf.owner, leaf.start, float(leaf.value)


def _settable(leaf: Leaf) -> bool:
    """Whether a leaf becomes parameters: floats, no tables, and arrays only where they may be tuned."""
    if leaf.table or isinstance(leaf.value, bool | int | np.integer):
        return False
    named = getattr(getattr(leaf.value, "dtype", None), "names", None)
    if np.ndim(leaf.value) and not named:
        return leaf.path[0] in TUNABLE and ".".join(leaf.path[-2:]) not in AXES and leaf.value.dtype == np.float64
    return True


def _parameters(subsystem: Subsystem) -> Iterator[Variable]:
    for leaf in leaves(subsystem.parameters):
        section, *path = leaf.path
        if section not in subsystem.sections or not _settable(leaf):
            continue
        at_site = section == "friction" and isinstance(subsystem.parameters.friction, sites.Sites)
        if at_site and not sites.acts(subsystem.parameters.friction, *path):
            continue
        for name, field, owner, place, value in _elements(leaf):
            text, unit = comment_and_unit(leaf, field, owner)
            if owner is WheelRoad:
                bounds = _ROAD[field.partition("_")[0]]
                yield Variable(f"road_{field}", unit, text, "NUMBERS", place, "INPUT", False, value, *bounds)
                continue
            use = "TUNABLE" if section in TUNABLE else "FIXED"
            if name in BOOLEAN:
                yield Variable(name, "", text, "NUMBERS", place, use, True, value)
                continue
            key = _key(name, field, unit)
            if key is not None:  # whose name says what a meaning leaves out, where it is a word and no symbol
                text = f"{key[0].replace('_', ' ')}: {key[1].meaning}" if key[0].islower() else key[1].meaning
            if name.startswith("assist.functions."):  # of which some have fields of one name
                text = f"{' '.join(name.split('.')[2:-1]).replace('_', ' ')}: {text}"
            if at_site:
                text = f"{path[0].replace('_', ' ')}: {text}"
            text += _table_position(subsystem, name)
            bounds = _bounds(subsystem, name, unit, key and key[1], value)
            yield Variable(name, unit, text, "NUMBERS", place, use, False, value, *bounds)


TIME = Variable("time", "s", "simulation time", "TIME", 0, "INDEPENDENT", False, 0.0)


def with_road(subsystem: Subsystem) -> Subsystem:
    """A subsystem that takes the road under each wheel as inputs, level and dry at first, where its chassis has one."""
    p = subsystem.parameters
    if not isinstance(getattr(p.chassis, "road", None), Road):
        return subsystem
    return subsystem._replace(parameters=p._replace(chassis=p.chassis._replace(road=WheelRoad())))


def variables(subsystem: Subsystem, version: int) -> list[Variable]:
    """Every variable of a subsystem in a version of FMI; the position in the list is the value reference."""
    inputs = [
        Variable(s.name, s.unit, s.description, "GIVEN", i, "INPUT", False, s.start, s.low, s.high)
        for i, s in enumerate(subsystem.given)
    ]
    outputs = [
        Variable(s.name, s.unit, s.description, array, i, "OUTPUT", False, float(subsystem.shown[i]), s.low, s.high)
        for i, s in enumerate(subsystem.outputs)
        for array in ("POSES" if s.name in poses.POSE_NAMES else "OUTPUTS",)
    ]
    return [*inputs, *outputs, *_parameters(subsystem), *((TIME,) if version == 3 else ())]
