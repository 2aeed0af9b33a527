"""Active return: a torque towards the centre that fades when the driver holds the handwheel (E11).

    s = gain(v) (th1 + lead th1')/saturation
    T = -saturation s/sqrt(1 + s^2) 1/(1 + (T_tb/hold)^2) v/(v + v_0)      (E11)

Hands that hold the handwheel twist the torsion bar, a released handwheel does not. The tyres of a standing car do not
centre, and no return is wanted in parking. The term in th1' brakes before the centre. The structure is common practice;
the shapes of saturation and fades are assumed.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.keys import checked
from steer_env.vehicle.steering.assist.by_speed import by_speed, shortest

HALF_SPEED = 3.0  # v_0, assumed [m/s]


class ActiveReturn(NamedTuple):
    """Parameters as the kernels take them."""

    gain: NDArray[np.float64]  # (V,) stiffness about the centre [N m/rad]
    saturation: float  # largest torque of the return [N m]
    lead: float  # time over which the handwheel's motion is extrapolated [s]
    hold: float  # torsion-bar torque that halves the return [N m]
    half_speed: float  # v_0, vehicle speed at which the return has half its size [m/s]


STATES: tuple[tuple[str, str], ...] = ()


def make(
    count: int,
    *,
    return_gain: ArrayLike = (0.0,),
    return_saturation: float = 2.0,
    return_lead: float = 0.05,
    return_hold: float = 0.3,
    return_speed: float = HALF_SPEED,
) -> ActiveReturn:
    """Checked parameters for ``count`` speeds; a gain of 0 is off.

    Parameters
    ----------
    count : int
        Speeds of the boost table, V.
    return_gain : (V,) or (1,) array_like, or float
        Stiffness about the centre, 0 to 200 [N m/rad].
    return_saturation : float
        Largest torque, above 0 to 50 [N m].
    return_lead : float
        Time over which the handwheel's motion is extrapolated, 0 to 1 [s].
    return_hold : float
        Torsion-bar torque that halves the return, 0.01 to 100 [N m].
    return_speed : float
        Vehicle speed at which the return has half its size, 0.1 to 100 [m/s].
    """
    return ActiveReturn(
        by_speed("return_gain", return_gain, count),
        checked("assist", "return_saturation", return_saturation),
        checked("assist", "return_lead", return_lead),
        checked("assist", "return_hold", return_hold),
        checked("assist", "return_speed", return_speed),
    )


def keys(p: ActiveReturn) -> dict[str, Any]:
    """The keys of a car file that make these parameters."""
    values = p.saturation, p.lead, p.hold, p.half_speed
    names = "return_saturation", "return_lead", "return_hold", "return_speed"
    return {"return_gain": shortest(p.gain), **dict(zip(names, values))}


@kernel
def share(p, speed):
    """Share of the return that is left at a vehicle speed [m/s]."""
    return abs(speed) / (abs(speed) + p.half_speed)  # (E11)


@kernel
def torque(p, gain, angle, rate, twist, speed):
    """Torque towards the centre [N m].

    Parameters
    ----------
    p : ActiveReturn
    gain : float
        Stiffness at this speed [N m/rad].
    angle, rate : float
        Of the handwheel [rad, rad/s].
    twist : float
        Torsion-bar torque [N m].
    speed : float
        Of the vehicle [m/s].
    """
    s = gain / p.saturation * (angle + p.lead * rate)
    held = twist / p.hold
    return -p.saturation * s / math.sqrt(1.0 + s * s) / (1.0 + held * held) * share(p, speed)  # (E11)


def slope(p: ActiveReturn, gain: float, low: float, high: float, speed: float) -> float:
    """Largest slope of the return over the torsion-bar torque between two torques [1], at saturation (E16).

    A driver who takes hold of the handwheel fades the return out, which acts as a boost.
    """
    if gain == 0.0:
        return 0.0
    held = min(max(p.hold / math.sqrt(3.0), low), high) / p.hold  # where the fade is steepest
    return share(p, speed) * p.saturation / p.hold * 2.0 * held / (1.0 + held * held) ** 2  # (E16)
