"""Mappings: which variable of a foreign unit (FMU) is which input or channel, with its unit and sign.

A mapping is a small TOML file, which names the unit and every variable that is used:

    fmu = "vehicle.fmu"        # beside this file, or a whole path
    step_ms = 1                # communication step, a whole number of milliseconds
    speed_m_s = 27.8           # where the unit gives no speed
    own_process = true         # false: the unit runs in this process, without limits, and its faults end the program
    time_limit_s = 60          # in which loading, the start, a communication step and the end have to return
    memory_limit_gb = 4        # of address space that the unit may take, on Linux

    [inputs.rack_travel]
    variable = "Steer.RackTravel"
    unit = "mm"                # needed where the unit (FMU) names none, or a wrong one
    sign = -1                  # 1 or -1; the rack travel is positive where it steers left

    [outputs.rack_force]       # positive where it resists a left turn
    variable = "Steer.RackForce"

    [parameters]               # start values, in the units of the FMU
    "Road.Friction" = 0.9

    [meta]                     # for metrics that need the geometry of the car; they are refused without it
    wheelbase_m = 2.6
    steering_ratio = 15.8      # handwheel angle over road-wheel angle, straight ahead

A unit that this project exports, or another one with the same names, needs no mapping.
"""

from collections.abc import Mapping as Named
from pathlib import Path
from typing import Any, NamedTuple

from steer_env.connect.external.vehicle import OF_PLANT, START_SPEED, VEHICLE_INPUT_UNITS, VEHICLE_OUTPUT_UNITS
from steer_env.friction.numerics import toml
from steer_env.friction.numerics.check import did_you_mean, flag, number, whole
from steer_env.recording.units import SPELLINGS, parse_unit
from steer_env.vehicle.subsystems.chassis import HELD_SPEED

GEOMETRY = ("wheelbase_m", "steering_ratio")  # keys of the meta
LONGEST_STEP = 100  # communication step [ms]
TIME_LIMIT, MEMORY_LIMIT = 60.0, 4e9  # of a process of its own, assumed [s], [byte]
_LIMITS = ("time_limit_s", "memory_limit_gb")
_MAPPING_KEYS = ("fmu", "step_ms", "speed_m_s", "inputs", "outputs", "parameters", "meta", "own_process", *_LIMITS)
_ENTRY_KEYS = ("variable", "unit", "sign")


class Entry(NamedTuple):
    """A variable of the unit."""

    variable: str
    unit: str | None = None  # None: the one that the unit names
    sign: float = 1.0  # 1 or -1


class Mapping(NamedTuple):
    """A unit and how it is coupled."""

    fmu: Path
    inputs: dict[str, Entry]  # by names of ``VEHICLE_INPUT_UNITS``
    outputs: dict[str, Entry]  # by names of ``VEHICLE_OUTPUT_UNITS``
    parameters: dict[str, float]  # start values [units of the FMU]
    speed: float | None  # of a unit that gives none [m/s]
    step: int  # communication step [ms]
    meta: dict[str, float]  # of the recordings: geometry of the vehicle [units in the names]
    own_process: bool = True
    time_limit: float = TIME_LIMIT  # of a call in a process of its own [s]
    memory_limit: float = MEMORY_LIMIT  # of a process of its own [byte]


def load(path: str | Path, variables: Named[str, Any]) -> Mapping:
    """The mapping of a unit without a file: every variable that has one of this project's names.

    The held speed of a chassis of this project is what it starts at, and its speed where it reports none.

    Parameters
    ----------
    path : str or Path
        The unit.
    variables : mapping
        Its variables by their names, as fmpy describes them.
    """
    inputs = {
        name: Entry(OF_PLANT.get(name, name)) for name in VEHICLE_INPUT_UNITS if OF_PLANT.get(name, name) in variables
    }
    outputs = {name: Entry(name) for name in VEHICLE_OUTPUT_UNITS if name in variables}
    held = next((name for name in HELD_SPEED if name in variables), None)
    if held is not None and variables[held].causality == "parameter":  # which it was not always
        inputs.setdefault(START_SPEED, Entry(held))
    speed = next((name for name in ("longitudinal_speed", *HELD_SPEED) if name in variables), None)
    if speed is not None:
        outputs.setdefault("vehicle_speed", Entry(speed))
    return Mapping(Path(path), inputs, outputs, {}, None, 1, {})


def read(path: str | Path) -> Mapping:
    """A mapping from a TOML file.

    Raises
    ------
    ValueError
        If the file is not a mapping; the message names the file, the key and what is allowed there.
    OSError
        If the file cannot be opened.
    """
    data = toml.read(path)
    try:
        return _from_data(data, Path(path).parent)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _from_data(data: dict[str, Any], folder: Path) -> Mapping:
    for key in data:
        if key not in _MAPPING_KEYS:
            raise ValueError(f"a mapping has no key {key!r}; it takes {', '.join(_MAPPING_KEYS)}")
    if not isinstance(data.get("fmu"), str):
        raise ValueError(f'a mapping names its unit, as fmu = "vehicle.fmu", got {data.get("fmu")!r}')
    sections = {name: data.get(name, {}) for name in ("inputs", "outputs", "parameters", "meta")}
    for name, section in sections.items():
        if not isinstance(section, dict):
            raise ValueError(f"{name} must hold keys and values, got {section!r}")
    step = whole("step_ms", data.get("step_ms", 1), 1)
    own = flag("own_process", data.get("own_process", True))
    for key in _LIMITS:
        if key in data and not own:
            raise ValueError(f"{key} needs own_process = true, got false")
    speed = number("speed_m_s", data["speed_m_s"], minimum=0.0) if "speed_m_s" in data else None
    return Mapping(
        folder / data["fmu"],
        {
            name: _entry(f"inputs.{name}", name, given, VEHICLE_INPUT_UNITS)
            for name, given in sections["inputs"].items()
        },
        {
            name: _entry(f"outputs.{name}", name, given, VEHICLE_OUTPUT_UNITS)
            for name, given in sections["outputs"].items()
        },
        {name: number(f"parameters.{name}", value) for name, value in sections["parameters"].items()},
        speed,
        int(number("step_ms", step, maximum=LONGEST_STEP)),
        {name: _meta(name, value) for name, value in sections["meta"].items()},
        own,
        number("time_limit_s", data.get("time_limit_s", TIME_LIMIT), minimum=0.0, above=True, maximum=1e6),
        1e9 * number("memory_limit_gb", data.get("memory_limit_gb", MEMORY_LIMIT / 1e9), minimum=0.0, maximum=1e6),
    )


def _meta(name: str, value: Any) -> float:
    if name not in GEOMETRY:
        raise ValueError(f"meta has no key {name!r}; it takes {', '.join(GEOMETRY)}")
    return number(f"meta.{name}", value, minimum=0.0, above=True)


def _entry(where: str, name: str, given: Any, known: dict[str, str]) -> Entry:
    if name not in known:
        raise ValueError(f"{where}: nothing is known as {name!r}, {did_you_mean(name, known)}")
    if not isinstance(given, dict) or not isinstance(given.get("variable"), str):
        raise ValueError(f'{where} must name a variable, as variable = "Car.yaw_rate", got {given!r}')
    for key in given:
        if key not in _ENTRY_KEYS:
            raise ValueError(f"{where} has no key {key!r}; it takes {', '.join(_ENTRY_KEYS)}")
    unit, sign = given.get("unit"), given.get("sign", 1)
    if unit is not None:
        factor(where, str(unit), known[name])
    if isinstance(sign, bool) or sign not in (1, -1):
        raise ValueError(f"{where}.sign must be 1 or -1, got {sign!r}")
    return Entry(given["variable"], unit, float(sign))


def factor(where: str, unit: str | None, wanted: str) -> float:
    """Size in SI of one of a unit, for a quantity that is kept in another; ValueError where it does not fit."""
    found = parse_unit(unit or "")
    if found is None:
        told = f"{where}.unit {unit!r} is not known" if unit else f"{where} has no unit: give one"
        raise ValueError(f"{told}; known are {SPELLINGS}")
    if found[0] != wanted:
        raise ValueError(f"{where}.unit {unit!r} does not fit a quantity that is kept in {wanted!r}")
    return found[1]
