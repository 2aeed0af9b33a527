"""What passenger cars usually have: quantities of a car with their usual ranges.

A value outside its range is possible but unusual, so that loading an own car warns of it (:class:`UnusualCar`) and goes
on. The ranges are wide: from small cars to vans, from comfortable to sporty ones. Most are engineering judgement.
Sources: Gillespie, Fundamentals of Vehicle Dynamics, 1992, chapter 5 (ride frequencies about 1 to 1.5 Hz, up to 2.5 Hz
in sports cars; damping ratios 0.2 to 0.4); Milliken, Milliken, Race Car Vehicle Dynamics, 1995, chapter 16 (roll
gradients from 1.5 deg/g in racing cars to 8.5 deg/g in soft saloons); the published single-track sets that
``vehicle/data/cars/rear_drive_saloon.json`` names (k^2/(a b) 0.69 and 0.88).
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from steer_env.friction.numerics.kernel import plainly
from steer_env.vehicle import chassis as chassis_models
from steer_env.vehicle import tyre
from steer_env.vehicle.cars.keys import OF_KINDS
from steer_env.vehicle.constants import GRAVITY
from steer_env.vehicle.keys import JUDGEMENT, declared_keys
from steer_env.vehicle.steering import stability
from steer_env.vehicle.steering.assist.functions import Functions
from steer_env.vehicle.steering.by_wire import Wire
from steer_env.vehicle.steering.motor import Motor

if TYPE_CHECKING:
    from steer_env.vehicle.cars.car import Car

GILLESPIE = "Gillespie 1992, chapter 5, widened"
MILLIKEN = "Milliken and Milliken 1995, chapter 16, widened"
PUBLISHED = "published single-track sets, widened"
SETS = "published column and steering sets, widened"  # of a derived quantity


class UnusualCar(UserWarning):
    """A car has a value that passenger cars do not usually have."""


class Quantity(NamedTuple):
    """A quantity of a car and the range that it usually has."""

    name: str
    keys: str  # of the car file that determine it, empty if the name is one
    unit: str
    value: Callable[["Car"], float]  # in that unit
    low: float  # in that unit
    high: float  # in that unit
    source: str = JUDGEMENT


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
        return factor * abs(float(plainly(tyre.cornering_stiffness)(car.tyre.coefficients, load))) / load

    return ratio


def _deflection(car: "Car") -> float:
    heavier = max(_axle_mass(car, axle)[0] for axle in ("front", "rear"))
    return 0.5 * GRAVITY * heavier / car.tyre.vertical_stiffness


def _roll_gradient(car: "Car") -> float:
    p = chassis_models.CHASSIS["single_track"].from_car(car, 20.0, 1.0, None)
    moment = p.m_s * GRAVITY * p.h
    return math.degrees(moment / (p.K_f + p.K_r - moment))


def _wheelbase(car: "Car") -> float:
    return car.chassis["front_axle"] + car.chassis["rear_axle"]


def _front_share(car: "Car") -> float:
    return _axle_mass(car, "front")[0] / car.chassis["mass"]


def _unsprung_share(car: "Car") -> float:
    return 1.0 - car.chassis["sprung_mass"] / car.chassis["mass"]


def _dynamic_index(car: "Car") -> float:
    c = car.chassis
    return c["yaw_inertia"] / (c["mass"] * c["front_axle"] * c["rear_axle"])


def _braking(car: "Car") -> float:
    torque = 2.0 * (car.brakes.front + car.brakes.rear)
    return torque / (car.strut.loaded_radius * car.chassis["mass"] * GRAVITY)


def _radius_ratio(car: "Car") -> float:
    return car.tyre.coefficients.UNLOADED_RADIUS / car.strut.loaded_radius


def _boost_share(car: "Car") -> float:
    limit, motor = car.assist.limit, car.assist.motor
    if isinstance(motor, Motor):
        limit = min(limit, motor.torques[0] * motor.ratio)
    return float(car.assist.boost.max() / limit)


def _compensated_inertia(car: "Car") -> float:
    f = car.assist.functions
    return float(f.inertia_compensation.gain.max()) / car.column.I2 if isinstance(f, Functions) else 0.0


def _functions_to_the_limit(car: "Car") -> float:
    return stability.functions_to_the_limit(car.column, car.assist)


def _declared_quantity(section: str, key: str) -> Quantity:
    """A number of a car file as it is; ``keys.toml`` declares what is usual."""

    def value(car: "Car") -> float:
        values = car.given[section] if section in OF_KINDS else getattr(car, section)
        return float(values[key] if isinstance(values, dict) else getattr(values, key))

    about = declared_keys()[section][key]
    assert about.usual is not None
    return Quantity(f"{section}.{key}", "", about.unit, value, *about.usual, about.source)


def _axle(axle: str) -> list[Quantity]:
    """What an axle has."""
    spring, damper, factor = (f"{axle}_{key}" for key in ("spring", "damper", "cornering_stiffness_factor"))
    masses, axles = "mass, sprung_mass, front_unsprung_mass", "mass, front_axle, rear_axle"
    stiffness = f"cornering stiffness over load of a {axle} tyre"
    return [
        Quantity(f"{axle} ride frequency", f"{spring}, {masses}", "Hz", _ride_frequency(axle), 0.8, 2.5, GILLESPIE),
        Quantity(
            f"{axle} damping ratio", f"{damper}, {spring}, {masses}", "1", _damping_ratio(axle), 0.1, 0.7, GILLESPIE
        ),
        Quantity(stiffness, f"tyre, {factor}, {axles}", "1/rad", _stiffness_over_load(axle), 8.0, 30.0),
        _declared_quantity("chassis", factor),
        _declared_quantity("chassis", f"{axle}_track"),
        _declared_quantity("chassis", f"{axle}_bump_clearance"),
    ]


_AXLES = "front_axle, rear_axle"
_ROLL = "front_spring, rear_spring, front_anti_roll, rear_anti_roll, sprung_mass, sprung_height"
_PLACED: tuple[Quantity, ...] = (
    _declared_quantity("chassis", "mass"),
    Quantity("wheelbase", _AXLES, "m", _wheelbase, 1.8, 3.8),
    Quantity("share of the weight on the front axle", _AXLES, "1", _front_share, 0.35, 0.65),
    Quantity("share of the unsprung masses", "sprung_mass, mass", "1", _unsprung_share, 0.05, 0.20),
    Quantity(
        "dynamic index k^2/(a b) of yaw", f"yaw_inertia, mass, {_AXLES}", "1", _dynamic_index, 0.65, 1.2, PUBLISHED
    ),
    Quantity("roll gradient", _ROLL, "deg/g", _roll_gradient, 1.5, 10.0, MILLIKEN),
    _declared_quantity("chassis", "sprung_height"),
    _declared_quantity("chassis", "rear_roll_centre"),
    *_axle("front"),
    *_axle("rear"),
    _declared_quantity("chassis", "rear_bump_steer"),
    _declared_quantity("chassis", "rear_camber_gain"),
    _declared_quantity("chassis", "rear_lateral_compliance"),
    _declared_quantity("chassis", "drag_area"),
    Quantity("static deflection of the more loaded tyres", "tyre, mass", "m", _deflection, 0.008, 0.04),
    Quantity("radius of the tyre over the height of the wheel centre", "tyre, strut", "1", _radius_ratio, 1.02, 1.12),
    Quantity("steering ratio", "pinion_radius, strut", "1", lambda car: car.steering_ratio(), 10.0, 25.0, SETS),
    _declared_quantity("steering", "pinion_radius"),
    _declared_quantity("steering", "rack_limit"),
    _declared_quantity("steering", "compliance"),
    _declared_quantity("steering", "friction_load"),
    _declared_quantity("column", "I1"),
    _declared_quantity("column", "I2"),
    _declared_quantity("column", "K_tb"),
    _declared_quantity("column", "C_tb"),
    _declared_quantity("column", "C1"),
    _declared_quantity("column", "C2"),
    Quantity(
        *("inertia compensation over the inertia below the torsion bar", "inertia_compensation, I2", "1"),
        *(_compensated_inertia, 0.0, 0.5),
    ),
    Quantity(
        *("strength of the functions at which the loop becomes unstable, over theirs", stability.STRENGTHS, "1"),
        *(_functions_to_the_limit, stability.USUAL_LIMIT, math.inf),
    ),
    Quantity("greatest boost over the limit of the motor", "boost, limit, motor_torques", "1", _boost_share, 0.0, 1.0),
    Quantity("deceleration with the full pedal", "brakes, mass", "g", _braking, 0.8, 1.6),
)


def _others() -> list[Quantity]:
    """The declared ranges of keys that have no place of their own above."""
    placed = {q.name for q in _PLACED}
    keys = [(section, name) for section, of in declared_keys().items() for name, key in of.items() if key.usual]
    return [_declared_quantity(*key) for key in keys if ".".join(key) not in placed and key[0] not in OF_KINDS]


USUAL = (*_PLACED, *_others())
_OF_KIND = {
    name: [_declared_quantity(name, key) for key, about in declared_keys()[name].items() if about.usual]
    for name in OF_KINDS
}


def quantities(car: "Car") -> list[Quantity]:
    """The quantities that a car has, with those of its kind of steering."""
    without = {"column.K_tb", "column.C_tb"} if isinstance(car.assist.wire, Wire) else set()  # no torsion bar
    return [q for q in (*USUAL, *_OF_KIND.get(car.kind, ())) if q.name not in without]


def unusual(car: "Car") -> list[str]:
    """A line for each quantity of the car outside its usual range: keys, name, value, range and its source.

    The last line tells of wheel loads at rest beyond the range of the tyre.
    """
    found = []
    for q in quantities(car):
        value = q.value(car)
        if not q.low <= value <= q.high:
            unit, keys = "" if q.unit == "1" else f" {q.unit}", f"{q.keys}: " if q.keys else ""
            usual = f"usual is {q.low:g} to {q.high:g}{unit} ({q.source})"
            found.append(f"{keys}{q.name} is {value:.4g}{unit}; {usual}")
    return found + _beyond_tyre(car)


def _beyond_tyre(car: "Car") -> list[str]:
    """A line if the car at rest loads a tyre beyond its range."""
    loads = [0.5 * GRAVITY * _axle_mass(car, axle)[0] for axle in ("front", "rear")]
    beyond = car.tyre.beyond("F_z", loads)
    return (
        [f"tyre: at rest, with {loads[0]:.0f} N in front and {loads[1]:.0f} N behind, {beyond.words}"] if beyond else []
    )
