"""What a manoeuvre is, and how a manoeuvre is registered and made."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.manoeuvres.common.registry import MANOEUVRES
from steer_env.vehicle import plant
from steer_env.vehicle.cars import Car
from steer_env.vehicle.road import Road

Array = NDArray[np.float64]
Reach = Callable[[Array], float]  # lateral acceleration (T,) at 1 kHz -> the value that it has reached [m/s2]


def last_second(acceleration: Array) -> float:
    """Mean over the last second."""
    return float(np.mean(acceleration[-1000:]))


def half_span(acceleration: Array) -> float:
    """Half of the difference between the highest and the lowest value in the second half."""
    return 0.5 * float(np.ptp(acceleration[acceleration.size // 2 :]))


@dataclass(frozen=True)
class Manoeuvre:
    """One manoeuvre.

    ``hand(t, amplitude)`` returns the handwheel angle [rad] and speed [rad/s] of a steering robot, or the hand torque
    [N m] and zero.
    """

    name: str
    hands: str  # motion of the hands, in words
    source: str
    speed: float  # [m/s]
    duration: float  # [s]
    hand: Callable[[Array, float], tuple[Array, Array]]
    robot: bool = True
    # Times at which a robot lets go, grips, lets go, ... [s]; while it is free, `hand` is a torque.
    released: tuple[float, ...] = ()
    amplitude: float | None = None  # [rad] or [N m]; None: found so that the car reaches the lateral acceleration
    lateral_acceleration: float | None = None  # that the car shall reach [m/s2]
    reach: Reach = last_second  # the value that a run of the duration `trial` has reached
    trial: float | None = None  # duration of the runs that find the amplitude [s]; None: the whole duration
    frequency: float | None = None  # of a periodic manoeuvre [Hz]
    rig: bool = False  # steering on a rig: no rack load, no assist
    lock: bool = False  # the amplitude is the whole travel of the rack
    chassis: str = "single_track"  # two_track where the car must stand or change its speed
    # Closes the loop and replaces `hand`. It is called every 10 ms with the time [s] and the channels (C,), and returns
    # the handwheel angle [rad] and speed [rad/s] 10 ms later.
    driver: Callable[[Car, plant.Plant], Callable[[float, Array], tuple[float, float]]] | None = None
    ends_at: float | None = None  # x at which a closed loop ends if its duration is not over before [m]
    coasts_from: float | None = None  # x from which a closed loop runs without speed control; two_track only [m]
    road: Road | None = None  # heights, split friction, grade and bank; two_track only
    others: Mapping[int, Callable[[Array], Array]] = field(default_factory=dict)  # plant input -> values over time
    meta: Mapping[str, Any] = field(default_factory=dict)  # conditions for the metrics, with units in the names

    @property
    def definition(self) -> str:
        """The manoeuvre in words."""
        aim = f", amplitude for {self.lateral_acceleration:g} m/s2" if self.lateral_acceleration else ""
        place = "on a rig" if self.rig else f"at {3.6 * self.speed:.4g} km/h" if self.speed else "at standstill"
        return f"{self.hands}{aim} {place}."


def register(name: str) -> Callable[[Callable[..., Manoeuvre]], Callable[..., Manoeuvre]]:
    """Register the decorated function under a name. It returns a manoeuvre; its arguments are the manoeuvre's options.

    The defaults of the arguments are the values of the standard test.
    """
    return partial(MANOEUVRES.register, name)


def options(name: str) -> tuple[str, ...]:
    """Names of the options of a manoeuvre; ValueError for an unknown manoeuvre."""
    return tuple(inspect.signature(MANOEUVRES[name]).parameters)


def make(name: str, **chosen: Any) -> Manoeuvre:
    """A manoeuvre by name, with the values of the standard test except for the chosen options.

    ValueError for an unknown manoeuvre or option.
    """
    allowed = options(name)
    for key in chosen:
        if key not in allowed:
            raise ValueError(f"{name} has no option {key!r}; there are {', '.join(allowed) or 'none'}")
    return MANOEUVRES[name](**chosen)
