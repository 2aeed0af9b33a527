"""The tuned parameters of the assist, each relative to the car's own value, and the assist that a parameter set makes.

    boost'(v, T) = level low(v) boost(v, T (T/T_n)^(progression - 1))     T_n: last torque of the table
    damping'(v)  = level low(v) damping(v)
    low(v)       = factor at standstill ^ max(1 - v/v_1, 0)               v_1 = 100 km/h

By wire the table is that of the feel over the handwheel angle A, with A_n = 1 rad, and the damping that of the
handwheel; the lead is not there, and changes nothing.

A position a, an action in [-1, 1] and the offset of the start (:mod:`steer_env.tuning.start`), gives a parameter the
value own * span^a: the car's own value at 0, and a valid one wherever the car's own is. The spans are assumed: as far
as an engineer would go, and further to where the loop's margins are lost.

The strength of a function of the assist (``FUNCTIONS``), which most cars do not have, is own (1 + a) below 0 and
own + reach a above: off at -1 and below, the car's own at 0. Keys that the function has besides stay the car's own, or
their defaults where the car does not have the function. ``TuneEnv(parameters=...)`` adds them to the action.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.frozen import frozen
from steer_env.vehicle import cars
from steer_env.vehicle.cars import Car
from steer_env.vehicle.keys import declared_keys
from steer_env.vehicle.steering import by_wire, eps, motor
from steer_env.vehicle.steering.assist import functions
from steer_env.vehicle.steering.by_wire import Wire
from steer_env.vehicle.steering.eps import SAMPLE_TIME, Assist

Array = NDArray[np.float64]

HIGH_SPEED = 100.0 / 3.6  # speed from which on a factor at standstill has no effect [m/s]
HIGHEST_CORNER = declared_keys()["assist"]["lead_zero"].high  # of the lead [Hz]


class Parameter(NamedTuple):
    """One parameter of the assist."""

    name: str
    unit: str
    span: float  # position 1 multiplies the car's own value by this, and position -1 divides it [1]
    meaning: str
    own: Callable[[Assist], float] = lambda a: 1.0  # the car's own value
    highest: float = np.inf  # limit of the value, whatever the span [unit]

    def value(self, a: Assist, position: float) -> float:
        """The value at a position for an assist [unit]."""
        return min(self.own(a) * self.span**position, self.highest)


class Strength(NamedTuple):
    """Strength of a function of the assist, the largest over the speeds; 0 is off."""

    name: str  # of the key in a car file
    unit: str
    reach: float  # what position 1 adds to the car's own value [unit]
    meaning: str
    highest: float  # limit of the value [unit]

    def own(self, a: Assist) -> float:
        """The car's own value [unit]."""
        return float(np.max(functions.keys(a.functions, SAMPLE_TIME).get(self.name, 0.0)))

    def value(self, a: Assist, position: float) -> float:
        """The value at a position for an assist [unit]."""
        own = self.own(a)
        return own * max(1.0 + position, 0.0) if position < 0.0 else min(own + self.reach * position, self.highest)


def _corner(which: int, a: Assist) -> float:
    return eps.lead_corners(a)[which]


PARAMETERS = {
    parameter.name: parameter
    for parameter in (
        Parameter("boost_level", "1", 2.5, "factor on the boost at every speed"),
        Parameter("boost_progression", "1", 1.5, "exponent on the boost curve's torque; above 1 the curve rises later"),
        Parameter("boost_low_speed", "1", 1.6, "further factor on the boost at standstill, 1 at 100 km/h"),
        Parameter("damping_level", "1", 4.0, "factor on the motor damping at every speed"),
        Parameter(
            "damping_low_speed",
            "1",
            3.0,
            "further factor on the motor damping at standstill, 1 at 100 km/h",
        ),
        Parameter("lead_zero", "Hz", 3.0, "lower corner of the phase lead", partial(_corner, 0), HIGHEST_CORNER),
        Parameter("lead_pole", "Hz", 2.0, "upper corner of the phase lead", partial(_corner, 1), HIGHEST_CORNER),
    )
}


FUNCTIONS = {
    strength.name: strength
    for strength in (
        Strength("return_gain", "N m/rad", 10.0, "stiffness of the active return about the centre", 200.0),
        Strength("handwheel_damping", "N m s/rad", 0.5, "damping of the handwheel", 10.0),
        Strength("friction_share", "1", 0.6, "share of the friction that is compensated", 1.0),
        Strength("inertia_compensation", "kg m2", 0.02, "inertia that is compensated", 1.0),
        Strength("lead_lag_gain", "1", 0.3, "gain of the lead-lag at 0 Hz", 10.0),
    )
}
KNOWN: dict[str, Parameter | Strength] = {**PARAMETERS, **FUNCTIONS}


def acting(a: Assist, names: tuple[str, ...]) -> tuple[str, ...]:
    """Those of the named parameters that an assist has: by wire there are no lead and no functions."""
    if not isinstance(a.wire, Wire):
        return names
    return tuple(name for name in names if name in PARAMETERS and not name.startswith("lead"))


def reported_parameters(names: tuple[str, ...]) -> tuple[str, ...]:
    """Every parameter whose value is told where the action sets those named."""
    return (*PARAMETERS, *(name for name in FUNCTIONS if name in names))


def values(a: Assist, names: tuple[str, ...], position: Array) -> dict[str, float]:
    """The value of every parameter at positions (n,) of those named; the others keep the car's own value."""
    return complete(a, {name: KNOWN[name].value(a, x) for name, x in zip(names, position.tolist())})


def complete(a: Assist, given: Mapping[str, float]) -> dict[str, float]:
    """The value of every parameter: those that are given, whatever else is, and the car's own of the others."""
    return {name: given.get(name, KNOWN[name].value(a, 0.0)) for name in reported_parameters(tuple(given))}


def _table(p: Mapping[str, float], speeds: Array, grid: Array, last: float, own: Array) -> Array:
    """A table (V, T) over speeds (V,) [m/s] and a grid (T,) from zero on, for a value of every parameter."""
    read_at = np.zeros_like(grid)  # places of the car's own curve
    read_at[1:] = grid[1:] * (grid[1:] / last) ** (p["boost_progression"] - 1.0)
    table: Any = np.array([np.interp(read_at, grid, row) for row in own])
    return (p["boost_level"] * p["boost_low_speed"] ** _fading(speeds))[:, None] * table  # type: ignore[no-any-return]


def _fading(speeds: Array) -> Array:
    return np.maximum(1.0 - speeds / HIGH_SPEED, 0.0)


def keys(a: Assist, p: Mapping[str, float]) -> dict[str, Any]:
    """The keys of a car file's section ``assist``, or by wire ``steer_by_wire``, for a value of every parameter."""
    if isinstance(w := a.wire, Wire):
        damping = p["damping_level"] * p["damping_low_speed"] ** _fading(w.speeds) * w.damping
        return {"feel": _table(p, w.speeds, w.angles, 1.0, w.feel), "damping": damping}  # with its scale
    fading, t = _fading(a.speeds), a.torques
    own = functions.keys(a.functions, SAMPLE_TIME)
    for name in p.keys() & FUNCTIONS.keys():
        before = FUNCTIONS[name].own(a)
        own[name] = np.multiply(own[name], p[name] / before).tolist() if before else p[name]
    return {
        **own,
        **motor.keys(a.motor),
        "speeds": a.speeds,
        "torques": t,
        "boost": _table(p, a.speeds, t, t[-1], a.boost),
        "damping": p["damping_level"] * p["damping_low_speed"] ** fading * a.damping,
        "lead_zero": p["lead_zero"],
        "lead_pole": p["lead_pole"],
        "delay": a.delay * SAMPLE_TIME + a.offset,
        "bandwidth": a.bandwidth / (2.0 * np.pi),
        "limit": a.limit,
    }


def car_with(car: Car, assist: Mapping[str, Any], name: str) -> Car:
    """The car under another name, with other keys of :func:`keys`; a warning where they are not usual."""
    data = {**car.data(), "name": name}
    if isinstance(car.assist.wire, Wire):
        own = {key: np.asarray(value).tolist() for key, value in assist.items()}
        return cars.load({**data, by_wire.SECTION: {**data[by_wire.SECTION], "feel_scale": 1.0, **own}})
    return cars.load({**data, "assist": assist})


def make_assist(a: Assist, p: Mapping[str, float]) -> Assist:
    """The assist of a car with a value for every parameter, checked by :func:`steer_env.vehicle.steering.eps.make`."""
    if isinstance(a.wire, Wire):
        return frozen(a._replace(wire=a.wire._replace(**keys(a, p))))
    return eps.make(**keys(a, p))
