"""Conditions of an episode that are drawn at every reset: load, road, friction, speed, sensors.

What is not drawn is as in the car, unloaded on a dry road, with perfect sensors.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import product
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from steer_env import friction
from steer_env.courses.preview import PREVIEW_NAMES
from steer_env.friction import level
from steer_env.friction.numerics.check import number
from steer_env.vehicle import cars, step_limit
from steer_env.vehicle.cars.car import load_rate
from steer_env.vehicle.plant import Plant

# Name: smallest and largest value, meaning.
RANGES = {
    "load": (0.0, 500.0, "mass added to the body [kg]"),
    "road_friction": (0.1, 1.2, "friction of the road relative to that of the tyre's measurements [1]"),
    "friction_level": (0.1, 5.0, "factor on the law's saturated friction torque [1]"),
    "friction_load": (0.0, 1.0, "friction torque over the rack force's torque on the pinion [1]"),
    "friction_asymmetry": (*level.LIMITS["asymmetry"], "relative increase of the friction to the left [1]"),
    "friction_position": (*level.LIMITS["position"], "relative increase of the friction by position, at its peak [1]"),
    "speed": (0.0, cars.SPEED_MAX, "held speed [m/s]"),
    "sensor_noise": (0.0, 10.0, "factor on the standard deviations of the sensors' noise [1]"),
    "delay": (0.0, 0.2, "delay of the observation, rounded to whole control steps [s]"),
    "action_gain": (0.1, 2.0, "factor on the action's effect, as of an actuator stronger than it should be [1]"),
    "action_lag": (0.0, 0.2, "first-order lag of the torque behind the action; muscles of the driver models: 0.05 [s]"),
}
OF_MOTION = ("load", "road_friction", "speed")  # that change how a car runs straight ahead
OF_FRICTION = ("friction_level", "friction_load", "friction_asymmetry", "friction_position")
_of_motion, _of_friction = attrgetter(*OF_MOTION), attrgetter(*OF_FRICTION)
LIMITS = {name: (low, high) for name, (low, high, _) in RANGES.items()}
# Standard deviations of white noise at each control step, as good production sensors have; assumed [SI].
SENSOR_NOISE = {
    "handwheel_angle": 0.001,
    "handwheel_speed": 0.02,
    "torsion_bar_torque": 0.02,
    "lateral_acceleration": 0.05,
    "yaw_rate": 0.002,
    "lateral_speed": 0.05,
    "column_speed": 0.02,
    "motor_torque": 0.1,
    "return_error": 0.001,
    "return_speed_error": 0.02,
    "lateral_offset": 0.02,
    "heading_error": 0.002,
    "speed": 0.05,
    **dict.fromkeys(PREVIEW_NAMES, 0.05),
}


class Conditions(NamedTuple):
    """What is drawn for one episode; :data:`RANGES` tells the meanings."""

    load: float  # [kg]
    road_friction: float  # [1]
    friction_level: float  # [1]
    friction_load: float  # [1]
    friction_asymmetry: float  # [1]
    friction_position: float  # [1]
    speed: float  # [m/s]
    sensor_noise: float  # [1]
    delay: float  # [s]
    action_gain: float  # [1]
    action_lag: float  # [s]
    friction: Any  # the law's parameters
    drawn: tuple[tuple[str, float], ...] = ()  # name and value of those of them that ``randomise`` draws [their units]

    def same_plant(self, other: "Conditions") -> bool:
        """Whether plant and start are those of other conditions of the same environment."""
        return self.friction is other.friction and _of_friction(self) == _of_friction(other) and self.same_motion(other)

    def same_motion(self, other: "Conditions") -> bool:
        """Whether the car runs straight ahead as in other conditions of the same environment."""
        return bool(_of_motion(self) == _of_motion(other))

    def values(self, names: Sequence[str]) -> list[float]:
        """Values by name: keys of :data:`RANGES`, and ``friction_<parameter>`` of the law; NaN where there is none."""
        law = {f"friction_{name}": value for name, value in self.drawn}
        return [float(law[name] if name in law else getattr(self, name, math.nan)) for name in names]


def undrawn(car: cars.Car, law: Any, speed: float) -> Conditions:
    """The conditions if nothing is drawn, of a law's parameters and a held speed [m/s]."""
    s = car.steering
    return Conditions(
        load=0.0,
        road_friction=1.0,
        friction_level=1.0,
        friction_load=s["friction_load"],
        friction_asymmetry=s["friction_asymmetry"],
        friction_position=s["friction_position"],
        speed=speed,
        sensor_noise=0.0,
        delay=0.0,
        action_gain=1.0,
        action_lag=0.0,
        friction=law,
    )


def with_level(p: Plant, drawn: Conditions) -> Plant:
    """A plant with the drawn level of friction.

    Raises
    ------
    ValueError
        Its friction falls too steeply with the speed (:mod:`steer_env.vehicle.step_limit`).
    """
    changed = p.level._replace(
        load=load_rate(drawn.friction_load, p.pinion_radius),
        asymmetry=drawn.friction_asymmetry,
        position=drawn.friction_position,
    )
    return step_limit.checked(p._replace(level=changed, friction_torque_scale=drawn.friction_level))


class Randomise:
    """Checked ranges of an environment, and the draws from them.

    Parameters
    ----------
    ranges : mapping
        Keys of ``RANGES`` to (low, high); and under ``"friction"`` a mapping of the law's own parameters, such as
        ``{"F_c": (0.5, 1.5)}``, of several sites ``{"gear.F_c": (0.5, 1.5)}``.
    law : str, mapping or parameters
        The environment's friction, in a form of ``friction.resolve``. Parameters that are not drawn are those that it
        gives, else the law's defaults.
    speed : float
        Held speed where it is not drawn [m/s].
    car : Car
        Gives the influence of load, direction and position on the friction where that is not drawn.
    limits : mapping of str to (float, float)
        Keys of ``RANGES`` that the environment takes, with the smallest and largest value: ``LIMITS`` with the speeds
        of the chassis.

    Attributes
    ----------
    corners : list of Conditions
        The law with each combination of the ends of its ranges, and each end with the most friction.

    Raises
    ------
    ValueError
        A key is unknown, a range is not a pair or is inverted, or a value is out of range.
    """

    def __init__(
        self,
        ranges: Mapping[str, Any] | None,
        law: Any,
        speed: float,
        car: cars.Car,
        limits: Mapping[str, tuple[float, float]],
    ) -> None:
        self._limits = limits
        self._usual = undrawn(car, friction.resolve(law), speed)
        self._friction = law
        if ranges is None:
            ranges = {}
        if not isinstance(ranges, Mapping):
            raise ValueError(f"randomise must map names to (low, high), got {ranges!r}")
        for key in ranges:
            if key not in limits and key != "friction":
                raise ValueError(f"randomise has no {key!r}; it takes: {', '.join(limits)}, friction")
        self._ranges = {name: self._pair(name, pair) for name, pair in ranges.items() if name != "friction"}
        self._law: dict[str, tuple[float, float]] = {}
        own = ranges.get("friction", {})
        if not isinstance(own, Mapping):
            raise ValueError(f"randomise['friction'] must map the law's parameters to (low, high), got {own!r}")
        self._law = {name: self._pair(f"friction.{name}", pair) for name, pair in own.items()}
        # each corner must give valid parameters
        laws = [self._make(dict(zip(self._law, corner))) for corner in product(*self._law.values())]
        levels = {name: pair for name, pair in self._ranges.items() if name.startswith("friction_")}
        most: dict[str, Any] = {name: max(pair, key=abs) for name, pair in levels.items()}
        self.corners = [self._usual._replace(friction=law, **most) for law in laws]

    def _pair(self, name: str, pair: Any) -> tuple[float, float]:
        try:
            low, high = pair
        except (TypeError, ValueError):
            raise ValueError(f"randomise[{name!r}] must be (low, high), got {pair!r}") from None
        least, most = self._limits.get(name, (-np.inf, np.inf))
        low, high = (number(f"randomise[{name!r}]", value, minimum=least, maximum=most) for value in (low, high))
        if low > high:
            raise ValueError(f"randomise[{name!r}] must be (low, high) with low <= high, got {pair!r}")
        return low, high

    def _make(self, drawn: Mapping[str, float]) -> Any:
        return friction.varied(self._friction, drawn) if drawn else self._usual.friction

    def draw(self, rng: np.random.Generator, fixed: Mapping[str, Any]) -> Conditions:
        """Conditions of an episode; ``fixed`` are reset options, which replace what is drawn."""
        drawn = {name: float(rng.uniform(*pair)) for name, pair in self._ranges.items()}
        own = {name: float(rng.uniform(*pair)) for name, pair in self._law.items()}
        for name, value in fixed.items():
            low, high = self._limits[name]
            drawn[name] = number(f"reset option {name!r}", value, minimum=low, maximum=high)
        return self._usual._replace(friction=self._make(own), drawn=tuple(own.items()), **drawn)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the conditions, for :meth:`Conditions.values`; of the law's parameters those that are drawn."""
        return (*RANGES, *(f"friction_{name}" for name in self._law))

    @property
    def usual(self) -> Conditions:
        """The conditions if nothing is drawn."""
        return self._usual
