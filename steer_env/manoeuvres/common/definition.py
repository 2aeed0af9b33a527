"""What a manoeuvre is, and the registry of them."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.registry import Registry, dashed
from steer_env.vehicle import plant
from steer_env.vehicle.cars import Car
from steer_env.vehicle.road import Road

Array = NDArray[np.float64]
Reach = Callable[[Array], float]  # lateral acceleration (T,) at 1 kHz [m/s2] -> what counts as reached [m/s2]


def last_second(acceleration: Array) -> float:
    """Mean over the last second."""
    return float(np.mean(acceleration[-1000:]))


def half_span(acceleration: Array) -> float:
    """Half of highest less lowest over the second half."""
    return 0.5 * float(np.ptp(acceleration[acceleration.size // 2 :]))


@dataclass(frozen=True)
class Manoeuvre:
    """One manoeuvre.

    ``hand(t, amplitude)`` gives the handwheel angle [rad] and speed [rad/s] (robot) or the hand torque [N m] and zero.
    """

    name: str
    hands: str  # what they do
    source: str
    speed: float  # [m/s]
    duration: float  # [s]
    hand: Callable[[Array, float], tuple[Array, Array]]
    robot: bool = True
    released: tuple[float, ...] = ()  # a robot lets go, grips, lets go ... [s]; while free ``hand`` is a torque
    amplitude: float | None = None  # [rad] or [N m]; None: found for the lateral acceleration
    lateral_acceleration: float | None = None  # to reach [m/s2]
    reach: Reach = last_second  # reads from a run of ``trial`` what it reached
    trial: float | None = None  # duration of the run that finds the amplitude [s]; None: the whole
    frequency: float | None = None  # of a periodic manoeuvre [Hz]
    rig: bool = False  # steering on a rig: no rack load, assist off
    lock: bool = False  # the amplitude is all that the rack has
    chassis: str = "single_track"  # two_track where the car must be able to stand or to change its speed
    # Closes the loop in place of ``hand``: called every 10 ms with time [s] and channels (C,), it gives handwheel angle
    # [rad] and speed [rad/s] 10 ms later.
    driver: Callable[[Car, plant.Plant], Callable[[float, Array], tuple[float, float]]] | None = None
    ends_at: float | None = None  # x at which a closed loop ends, before its duration is over [m]
    coasts_from: float | None = None  # x from which a closed loop runs with the speed hold off; two_track only [m]
    road: Road | None = None  # heights, split friction, grade, bank; two_track only
    others: Mapping[int, Callable[[Array], Array]] = field(default_factory=dict)  # further plant inputs over time
    meta: Mapping[str, Any] = field(default_factory=dict)  # conditions that the metrics need, units in the names

    @property
    def definition(self) -> str:
        """What is driven, in words."""
        aim = f", amplitude for {self.lateral_acceleration:g} m/s2" if self.lateral_acceleration else ""
        place = "on a rig" if self.rig else f"at {3.6 * self.speed:.4g} km/h" if self.speed else "at standstill"
        return f"{self.hands}{aim} {place}."


MANOEUVRES: Registry[Callable[..., Manoeuvre]] = Registry("manoeuvre", "steer_env.manoeuvres", dashed)


def register(name: str) -> Callable[[Callable[..., Manoeuvre]], Callable[..., Manoeuvre]]:
    """Make a manoeuvre known under a name: a function that gives it, its options with their standard values."""

    return partial(MANOEUVRES.register, name)


def available() -> tuple[str, ...]:
    """Names of the manoeuvres."""
    return MANOEUVRES.available()


def options(name: str) -> tuple[str, ...]:
    """Options of a manoeuvre; ValueError for a name that there is not."""
    return tuple(inspect.signature(MANOEUVRES[name]).parameters)


def make(name: str, **chosen: Any) -> Manoeuvre:
    """A manoeuvre by name, as the standard has it but for the options; ValueError for a name or option there is not."""
    allowed = options(name)
    for key in chosen:
        if key not in allowed:
            raise ValueError(f"{name} has no option {key!r}; there are {', '.join(allowed) or 'none'}")
    return MANOEUVRES[name](**chosen)
