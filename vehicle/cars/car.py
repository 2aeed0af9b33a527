"""A checked car, and the plant that it makes at a speed with a friction law and a chassis."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from steer_env.friction import defaults, level, resolve
from steer_env.friction.numerics import shown
from steer_env.friction.numerics.check import number
from steer_env.friction.numerics.frozen import frozen, rebuilt
from steer_env.friction.numerics.kernel import record
from steer_env.vehicle import chassis as chassis_models
from steer_env.vehicle import road, step_limit, tyre
from steer_env.vehicle.cars import contents
from steer_env.vehicle.chassis.two_track import brakes, drivetrain, speed_hold
from steer_env.vehicle.keys import declared_keys
from steer_env.vehicle.plant import Plant
from steer_env.vehicle.steering import column, eps
from steer_env.vehicle.steering.by_wire import handwheel_lock, ratio_at
from steer_env.vehicle.steering.kinds import common as kinds
from steer_env.vehicle.suspension.kinematics_table import KinematicsTable
from steer_env.vehicle.suspension.macpherson import MacPherson


class _Speeds(Mapping[str, tuple[float, float]]):
    """Lowest and highest held speed [m/s] by the name of the chassis; imports a chassis when asked for its speeds."""

    def __getitem__(self, name: str) -> tuple[float, float]:
        if name not in chassis_models.CHASSIS:
            raise KeyError(name)
        return chassis_models.CHASSIS[name].speeds

    def __iter__(self) -> Iterator[str]:
        return iter(chassis_models.available())

    def __len__(self) -> int:
        return len(chassis_models.available())

    def __contains__(self, name: object) -> bool:
        return name in chassis_models.CHASSIS


SPEEDS = _Speeds()
ROAD_FRICTION = (0.1, 1.2)  # of the road over that of the tyre measurements, as a plant takes it [1]


def load_rate(friction_load: float, pinion_radius: float) -> float:
    """c_F of (F11) [1/N] that makes the friction of the default level grow by a share of the rack's torque [1]."""
    return friction_load * pinion_radius / defaults.F_C


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
    kinematics_table: KinematicsTable  # of the strut
    given: Mapping[str, Any]  # contents of the data file with what it takes from its base, SI

    @property
    def kind(self) -> str:
        """The kind of its steering: ``column_eps``, or the section of the car file that gives another one."""
        return kinds.kind_of_sections(self.given)

    @property
    def friction(self) -> str:
        """Its friction where none is given: LuGre, split over the sites of its kind of steering."""
        return f"lugre@{self.kind}"

    def __reduce__(self) -> tuple[Any, ...]:
        return rebuilt, (Car, *self)

    def __repr__(self) -> str:
        c, kind = self.chassis, self.kind.replace("_", " ")
        return f"<Car {self.name}: {c['mass']:g} kg, wheelbase {c['front_axle'] + c['rear_axle']:.4g} m, {kind}>"

    def _repr_html_(self) -> str:
        about, found = declared_keys(), self.data()
        rows = [
            {"key": f"{section}.{key}", "value": value, "unit": about[section][key].unit}
            | {"meaning": about[section][key].meaning}
            for section in about
            for key, value in found.get(section, {}).items()
        ]
        return shown.html(f"{self!r} {self.description}", rows)

    def data(self) -> dict[str, Any]:
        """Complete contents of a car file: every key with its value, in SI units, as JSON and TOML hold them.

        ``cars.load(car.data())`` is this car to the bit, and ``cars.write(car, path)`` writes a file of it. A packaged
        tyre is given by its name, any other by its coefficients.

        Raises
        ------
        ValueError
            A part was replaced (``car._replace``) by what no car file gives.
        """
        return contents.data(self)

    def plant(
        self,
        friction: Any = None,
        speed: float = 100.0 / 3.6,
        robot: bool = False,
        road_friction: float = 1.0,
        chassis: str = "single_track",
        road: road.Road | None = None,
    ) -> Plant:
        """The plant of this car with a friction law, at a speed.

        Parameters
        ----------
        friction : str, mapping or parameters, optional
            A law or sites, as :func:`steer_env.friction.resolve` takes them; by default its own (:attr:`friction`).
        speed : float
            Held speed, 3 to 70; with ``chassis="two_track"`` from 0 [m/s].
        robot : bool
            Whether the handwheel angle is prescribed; otherwise the hand torque is.
        road_friction : float
            Friction of the road over that of the tyre measurements, 0.1 to 1.2 [1].
        chassis : str
            A name of :func:`steer_env.vehicle.chassis.available`.
        road : Road, optional
            Heights, friction of each side, grade and bank, for ``chassis="two_track"``; level and dry by default.

        Raises
        ------
        ValueError
            Unknown law or chassis, a value outside its range, or a law whose torque falls too steeply with the speed
            (:mod:`steer_env.vehicle.step_limit`).
        """
        # An asymmetric tyre would pull the car to one side. The longitudinal shift would brake by 4 % of the load at
        # zero slip (the rolling resistance of the set is 1 %), and drive above 8 kN.
        coefficients = self.tyre.symmetric().coefficients._replace(PHX1=0.0, PHX2=0.0)
        s = self.steering
        p = Plant(
            column=self.column,
            assist=self.assist,
            friction=resolve(self.friction if friction is None else friction),
            chassis=self.running(speed, road_friction, chassis, road),
            strut=self.kinematics_table,
            tyre=record(coefficients),
            pinion_radius=s["pinion_radius"],
            level=level.make(
                load=load_rate(s["friction_load"], s["pinion_radius"]),
                **{key: s[f"friction_{key}"] for key in level.LIMITS},
            ),
            rack_limit=s["rack_limit"],
            robot=1.0 if robot else 0.0,
        )
        return frozen(step_limit.checked(p))

    def running(self, speed: float, road_friction: float, chassis: str, road: road.Road | None) -> Any:
        """The parameters of a chassis of this car; arguments and errors as of :meth:`plant`."""
        low, high = SPEEDS[chassis_models.checked(chassis)]
        v_x = number("speed [m/s]", speed, minimum=low, maximum=high)
        mu = number("road_friction", road_friction, minimum=ROAD_FRICTION[0], maximum=ROAD_FRICTION[1])
        return chassis_models.CHASSIS[chassis].from_car(self, v_x, mu, road)

    def loaded(self, mass: float) -> "Car":
        """The car with a mass added at its centre of gravity [kg], distributed as that of the body."""
        c = self.chassis
        body, whole = (c["sprung_mass"] + mass) / c["sprung_mass"], (c["mass"] + mass) / c["mass"]
        changed = {"mass": c["mass"] + mass, "sprung_mass": c["sprung_mass"] + mass}
        changed |= {key: body * c[key] for key in ("roll_inertia", "pitch_inertia")}  # of the body
        return self._replace(chassis={**c, **changed, "yaw_inertia": whole * c["yaw_inertia"]})  # of the whole car

    def steer_per_rack(self) -> float:
        """Change of the road-wheel angle per rack travel, straight ahead [rad/m]."""
        return float(self.strut.straight.per_rack.rotation[..., 2])

    def rack_stiffness(self) -> float:
        """Steering compliance of both wheels, seen at the rack straight ahead [N/m] (P5)."""
        return self.steering["compliance"] * self.steer_per_rack() ** 2  # (P5)

    def steering_gain(self, speed: float | None = None) -> float:
        """Road-wheel angle per handwheel angle, straight ahead, without compliance [1].

        By wire it depends on the vehicle speed [m/s]; without one it is that of the pinion.
        """
        by_wire = 1.0 if speed is None else ratio_at(self.assist.wire, speed)
        return self.steering["pinion_radius"] * self.steer_per_rack() * by_wire

    def steering_ratio(self, speed: float | None = None) -> float:
        """Handwheel angle per road-wheel angle, as :meth:`steering_gain` [1]."""
        return 1.0 / self.steering_gain(speed)

    def handwheel_lock(self, speed: float) -> float:
        """Handwheel angle at the end stop of the rack, without twist of a torsion bar, at a vehicle speed [rad]."""
        return handwheel_lock(self.steering["rack_limit"], self.steering["pinion_radius"], self.assist.wire, speed)
