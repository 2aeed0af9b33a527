"""Cars: a data file each, checked key by key, turned into the parameters of the plant."""

import json
import math
from collections.abc import Iterable
from functools import lru_cache
from importlib.resources import files
from inspect import signature
from typing import Any, NamedTuple

from friction import defaults, resolve
from friction.check import number
from vehicle import assist, column, strut_map, tyre
from vehicle.plant import Plant
from vehicle.single_track import AIR_DENSITY, SingleTrack
from vehicle.suspension import MacPherson

# The speed range in which a rolling tyre and a chassis at constant speed make sense.
SPEED_MIN, SPEED_MAX = 3.0, 70.0  # [m/s]
LOAD_TIME = 0.02  # time constant of the geometric load transfer, assumed [s]

_CHASSIS = (
    "mass",
    "sprung_mass",
    "front_unsprung_mass",
    "front_axle",
    "rear_axle",
    "roll_inertia",
    "yaw_inertia",
    "sprung_height",
    "front_track",
    "rear_track",
    "front_spring",
    "rear_spring",
    "front_damper",
    "rear_damper",
    "front_anti_roll",
    "rear_anti_roll",
    "rear_roll_centre",
    "drag_area",
    "compliance_time",
    "speed_hold_time",
)
_STEERING = ("pinion_radius", "compliance", "friction_load", "rack_limit")
_MAY_BE_ZERO = {
    "front_anti_roll",
    "rear_anti_roll",
    "front_damper",
    "rear_damper",
    "rear_roll_centre",
    "drag_area",
    "friction_load",
}
_SECTIONS = ("name", "description", "source", "assumed", "tyre", "strut", "chassis", "steering", "column", "assist")


class Car(NamedTuple):
    """A checked car; :func:`load` makes one."""

    name: str
    description: str
    source: str
    chassis: dict[str, float]  # as in the data file, SI
    steering: dict[str, float]  # as in the data file, SI
    column: column.Column
    assist: assist.Assist
    tyre: tyre.Tyre
    strut: MacPherson
    strut_map: strut_map.StrutMap

    def plant(
        self, friction: Any = "lugre", speed: float = 100.0 / 3.6, robot: bool = False, road_friction: float = 1.0
    ) -> Plant:
        """The plant of this car with a friction law, at a speed.

        Parameters
        ----------
        friction : str or parameters
            A law's name, for its defaults, or parameters from ``friction.make``.
        speed : float
            Held speed [m/s].
        robot : bool
            Whether the handwheel angle is prescribed; else the hand torque is.
        road_friction : float
            Relative to the tyre's measurements, 0.1 to 1.2.

        Raises
        ------
        ValueError
            Unknown law, or a value outside its range.
        """
        v_x = number("speed [m/s]", speed, minimum=SPEED_MIN, maximum=SPEED_MAX)
        s, c = self.steering, self.chassis
        # Symmetric, or the car would pull to one side; and without the longitudinal shift, which at zero slip would
        # brake by 4 % of the load (the rolling resistance of the set is 1 %) and above 8 kN even drive.
        coefficients = self.tyre.symmetric().coefficients._replace(PHX1=0.0, PHX2=0.0)
        pose = self.strut.solve(0.0, 0.0)
        roll_centre = float(pose.roll_centre_height)
        # The king-pin stiffness of both wheels, seen at the rack through the arm at centre.
        arm = 1.0 / float(pose.per_rack.rotation[..., 2])
        axle_height = (roll_centre * c["rear_axle"] + c["rear_roll_centre"] * c["front_axle"]) / (
            c["front_axle"] + c["rear_axle"]
        )
        h = c["sprung_height"] - axle_height
        chassis = SingleTrack(
            v_x=v_x,
            mu=number("road_friction", road_friction, minimum=0.1, maximum=1.2),
            m=c["mass"],
            m_s=c["sprung_mass"],
            m_uf=c["front_unsprung_mass"],
            m_ur=c["mass"] - c["sprung_mass"] - c["front_unsprung_mass"],
            a=c["front_axle"],
            b=c["rear_axle"],
            I_xr=c["roll_inertia"] + c["sprung_mass"] * h * h,
            I_z=c["yaw_inertia"],
            h=h,
            t_f=c["front_track"],
            t_r=c["rear_track"],
            K_f=0.5 * c["front_spring"] * c["front_track"] ** 2 + c["front_anti_roll"],
            K_r=0.5 * c["rear_spring"] * c["rear_track"] ** 2 + c["rear_anti_roll"],
            C_f=0.5 * c["front_damper"] * c["front_track"] ** 2,
            C_r=0.5 * c["rear_damper"] * c["rear_track"] ** 2,
            h_f=roll_centre,
            h_r=c["rear_roll_centre"],
            R_w=self.strut.loaded_radius,
            drag=0.5 * AIR_DENSITY * c["drag_area"] * v_x * v_x,
            sigma_y=self.tyre.relaxation_length,
            K_rack=s["compliance"] / arm**2,
            T_rack=c["compliance_time"],
            T_load=LOAD_TIME,
            T_drive=c["speed_hold_time"],
        )
        return Plant(
            column=self.column,
            assist=self.assist,
            friction=resolve(friction),
            chassis=chassis,
            strut=self.strut_map,
            tyre=tyre.record(coefficients),
            pinion_radius=s["pinion_radius"],
            friction_load=s["friction_load"] * s["pinion_radius"] / defaults.F_C,
            rack_limit=s["rack_limit"],
            robot=1.0 if robot else 0.0,
        )


def _known(where: str, given: Any, allowed: Iterable[str]) -> None:
    if not isinstance(given, dict):
        raise ValueError(f"{where} must hold keys and values, got {given!r}")
    for key in given:
        if key not in allowed:
            raise ValueError(f"{where} has no key {key!r}; it takes: {', '.join(allowed)}")


# Beyond these the plant's tables or its 1 ms step would answer, but wrongly.
_LIMITS = {
    "rack_limit": (0.0, 0.075),  # [m]; the strut's table ends there
    "compliance_time": (0.004, math.inf),  # [s]; two chassis nodes
    "speed_hold_time": (0.004, math.inf),  # [s]
}


def _require(where: str, given: Any, allowed: tuple[str, ...]) -> None:
    _known(where, given, allowed)
    for key in allowed:
        if key not in given:
            raise ValueError(f"{where} lacks the key {key!r}")


def _numbers(where: str, given: dict, allowed: tuple[str, ...]) -> dict[str, float]:
    _require(where, given, allowed)
    checked = {}
    for key, value in given.items():
        low, high = _LIMITS.get(key, (0.0, math.inf))
        above = low == 0.0 and key not in _MAY_BE_ZERO
        checked[key] = number(f"{where}.{key}", value, minimum=low, maximum=high, above=above)
    return checked


def from_data(data: dict[str, Any]) -> Car:
    """A car from the contents of a data file.

    Raises
    ------
    ValueError
        An unknown or missing key, or a value outside its range, named with its section.
    """
    _require("car", data, _SECTIONS)
    chassis = _numbers("chassis", data["chassis"], _CHASSIS)
    rest = chassis["mass"] - chassis["sprung_mass"] - chassis["front_unsprung_mass"]
    if rest <= 0.0:
        raise ValueError(
            f"chassis.mass must exceed sprung_mass + front_unsprung_mass, the rear axle is left {rest:g} kg"
        )
    for section, make in (("column", column.make), ("assist", assist.make)):
        _known(section, data[section], signature(make).parameters)
    strut = MacPherson.load(data["strut"]).at_track(chassis["front_track"])
    return Car(
        name=data["name"],
        description=data["description"],
        source=data["source"],
        chassis=chassis,
        steering=_numbers("steering", data["steering"], _STEERING),
        column=column.make(**data["column"]),
        assist=assist.make(**data["assist"]),
        tyre=tyre.load(data["tyre"]),
        strut=strut,
        strut_map=strut_map.build(strut),
    )


def available() -> tuple[str, ...]:
    """Names of the packaged cars."""
    return ("compact",)


@lru_cache
def load(name: str = "compact") -> Car:
    """A packaged car by name; ValueError, listing the names, for any other."""
    if name not in available():
        raise ValueError(f"vehicle must be one of {', '.join(available())}, got {name!r}")
    return from_data(json.loads(files(__package__).joinpath("data", f"{name}.json").read_text(encoding="utf-8")))


def rack_ratio(car: Car) -> float:
    """Overall steering ratio at centre: handwheel angle per road-wheel angle [1]."""
    return 1.0 / (car.steering["pinion_radius"] * float(car.strut.solve(0.0, 0.0).per_rack.rotation[..., 2]))


def degrees_per_millimetre(car: Car) -> float:
    """Road-wheel angle per rack travel at centre [deg/mm]."""
    return math.degrees(float(car.strut.solve(0.0, 0.0).per_rack.rotation[..., 2])) / 1000.0
