"""What passenger cars usually have: quantities of a car with their usual ranges.

A value outside its range is possible but unusual, so that loading an own car warns of it (:class:`UnusualCar`) and goes
on. The ranges are wide: from small cars to vans, from comfortable to sporty ones. Most are engineering judgement.
Sources: Gillespie, Fundamentals of Vehicle Dynamics, 1992, chapter 5 (ride frequencies about 1 to 1.5 Hz, up to 2.5 Hz
in sports cars; damping ratios 0.2 to 0.4); Milliken, Milliken, Race Car Vehicle Dynamics, 1995, chapter 16 (roll
gradients from 1.5 deg/g in racing cars to 8.5 deg/g in soft saloons); the published single-track sets that
``vehicle/data/cars/rear_drive_saloon.json`` names (k^2/(a b) 0.69 and 0.88).
"""

import math
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from steer_env.vehicle import chassis as chassis_models
from steer_env.vehicle import tyre
from steer_env.vehicle.constants import GRAVITY

if TYPE_CHECKING:
    from steer_env.vehicle.cars.car import Car

JUDGEMENT = "engineering judgement"
GILLESPIE = "Gillespie 1992, chapter 5, widened"
MILLIKEN = "Milliken and Milliken 1995, chapter 16, widened"
PUBLISHED = "published single-track sets, widened"
SETS = "published column and steering sets, widened"


class UnusualCar(UserWarning):
    """A car has a value that passenger cars do not usually have."""


class Quantity(NamedTuple):
    """A quantity of a car and the range that it usually has."""

    name: str
    keys: str  # of the car file that determine it
    unit: str
    value: Callable[["Car"], float]  # in that unit
    low: float  # in that unit
    high: float  # in that unit
    source: str


def _axle_mass(car: "Car", axle: str) -> tuple[float, float]:
    """Mass on an axle and the sprung part of it [kg]."""
    c = car.chassis
    other = c["rear_axle" if axle == "front" else "front_axle"]
    mass = c["mass"] * other / (c["front_axle"] + c["rear_axle"])
    front = c["front_unsprung_mass"]
    return mass, mass - (front if axle == "front" else c["mass"] - c["sprung_mass"] - front)


def _ride_frequency(axle: str) -> Callable[["Car"], float]:
    return lambda car: math.sqrt(2.0 * car.chassis[f"{axle}_spring"] / _axle_mass(car, axle)[1]) / (2.0 * math.pi)


def _damping_ratio(axle: str) -> Callable[["Car"], float]:
    def ratio(car: "Car") -> float:
        spring, damper = (2.0 * car.chassis[f"{axle}_{part}"] for part in ("spring", "damper"))
        return damper / (2.0 * math.sqrt(spring * _axle_mass(car, axle)[1]))

    return ratio


def _stiffness_over_load(axle: str) -> Callable[["Car"], float]:
    def ratio(car: "Car") -> float:
        load = 0.5 * GRAVITY * _axle_mass(car, axle)[0]
        factor = car.chassis[f"{axle}_cornering_stiffness_factor"]
        return factor * abs(float(tyre.cornering_stiffness(car.tyre.coefficients, load))) / load

    return ratio


def _deflection(car: "Car") -> float:
    heavier = max(_axle_mass(car, axle)[0] for axle in ("front", "rear"))
    return 1e3 * 0.5 * GRAVITY * heavier / car.tyre.vertical_stiffness


def _roll_gradient(car: "Car") -> float:
    p = chassis_models.CHASSIS["single_track"].from_car(car, 20.0, 1.0, None)
    moment = p.m_s * GRAVITY * p.h
    return math.degrees(moment / (p.K_f + p.K_r - moment))


def _dynamic_index(car: "Car") -> float:
    c = car.chassis
    return c["yaw_inertia"] / (c["mass"] * c["front_axle"] * c["rear_axle"])


def _braking(car: "Car") -> float:
    torque = 2.0 * (car.brakes.front + car.brakes.rear)
    return torque / (car.strut.loaded_radius * car.chassis["mass"] * GRAVITY)


def _of(section: str, key: str, unit: str, low: float, high: float, source: str = JUDGEMENT) -> Quantity:
    """A value of a car file as it is, or in a unit with a prefix."""
    scale = {"mm": 1e3, "kN m/rad": 1e-3, "kN/m": 1e-3, "urad/N": 1e6}.get(unit, 1.0)

    def value(car: "Car") -> float:
        values = getattr(car, section)
        return scale * float(values[key] if isinstance(values, dict) else getattr(values, key))

    return Quantity(key.replace("_", " "), f"{section}.{key}", unit, value, low, high, source)


def _axles() -> list[Quantity]:
    """What each axle has."""
    found = []
    for axle in ("front", "rear"):
        other, mass = "chassis.mass, front_axle, rear_axle", "mass, sprung_mass, front_unsprung_mass"
        key = f"chassis.{axle}_spring"
        found += [
            Quantity(f"{axle} ride frequency", f"{key}, {mass}", "Hz", _ride_frequency(axle), 0.8, 2.5, GILLESPIE),
            Quantity(
                f"{axle} damping ratio of the body",
                f"chassis.{axle}_damper, {axle}_spring, {mass}",
                "1",
                _damping_ratio(axle),
                0.1,
                0.7,
                GILLESPIE,
            ),
            Quantity(
                f"cornering stiffness over load of a {axle} tyre",
                f"tyre, chassis.{axle}_cornering_stiffness_factor, {other}",
                "1/rad",
                _stiffness_over_load(axle),
                8.0,
                30.0,
                JUDGEMENT,
            ),
            _of("chassis", f"{axle}_cornering_stiffness_factor", "1", 0.8, 1.7),
            _of("chassis", f"{axle}_track", "m", 1.2, 1.8),
            _of("chassis", f"{axle}_bump_clearance", "mm", 30.0, 120.0),
        ]
    return found


USUAL: tuple[Quantity, ...] = (
    _of("chassis", "mass", "kg", 600.0, 3500.0),
    Quantity(
        "wheelbase",
        "chassis.front_axle, rear_axle",
        "m",
        lambda car: car.chassis["front_axle"] + car.chassis["rear_axle"],
        1.8,
        3.8,
        JUDGEMENT,
    ),
    Quantity(
        "share of the weight on the front axle",
        "chassis.front_axle, rear_axle",
        "1",
        lambda car: _axle_mass(car, "front")[0] / car.chassis["mass"],
        0.35,
        0.65,
        JUDGEMENT,
    ),
    Quantity(
        "share of the unsprung masses",
        "chassis.sprung_mass, mass",
        "1",
        lambda car: 1.0 - car.chassis["sprung_mass"] / car.chassis["mass"],
        0.05,
        0.20,
        JUDGEMENT,
    ),
    Quantity(
        "dynamic index k^2/(a b) of yaw",
        "chassis.yaw_inertia, mass, front_axle, rear_axle",
        "1",
        _dynamic_index,
        0.7,
        1.2,
        PUBLISHED,
    ),
    _of("chassis", "sprung_height", "m", 0.4, 1.0),
    _of("chassis", "rear_roll_centre", "m", 0.0, 0.4),
    Quantity(
        "roll gradient",
        "chassis.front_spring, rear_spring, front_anti_roll, rear_anti_roll, sprung_mass, sprung_height",
        "deg/g",
        _roll_gradient,
        1.5,
        10.0,
        MILLIKEN,
    ),
    *_axles(),
    _of("chassis", "rear_bump_steer", "rad/m", -0.3, 0.3),
    _of("chassis", "rear_camber_gain", "rad/m", -0.3, 1.2),
    _of("chassis", "rear_lateral_compliance", "urad/N", -6.0, 6.0),
    _of("chassis", "drag_area", "m2", 0.3, 2.0),
    Quantity(
        "static deflection of the more loaded tyres", "tyre, chassis.mass", "mm", _deflection, 8.0, 40.0, JUDGEMENT
    ),
    Quantity(
        "unloaded radius of the tyre over the height of the strut's wheel centre",
        "tyre, strut",
        "1",
        lambda car: car.tyre.coefficients.UNLOADED_RADIUS / car.strut.loaded_radius,
        1.02,
        1.12,
        JUDGEMENT,
    ),
    Quantity(
        "overall steering ratio",
        "steering.pinion_radius, strut",
        "1",
        lambda car: car.steering_ratio(),
        10.0,
        25.0,
        SETS,
    ),
    _of("steering", "pinion_radius", "mm", 5.0, 12.0, SETS),
    _of("steering", "rack_limit", "mm", 50.0, 75.0, SETS),
    _of("steering", "compliance", "kN m/rad", 3.0, 100.0),
    _of("steering", "friction_load", "1", 0.0, 0.1),
    _of("column", "I1", "kg m2", 0.02, 0.08, SETS),
    _of("column", "I2", "kg m2", 0.005, 0.15, SETS),
    _of("column", "K_tb", "N m/rad", 50.0, 300.0, SETS),
    _of("column", "C_tb", "N m s/rad", 0.0, 1.0, SETS),
    _of("column", "C1", "N m s/rad", 0.0, 0.5, SETS),
    _of("column", "C2", "N m s/rad", 0.0, 3.0, SETS),
    Quantity(
        "greatest boost over the limit of the motor",
        "assist.boost, limit",
        "1",
        lambda car: float(car.assist.boost.max()) / car.assist.limit,
        0.0,
        1.0,
        JUDGEMENT,
    ),
    Quantity(
        "deceleration with the full pedal", "brakes.front, rear, chassis.mass", "g", _braking, 0.8, 1.6, JUDGEMENT
    ),
)


def unusual(car: "Car") -> list[str]:
    """A line for each quantity of the car outside its usual range: keys, name, value and range."""
    found = []
    for q in USUAL:
        value = q.value(car)
        if not q.low <= value <= q.high:
            unit = "" if q.unit == "1" else f" {q.unit}"
            found.append(
                f"{q.keys}: {q.name} is {value:.4g}{unit}; usual is {q.low:g} to {q.high:g}{unit} ({q.source})"
            )
    return found


_TOLD: set[str] = set()


def warn_once(text: str) -> None:
    """Warn of an unusual car (:class:`UnusualCar`), each text once in a process."""
    if text not in _TOLD:
        _TOLD.add(text)
        warnings.warn(text, UnusualCar, stacklevel=4)
