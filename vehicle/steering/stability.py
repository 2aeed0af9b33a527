"""Whether the assist loop is stable, and which part of the assist makes it unstable.

The closed loop of :mod:`steer_env.vehicle.steering.linear` at every slope that the boost curve has at a speed, with the
handwheel fixed or free. With a fixed handwheel it is the loop of :mod:`steer_env.vehicle.steering.margins`, here
without frequency responses, so that a drive can ask for it. Two states that those margins have are left out, as no run
stays in them: the steepest fade of the active return, through which a driver only passes, and the sticking of the
friction compensation's observer, during which the friction that it compensates holds the column.
"""

import math
from collections.abc import Callable

import numpy as np

from steer_env.vehicle.steering import linear, wire_loops
from steer_env.vehicle.steering.assist.functions import Functions, NoFunctions, gain_at
from steer_env.vehicle.steering.by_wire import Wire
from steer_env.vehicle.steering.column import Column
from steer_env.vehicle.steering.eps import SAMPLE_TIME, Assist, boost_curve

SLOWEST = 3.0  # slower oscillations depend on tyres and friction, which are not in the model; assumed [Hz]
USUAL_LIMIT = 1.6  # factor on the functions that a loop usually bears, 4 dB; assumed [1]
ROUNDING = 1e-6  # growth of an oscillation in a sample that counts as none [1]


def growth(c: Column, a: Assist, speed: float, free: bool) -> float:
    """Largest growth of an oscillation above 3 Hz in a sample, over every slope; above 1 the loop is unstable [1]."""
    if isinstance(a.wire, Wire):
        return wire_loops.growth(c, a, speed, free, SLOWEST)
    boost = [boost_curve(a, torque, speed)[0] for torque in a.torques]
    slopes = np.unique(np.diff(boost) / np.diff(a.torques))
    poles = linear.poles(linear.plant(c, a, speed, free=free), a, slopes).ravel()
    fast = np.abs(np.angle(poles)) > 2.0 * math.pi * SLOWEST * SAMPLE_TIME
    return float(np.abs(poles[fast]).max(initial=0.0))


def stable(c: Column, a: Assist, speed: float, *, free: bool) -> bool:
    """Whether the assist loop is stable at a vehicle speed [m/s] with the handwheel free, or else fixed."""
    return growth(c, a, speed, free) <= 1.0 + ROUNDING


# The functions that can make the loop unstable, with key and unit of their strength and what else helps.
KEYS = {
    "inertia_compensation": ("inertia_compensation", " kg m2", ""),
    "lead_lag": ("lead_lag_gain", "", ""),
    "active_return": ("return_gain", " N m/rad", ", or with a smaller return_lead"),
    "damping": ("handwheel_damping", " N m s/rad", ""),
}

STRENGTHS = ", ".join(key for key, _, _ in KEYS.values())


def _scaled(a: Assist, names: list[str], factor: float) -> Assist:
    """The assist with a factor on the strength of some of its functions."""
    changed = {name: p._replace(gain=factor * p.gain) for name in names for p in [getattr(a.functions, name)]}
    return a._replace(functions=a.functions._replace(**changed))


def _largest(holds: Callable[[float], bool]) -> float:
    """The largest factor, found by bisection, up to which a condition holds that holds at 0 and not at 1."""
    low, high = 0.0, 1.0
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def functions_to_the_limit(c: Column, a: Assist) -> float:
    """The factor on all functions of the assist at which the loop becomes unstable at a speed of the boost table [1].

    With held or free handwheel; infinite without any function, and where the factor is above 1.6.
    """
    if isinstance(a.functions, NoFunctions):
        return math.inf

    def calm(factor: float) -> bool:
        return _stable_everywhere(c, _scaled(a, list(KEYS), USUAL_LIMIT * factor))

    return math.inf if calm(1.0) else USUAL_LIMIT * _largest(calm)


def boost_to_the_limit(c: Column, a: Assist) -> float:
    """The factor on the boost at which the loop becomes unstable at a speed of the boost table, at most 1 [1].

    0 where it is unstable without boost, too.
    """

    def calm(factor: float) -> bool:
        return _stable_everywhere(c, a._replace(boost=factor * a.boost))

    return 1.0 if calm(1.0) else _largest(calm) if calm(0.0) else 0.0


def _stable_everywhere(c: Column, a: Assist) -> bool:
    """Whether the loop is stable at every speed of the boost table, with held and with free handwheel."""
    return all(stable(c, a, speed, free=free) for speed in a.speeds for free in (False, True))


def three_digits(value: float) -> str:
    """A value rounded towards 0 to three digits."""
    step = 10.0 ** (math.floor(math.log10(abs(value))) - 2) if value else 1.0
    return f"{math.trunc(value / step) * step:.3g}"


def _blamed(a: Assist, calm: Callable[[Assist], bool]) -> list[str]:
    """The function without which the assist is calm, or all that are on if only that helps; otherwise none."""
    active = [name for name in KEYS if np.any(getattr(a.functions, name).gain)]
    candidates = [*([name] for name in active), active]
    return next((names for names in candidates if calm(_scaled(a, names, 0.0))), [])


def reason(c: Column, a: Assist, speed: float, *, free: bool) -> str:
    """Why the loop of :func:`stable` is unstable: the cause with its value and the largest stable one; empty if stable.

    The cause is a function of the assist without which the loop is stable, or all of them together; otherwise the
    torsion bar, too stiff for boost and damping of the motor.
    """
    if stable(c, a, speed, free=free):
        return ""
    if isinstance(a.wire, Wire):
        return wire_loops.reason(c, a, speed, free)
    hands = "with the hands off" if free else "with the handwheel held"
    text = f"the assist loop is unstable at {3.6 * speed:.4g} km/h {hands}"

    def calm(column: Column, assist: Assist) -> bool:
        return stable(column, assist, speed, free=free)

    if isinstance(f := a.functions, Functions):
        if blamed := _blamed(a, lambda assist: calm(c, assist)):
            k = _largest(lambda factor: calm(c, _scaled(a, blamed, factor)))
            return f"{text}: {', '.join(_strength(f, name, speed, k) for name in blamed)}"
        a = a._replace(functions=NoFunctions())

    def softer(factor: float) -> bool:
        return factor == 0.0 or calm(c._replace(K_tb=factor * c.K_tb), a)

    def flatter(factor: float) -> bool:
        return calm(c, a._replace(boost=factor * a.boost))

    ways = f"K_tb {three_digits(_largest(softer) * c.K_tb)}"
    if flatter(0.0):
        ways += f", or with {three_digits(_largest(flatter))} times the boost"
    return f"{text}: K_tb {c.K_tb:g} N m/rad is too stiff for this assist; it is stable with {ways}"


def _strength(f: Functions, name: str, speed: float, factor: float) -> str:
    """A function's strength at a speed, and that with a factor at which the loop is stable."""
    key, unit, more = KEYS[name]
    gain = getattr(f, name).gain
    value = gain_at(f, gain, speed) if np.ndim(gain) else gain
    return f"assist.{key} is {value:.4g}{unit}; it is stable with {three_digits(factor * value)}{more}"
