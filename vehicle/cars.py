"""Cars: a data file each, checked key by key, turned into the parameters of the plant."""

import json
import math
import re
from collections.abc import Callable, Iterable
from functools import lru_cache
from inspect import signature
from os import PathLike, fspath
from pathlib import Path
from typing import Any, NamedTuple

from steer_env.friction import defaults, resolve
from steer_env.friction import make as make_law
from steer_env.friction.numerics import toml
from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.kernel import record
from steer_env.vehicle import road, tyre
from steer_env.vehicle.chassis.single_track import SingleTrack
from steer_env.vehicle.chassis.two_track import Body, TwoTrack, brakes, drivetrain, speed_hold
from steer_env.vehicle.constants import AIR_DENSITY, GRAVITY
from steer_env.vehicle.plant import Plant
from steer_env.vehicle.steering import column, eps
from steer_env.vehicle.suspension import kinematics_table
from steer_env.vehicle.suspension.macpherson import MacPherson

DATA = Path(__file__).parent / "data"

# Held speeds [m/s]: a single track rolls at constant speed; two tracks stand and park as well.
SPEED_MIN, SPEED_MAX = 3.0, 70.0
SPEEDS = {"single_track": (SPEED_MIN, SPEED_MAX), "two_track": (0.0, SPEED_MAX)}
LOAD_TIME = 0.02  # time constant of the geometric load transfer, assumed [s]

# A standing tyre, after Gough: torsion up to mu F_z^1.5/(3 sqrt p), which is 144 N m at mu 0.9, 3700 N and 2.2 bar.
BORE_FRICTION, BORE_LOAD, PRESSURE = 0.9, 4000.0, 220e3  # [1], [N], [Pa]
BORE_TWIST = 0.05  # turning of the patch that takes up two thirds of it, assumed [rad]
BORE_RELAXATION = 0.1  # rolling that wipes it out, about half a contact length, assumed [m]
SLIP_DAMPING = (0.012, 0.06)  # of standing tyres, some 0.3 of critical on a wheel, on the car; assumed [s/m]

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
    "pitch_inertia",
    "wheel_inertia",
    "front_bump_clearance",
    "rear_bump_clearance",
    "bump_stiffness",
    "rear_bump_steer",
    "rear_camber_gain",
    "rear_lateral_compliance",
    "front_lift_area",
    "rear_lift_area",
)
# Overall size, which lane-change courses need and no equation of motion does.
_SIZE = ("length", "width")
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
_SIGNED = {"rear_bump_steer", "rear_camber_gain", "rear_lateral_compliance", "front_lift_area", "rear_lift_area"}
# Sections whose keys are the keyword arguments of a constructor, which checks them.
_MADE: dict[str, Callable[..., Any]] = {
    "column": column.make,
    "assist": eps.make,
    "drivetrain": drivetrain.make,
    "brakes": brakes.make,
    "speed_hold": speed_hold.make,
}
_SECTIONS = ("name", "description", "source", "assumed", "tyre", "strut", "chassis", "steering", *_MADE)


class Car(NamedTuple):
    """A checked car; :func:`load` makes one."""

    name: str
    description: str
    source: str
    chassis: dict[str, float]  # as in the data file, SI
    steering: dict[str, float]  # as in the data file, SI
    column: column.Column
    assist: eps.Assist
    drivetrain: drivetrain.Drivetrain
    brakes: brakes.Brakes
    speed_hold: speed_hold.SpeedHold
    tyre: tyre.Tyre
    strut: MacPherson
    strut_map: kinematics_table.StrutMap

    def plant(
        self,
        friction: Any = "lugre",
        speed: float = 100.0 / 3.6,
        robot: bool = False,
        road_friction: float = 1.0,
        chassis: str = "single_track",
        road: road.Road | None = None,
    ) -> Plant:
        """The plant of this car with a friction law, at a speed.

        Parameters
        ----------
        friction : str or parameters
            A law's name, for its defaults, or parameters from ``friction.make``.
        speed : float
            Held speed, 3 to 70; on two tracks from 0 [m/s].
        robot : bool
            Whether the handwheel angle is prescribed; else the hand torque is.
        road_friction : float
            Relative to the tyre's measurements, 0.1 to 1.2.
        chassis : {"single_track", "two_track"}
        road : Road, optional
            Heights, friction of each side, grade and bank, for ``chassis="two_track"``; level and dry by default.

        Raises
        ------
        ValueError
            Unknown law or chassis, or a value outside its range.
        """
        if chassis not in SPEEDS:
            raise ValueError(f"chassis must be one of {', '.join(SPEEDS)}, got {chassis!r}")
        if road is not None and chassis != "two_track":
            raise ValueError(f"road needs chassis='two_track', got chassis={chassis!r}")
        low, high = SPEEDS[chassis]
        v_x = number("speed [m/s]", speed, minimum=low, maximum=high)
        mu = number("road_friction", road_friction, minimum=0.1, maximum=1.2)
        # Symmetric, or the car would pull to one side; and without the longitudinal shift, which at zero slip would
        # brake by 4 % of the load (the rolling resistance of the set is 1 %) and above 8 kN even drive.
        coefficients = self.tyre.symmetric().coefficients._replace(PHX1=0.0, PHX2=0.0)
        s = self.steering
        p = Plant(
            column=self.column,
            assist=self.assist,
            friction=resolve(friction),
            chassis=self._single_track(v_x, mu) if chassis == "single_track" else self._two_track(v_x, mu, road),
            strut=self.strut_map,
            tyre=record(coefficients),
            pinion_radius=s["pinion_radius"],
            friction_load=s["friction_load"] * s["pinion_radius"] / defaults.F_C,
            rack_limit=s["rack_limit"],
            robot=1.0 if robot else 0.0,
        )
        return frozen(p)

    def loaded(self, mass: float) -> "Car":
        """The car with mass added at its centre of gravity [kg], spread around it as the body's own is."""
        c = self.chassis
        body, whole = (c["sprung_mass"] + mass) / c["sprung_mass"], (c["mass"] + mass) / c["mass"]
        changed = {"mass": c["mass"] + mass, "sprung_mass": c["sprung_mass"] + mass}
        changed |= {key: body * c[key] for key in ("roll_inertia", "pitch_inertia")}  # of the body
        return self._replace(chassis={**c, **changed, "yaw_inertia": whole * c["yaw_inertia"]})  # of the whole car

    def _rack_stiffness(self) -> float:
        """Steering compliance seen at the rack, through the arm at centre, for both wheels [N/m]."""
        return self.steering["compliance"] * float(self.strut.solve(0.0, 0.0).per_rack.rotation[..., 2]) ** 2

    def _single_track(self, v_x: float, mu: float) -> SingleTrack:
        c = self.chassis
        roll_centre = float(self.strut.solve(0.0, 0.0).roll_centre_height)
        axle_height = (roll_centre * c["rear_axle"] + c["rear_roll_centre"] * c["front_axle"]) / (
            c["front_axle"] + c["rear_axle"]
        )
        h = c["sprung_height"] - axle_height
        return SingleTrack(
            v_x=v_x,
            mu=mu,
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
            K_rack=self._rack_stiffness(),
            T_rack=c["compliance_time"],
            T_load=LOAD_TIME,
            T_drive=c["speed_hold_time"],
        )

    def _two_track(self, v_x: float, mu: float, ground: road.Road | None) -> TwoTrack:
        c, tyres, R_l = self.chassis, self.tyre, self.strut.loaded_radius
        # What the nodes of 2 ms can follow, found by trial.
        for name, value, least in (
            (
                "wheel_inertia times the tyre's longitudinal relaxation length [kg m3]",
                c["wheel_inertia"] * tyres.longitudinal_relaxation_length,
                0.13,
            ),
            ("the tyre's lateral relaxation length [m]", tyres.relaxation_length, 0.15),
            ("the inverse of the tyre's vertical stiffness [m/N]", 1.0 / tyres.vertical_stiffness, 1.0 / 1.5e6),
        ):
            number(f"{name} on two tracks", value, minimum=least)
        ground = ground or road.make_road()
        m, m_s, a, b = c["mass"], c["sprung_mass"], c["front_axle"], c["rear_axle"]
        m_f, m_r = 0.5 * c["front_unsprung_mass"], 0.5 * (m - m_s - c["front_unsprung_mass"])
        # The sprung centre of gravity, from that of the whole car.
        h = (m_s * c["sprung_height"] + (m - m_s) * R_l) / m
        x_s, z_s, z_w = -2.0 * (m_f * a - m_r * b) / m_s, c["sprung_height"] - h, R_l - h
        g_x, g_y, g_z = (
            -GRAVITY * math.sin(ground.grade),
            -GRAVITY * math.cos(ground.grade) * math.sin(ground.bank),
            -GRAVITY * math.cos(ground.grade) * math.cos(ground.bank),
        )
        F_zf, F_zr = 0.5 * GRAVITY * m * b / (a + b), 0.5 * GRAVITY * m * a / (a + b)
        slope = float(self.strut.solve(0.0, 0.0).per_travel.strut_length)  # negative: shorter in bump
        body = Body(
            speed=v_x,
            mu=mu,
            m=m,
            m_f=m_f,
            m_r=m_r,
            a=a,
            b=b,
            I_x=c["roll_inertia"] + m_s * z_s**2 + (m - m_s) * z_w**2,
            I_y=c["pitch_inertia"] + m_s * (x_s**2 + z_s**2) + (m - m_s) * z_w**2,
            I_z=c["yaw_inertia"],
            I_xz=m_s * x_s * z_s + 2.0 * (m_f * a - m_r * b) * z_w,
            I_w=c["wheel_inertia"],
            h=h,
            t_f=c["front_track"],
            t_r=c["rear_track"],
            R_l=R_l,
            R_e=R_l + 2.0 / 3.0 * F_zf / tyres.vertical_stiffness,
            K_t=tyres.vertical_stiffness,
            F_zf=F_zf,
            F_zr=F_zr,
            S_f=(m_f * GRAVITY - F_zf) / slope,
            K_f=c["front_spring"] / slope**2,
            C_f=c["front_damper"] / slope**2,
            S_r=F_zr - m_r * GRAVITY,
            K_r=c["rear_spring"],
            C_r=c["rear_damper"],
            B_f=c["front_anti_roll"] / c["front_track"] ** 2,
            B_r=c["rear_anti_roll"] / c["rear_track"] ** 2,
            clearance_f=c["front_bump_clearance"],
            clearance_r=c["rear_bump_clearance"],
            K_stop=c["bump_stiffness"],
            steer_r=c["rear_bump_steer"],
            camber_r=c["rear_camber_gain"],
            compliance_steer_r=c["rear_lateral_compliance"],
            contact_y_r=2.0 * c["rear_roll_centre"] / c["rear_track"],
            K_rack=self._rack_stiffness(),
            T_rack=c["compliance_time"],
            sigma_x=tyres.longitudinal_relaxation_length,
            sigma_y=tyres.relaxation_length,
            d_x=SLIP_DAMPING[0],
            d_y=SLIP_DAMPING[1],
            bore_load=BORE_LOAD,
            sigma_z=BORE_RELAXATION,
            g_x=g_x,
            g_y=g_y,
            g_z=g_z,
            drag=0.5 * AIR_DENSITY * c["drag_area"],
            lift_f=0.5 * AIR_DENSITY * c["front_lift_area"],
            lift_r=0.5 * AIR_DENSITY * c["rear_lift_area"],
        )
        pressure = tyres.coefficients.NOMPRES or PRESSURE  # that of the file, if it tells
        saturated = BORE_FRICTION * BORE_LOAD**1.5 / (3.0 * math.sqrt(pressure))
        bore_friction = make_law("dahl", sigma_0=saturated / BORE_TWIST, F_c=saturated)
        return TwoTrack(record(body), bore_friction, self.drivetrain, self.brakes, self.speed_hold, ground)


def _known(where: str, given: Any, allowed: Iterable[str]) -> None:
    if not isinstance(given, dict):
        raise ValueError(f"{where} must hold keys and values, got {given!r}")
    for key in given:
        if key not in allowed:
            raise ValueError(f"{where} has no key {key!r}; it takes: {', '.join(allowed)}")


# Beyond these the plant's tables or its 1 ms step would answer, but wrongly.
_LIMITS = {
    "rack_limit": (0.0, 0.075),  # [m]; the strut's table ends there
    "mass": (100.0, 10e3),  # [kg]; here and below, what can be a car at all in SI units
    "front_track": (0.5, 3.0),  # [m]
    "rear_track": (0.5, 3.0),  # [m]
    "front_axle": (0.1, 5.0),  # [m]
    "rear_axle": (0.1, 5.0),  # [m]
    "length": (1.0, 15.0),  # [m]
    "width": (0.5, 3.0),  # [m]
    "sprung_height": (0.1, 2.0),  # [m]
    "compliance_time": (0.004, math.inf),  # [s]; two chassis nodes
    "speed_hold_time": (0.004, math.inf),  # [s]
    "front_damper": (0.0, 12e3),  # [N s/m]; beyond, a wheel is too fast for two tracks' nodes of 2 ms
    "rear_damper": (0.0, 12e3),  # [N s/m]
}


def _require(where: str, given: Any, allowed: tuple[str, ...], optional: tuple[str, ...] = ()) -> None:
    _known(where, given, (*allowed, *optional))
    for key in allowed:
        if key not in given:
            raise ValueError(f"{where} lacks the key {key!r}")


def _numbers(where: str, given: dict, allowed: tuple[str, ...], optional: tuple[str, ...] = ()) -> dict[str, float]:
    _require(where, given, allowed, optional)
    checked = {}
    for key, value in given.items():
        low, high = _LIMITS.get(key, (0.0, math.inf))
        if key in _SIGNED:
            low = -math.inf
        above = low == 0.0 and key not in _MAY_BE_ZERO
        if isinstance(value, str | bool):  # float() takes them
            raise ValueError(f"{where}.{key} must be a number, got {value!r}")
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
    chassis = _numbers("chassis", data["chassis"], _CHASSIS, _SIZE)
    rest = chassis["mass"] - chassis["sprung_mass"] - chassis["front_unsprung_mass"]
    if rest <= 0.0:
        raise ValueError(
            f"chassis.mass must exceed sprung_mass + front_unsprung_mass, the rear axle is left {rest:g} kg"
        )
    if rest > 3.0 * chassis["front_unsprung_mass"]:
        raise ValueError(
            "chassis.mass leaves the rear axle an unsprung mass of"
            f" {rest:g} kg, more than 3 times front_unsprung_mass; change sprung_mass with it"
        )
    for section, make in _MADE.items():
        _known(section, data[section], signature(make).parameters)
    steering = _numbers("steering", data["steering"], _STEERING)
    assumed = {*data, *chassis, *steering}
    for key in data["assumed"]:
        if key not in assumed:
            raise ValueError(f"assumed names {key!r}, which is neither a section nor a key of chassis or steering")
    strut = MacPherson.load(data["strut"]).at_track(chassis["front_track"])
    return Car(
        name=data["name"],
        description=data["description"],
        source=data["source"],
        chassis=chassis,
        steering=steering,
        **{section: make(**data[section]) for section, make in _MADE.items()},
        tyre=tyre.load(data["tyre"]),
        strut=strut,
        strut_map=kinematics_table.build(strut),
    )


def available() -> tuple[str, ...]:
    """Names of the packaged cars."""
    names = (file.stem for file in DATA.glob("*.json"))
    return tuple(sorted(name for name in names if not name.startswith(("macpherson_", "tyre_"))))


def load(name: str | PathLike[str] = "compact") -> Car:
    """A packaged car by name, or a car of your own from a ``.toml`` or ``.json`` file.

    A file has the sections of the packaged ones (``vehicle/data``), in SI. With a key ``base`` it takes what it lacks
    from that packaged car. A tyre file (``tyre = "my.tir"``) is looked for beside the car's file.

    Raises
    ------
    ValueError
        An unknown name, with those there are; or in a file, with its name and line: a syntax error, an unknown or
        missing key, a value outside its range.
    OSError
        A file that cannot be read.
    """
    if not isinstance(name, str | PathLike):
        raise ValueError(f"vehicle must be a name or a path, got a {type(name).__name__}")
    text = fspath(name)
    if text.endswith((".toml", ".json")):
        return _from_file(Path(text))
    return _packaged(text)


@lru_cache
def _packaged(name: str) -> Car:
    return from_data(_data(name))


def _data(name: str) -> dict[str, Any]:
    if name not in available():
        raise ValueError(f"vehicle must be a .toml or .json file or one of {', '.join(available())}, got {name!r}")
    return json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))


def _from_file(path: Path) -> Car:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{path}: expected text in UTF-8") from None
    try:
        data = toml.loads(text) if path.suffix == ".toml" else json.loads(text)
    except ValueError as error:  # both parsers tell the line
        raise ValueError(f"{path}: {error}") from None
    try:
        if isinstance(data, dict) and "base" not in data and not set(_SECTIONS) <= set(data):
            _known("car", data, _SECTIONS)
            lacking = ", ".join(key for key in _SECTIONS if key not in data)
            raise ValueError(f"car lacks {lacking}; give them, or a base: {', '.join(available())}")
        if isinstance(data, dict) and "base" in data:
            if data["base"] not in available():
                raise ValueError(f"base must be one of {', '.join(available())}, got {data['base']!r}")
            base = _data(data.pop("base"))
            _known("car", data, _SECTIONS)
            sections = {key: {**base[key], **value} for key, value in data.items() if isinstance(value, dict)}
            data = {**base, "name": path.stem, **data, **sections}
        if isinstance(data, dict) and str(data.get("tyre", "")).endswith(".tir"):
            data["tyre"] = str(path.parent / data["tyre"])
        return from_data(data)
    except (ValueError, OSError) as error:
        raise ValueError(f"{path}:{_line(text, str(error))} {error}") from None


def _line(text: str, message: str) -> str:
    """Number of the first line that sets a key which the message names, with a colon; nothing if none does."""
    named = set(re.findall(r"\w+", message.split(";")[0]))
    for pattern in (r"""\s*["']?(\w+)["']?\s*[=:]\s*(?!\{)""", r"""\s*(?:\[|["'])(\w+)"""):  # keys, then sections
        for i, line in enumerate(text.splitlines(), 1):
            key = re.match(pattern, line)
            if key and key.group(1) in named:
                return f"{i}:"
    return ""


def every_key(name: str) -> dict[str, Any]:
    """The data of a packaged car with the defaults of every section: all that a car file may set, SI."""
    data = _data(name)
    for section, make in _MADE.items():
        defaults = {key: p.default for key, p in signature(make).parameters.items()}
        data[section] = {**defaults, **data[section]}
    return data


def rack_ratio(car: Car) -> float:
    """Overall steering ratio at centre: handwheel angle per road-wheel angle [1]."""
    return 1.0 / (car.steering["pinion_radius"] * float(car.strut.solve(0.0, 0.0).per_rack.rotation[..., 2]))
