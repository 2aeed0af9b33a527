"""Contradictions among the numbers of a car: what no rigid body on wheels can have.

The second moments of the sprung mass along its own axes, the integrals of x^2, y^2 and z^2 over its mass, follow from
the moments of inertia: I_x + I_z - I_y is twice the integral of y^2, and so on. Each lies between zero and the largest
that fits into the outline of the car. These bounds contain the triangle inequalities of the moments of inertia.
"""

import math
from typing import TYPE_CHECKING

from steer_env.vehicle import chassis as chassis_models
from steer_env.vehicle.constants import GRAVITY

if TYPE_CHECKING:
    from steer_env.vehicle.cars.car import Car

MOST_UNEVEN = 3.0  # largest ratio of the unsprung masses of the axles, either way (assumed)
HEIGHT = 3.0  # of the highest van, assumed [m]
# Overall length over wheelbase and width over track of a file that lacks length and width; larger than any car's.
LENGTH_OVER_WHEELBASE, WIDTH_OVER_TRACK = 2.0, 1.5


def check(car: "Car") -> None:
    """Refuse a car whose numbers contradict each other.

    Raises
    ------
    ValueError
        Naming the key, its value, and the range that the other numbers leave, with the reason.
    """
    _masses(car.chassis)
    _length_and_width(car.chassis)
    _inertias(car.chassis)
    _wheels(car)
    _roll(car)


def _require(name: str, value: float, unit: str, why: str, above: float = 0.0, below: float = math.inf) -> None:
    """ValueError unless ``above < value < below``, with the other keys and the reason in ``why``."""
    if not above < value < below:
        limits = f"above {above:.6g}" + (f" and below {below:.6g}" if below < math.inf else "")
        raise ValueError(f"{name} must be {limits} {unit} ({why}), got {value:g}")


def _rear_unsprung(c: dict[str, float]) -> float:
    return c["mass"] - c["sprung_mass"] - c["front_unsprung_mass"]


def _masses(c: dict[str, float]) -> None:
    front, others = c["front_unsprung_mass"], c["sprung_mass"] + c["front_unsprung_mass"]
    _require(
        "chassis.mass",
        c["mass"],
        "kg",
        "sprung_mass + front_unsprung_mass and a rear unsprung mass of a third of to three times the front one",
        above=others + front / MOST_UNEVEN,
        below=others + front * MOST_UNEVEN,
    )
    wheelbase = c["front_axle"] + c["rear_axle"]
    _require(
        "chassis.front_axle",
        c["front_axle"],
        "m",
        f"at this sum of front_axle and rear_axle, {wheelbase:g}, either axle carries more than its unsprung mass",
        above=wheelbase * _rear_unsprung(c) / c["mass"],
        below=wheelbase * (1.0 - front / c["mass"]),
    )


def _length_and_width(c: dict[str, float]) -> None:
    wheelbase, track = c["front_axle"] + c["rear_axle"], max(c["front_track"], c["rear_track"])
    if "length" in c:
        _require("chassis.length", c["length"], "m", "the wheelbase front_axle + rear_axle", above=wheelbase)
    if "width" in c:
        _require("chassis.width", c["width"], "m", "the larger of front_track and rear_track", above=track)


def _inertias(c: dict[str, float]) -> None:
    a, b, m_s, m_f, m_r = (
        *(c[key] for key in ("front_axle", "rear_axle", "sprung_mass", "front_unsprung_mass")),
        _rear_unsprung(c),
    )
    half_length = 0.5 * c.get("length", LENGTH_OVER_WHEELBASE * (a + b))
    half_width = 0.5 * c.get("width", WIDTH_OVER_TRACK * max(c["front_track"], c["rear_track"]))
    height = c["sprung_height"]
    # Largest integrals of x^2, y^2, z^2 of a mass between two ends, as seen from its centre of gravity.
    most_x, most_y, most_z = m_s * half_length**2, m_s * half_width**2, m_s * height * (HEIGHT - height)
    I_x, I_y = c["roll_inertia"], c["pitch_inertia"]
    where = "what sprung_mass can have within the length, the width and 3 m of height"
    _require("chassis.roll_inertia", I_x, "kg m2", where, below=most_y + most_z)
    _require(
        "chassis.pitch_inertia",
        I_y,
        "kg m2",
        f"{where} with its roll_inertia {I_x:g}",
        above=max(I_x - most_y, 0.0),
        below=min(most_x + most_z, most_x + I_x),
    )
    # That of the whole car: the unsprung masses at the wheels, and the sprung one beside the common centre of gravity.
    wheels = m_f * (a**2 + 0.25 * c["front_track"] ** 2) + m_r * (b**2 + 0.25 * c["rear_track"] ** 2)
    wheels += (m_f * a - m_r * b) ** 2 / m_s
    _require(
        "chassis.yaw_inertia",
        c["yaw_inertia"],
        "kg m2",
        f"the wheels' {wheels:.4g} and that of sprung_mass with its roll_inertia {I_x:g} and pitch_inertia {I_y:g}",
        above=wheels + max(abs(I_y - I_x), I_x + I_y - 2.0 * most_z),
        below=wheels + min(I_x + I_y, 2.0 * most_x + I_x - I_y, 2.0 * most_y + I_y - I_x),
    )


def _wheels(car: "Car") -> None:
    c, radius = car.chassis, car.tyre.coefficients.UNLOADED_RADIUS
    centre = car.strut.loaded_radius
    _require("UNLOADED_RADIUS of the tyre", radius, "m", "the height of the strut's wheel centre", above=centre)
    lighter = 0.5 * min(c["front_unsprung_mass"], _rear_unsprung(c))
    _require(
        "chassis.wheel_inertia",
        c["wheel_inertia"],
        "kg m2",
        f"the unsprung mass of a wheel, {lighter:.4g} kg by front_unsprung_mass and mass, at the radius of the tyre",
        below=lighter * radius**2,
    )


def _roll(car: "Car") -> None:
    """The springs hold the body up: its weight tips it over less than they right it."""
    p = chassis_models.CHASSIS["single_track"].from_car(car, 20.0, 1.0, None)
    _require(
        "the roll stiffness by front_spring, rear_spring, front_anti_roll and rear_anti_roll",
        p.K_f + p.K_r,
        "N m/rad",
        "the moment of the sprung mass about the roll axis, or the body falls over",
        above=p.m_s * GRAVITY * p.h,
    )
