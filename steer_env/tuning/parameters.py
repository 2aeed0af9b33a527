"""The tuned parameters of the assist, each relative to the car's own value, and the assist that a parameter set makes.

    boost'(v, T) = level low(v) boost(v, T (T/T_n)^(progression - 1))     T_n: last torque of the table
    damping'(v)  = level low(v) damping(v)
    low(v)       = factor at standstill ^ max(1 - v/v_1, 0)               v_1 = 100 km/h

An action a in [-1, 1] gives a parameter the value own * span^a: the car's own value at 0, and a valid one wherever the
car's own is. The spans are assumed: as far as an engineer would go, and further to where the loop's margins are lost.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.vehicle.steering import eps
from steer_env.vehicle.steering.eps import Assist

Array = NDArray[np.float64]

HIGH_SPEED = 100.0 / 3.6  # speed from which on a factor at standstill has no effect [m/s]
HIGHEST_CORNER = 450.0  # highest corner of the lead that :func:`steer_env.vehicle.steering.eps.make` accepts [Hz]


class Parameter(NamedTuple):
    """One parameter of the assist."""

    name: str
    unit: str
    span: float  # action 1 multiplies the car's own value by this, and action -1 divides it [1]
    meaning: str
    own: Callable[[Assist], float] = lambda a: 1.0  # the car's own value
    highest: float = np.inf  # limit of the value, whatever the span [unit]

    def value(self, a: Assist, action: float) -> float:
        """The value at an action in [-1, 1] for an assist [unit]."""
        return min(self.own(a) * self.span**action, self.highest)


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


def values(a: Assist, names: tuple[str, ...], action: Array) -> dict[str, float]:
    """The value of every parameter at an action (n,) on those named; the others keep the car's own value."""
    actions = dict(zip(names, action.tolist()))
    return {name: parameter.value(a, actions.get(name, 0.0)) for name, parameter in PARAMETERS.items()}


def keys(a: Assist, p: Mapping[str, float]) -> dict[str, Any]:
    """The keys of a car file's section ``assist``, for the assist of a car and a value for every parameter."""
    fading = np.maximum(1.0 - a.speeds / HIGH_SPEED, 0.0)
    t = a.torques
    read_at = np.zeros_like(t)  # torques of the car's own curve
    read_at[1:] = t[1:] * (t[1:] / t[-1]) ** (p["boost_progression"] - 1.0)
    boost: Any = np.array([np.interp(read_at, t, row) for row in a.boost])
    return {
        "speeds": a.speeds,
        "torques": t,
        "boost": (p["boost_level"] * p["boost_low_speed"] ** fading)[:, None] * boost,
        "damping": p["damping_level"] * p["damping_low_speed"] ** fading * a.damping,
        "lead_zero": p["lead_zero"],
        "lead_pole": p["lead_pole"],
        "delay": a.delay * eps.SAMPLE_TIME + a.offset,
        "bandwidth": a.bandwidth / (2.0 * np.pi),
        "limit": a.limit,
    }


def tuned(a: Assist, p: Mapping[str, float]) -> Assist:
    """The assist of a car with a value for every parameter, checked by :func:`steer_env.vehicle.steering.eps.make`."""
    return eps.make(**keys(a, p))
