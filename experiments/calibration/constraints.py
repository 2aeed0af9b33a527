"""What a parameter set must keep wherever the car is driven: margins of the assist loop, the car's stability, and a
boost that the motor can give.

The loop of the whole laden car is read with hands off, which is worst, at the speeds of ``SPEEDS``: straight running,
with the slope that the boost has where the car reaches its steepest part, while friction slides or is at rest, and
while it slides also without the slope of the active return, which is saturated in a turn. Against the worst of all
torques at the same speed, for 15 sets around the packaged cars at 20 to 140 km/h, the gain margin is at most 0.13 dB
too large, and 0.44 dB where the return is saturated. It is up to 1 dB too small, and 2.5 dB where the last part of the
boost is only just reached. While friction slides the phase margin is within 0.3 deg for the packaged cars; at rest it
is up to 2 deg on the safe side. Where the grip of the front tyres fades it is far smaller: 14 in place of 32 deg in one
set, laden, at 20 km/h and the last tenth of a newton metre of a turn. The map of ``steer-env analyse`` has all torques
and hands; a study reads its best sets on that map.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from steer_env.friction import resolve
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.sites import transmissions
from steer_env.vehicle import plant
from steer_env.vehicle.analysis import assist_loop, free_control
from steer_env.vehicle.analysis.linearised import FRICTIONLESS, Point
from steer_env.vehicle.analysis.operating_point import cornering
from steer_env.vehicle.cars import Car
from steer_env.vehicle.chassis.common.interface import INPUTS
from steer_env.vehicle.steering import stability
from steer_env.vehicle.steering.assist.functions import Functions
from steer_env.vehicle.steering.column import COLUMN_ANGLE, HANDWHEEL_ANGLE
from steer_env.vehicle.steering.eps import Assist, available, boost_curve
from steer_env.vehicle.steering.margins import FREQUENCIES, TARGETS, read, worst_margins

KPH = 3.6  # [km/h] of 1 m/s
SPEEDS = (11.0, 20.0, 40.0, 100.0, 140.0)  # of the loop of the whole car [km/h]
RESTING_UP_TO = 60.0  # above it friction at rest never has the smallest margin [km/h]
KEEPS_UP = 2.0 * math.pi  # column speed up to which the motor gives the whole boost, assumed [rad/s]
LEAST_SHARE = 1e-3  # of the motor's limit that counts as given where its curve has ended, assumed [1]
FREE_SPEEDS = (60.0, 140.0)  # of the free car [km/h]
PHASE, GAIN = TARGETS  # [deg], [dB]
LIMIT_WORDS = {
    "stable": "stability",
    "phase": "phase margin",
    "gain": "gain margin",
    "motor": "motor limit",
    "damping": "free-car damping",
    "pulse": "free-car rest",
    "map": "margin map",
}  # part of a constraint's name -> its limit in words
ENOUGH = 90.0, 40.0  # in place of larger margins, which are of no interest [deg, dB]


def _level(gain: float) -> float:
    return 20.0 * math.log10(gain) if gain > 0.0 else -ENOUGH[1]


def reaches(car: Car, chassis: str = "single_track") -> tuple[float, ...]:
    """The greatest torque of torsion bar and boost together in a turn, at each of ``SPEEDS`` [N m]."""
    found = []
    for kph in SPEEDS:
        turn = cornering(car, kph / KPH, chassis)
        twist = turn.states[:, HANDWHEEL_ANGLE] - turn.states[:, COLUMN_ANGLE]  # of a car without boost
        found.append(float(car.column.K_tb * twist.max()))
    return tuple(found)


def steepest(a: Assist, speed: float, reach: float) -> float:
    """The steepest slope of the boost at a speed [m/s] up to a torque of torsion bar and boost together [N m]."""
    boost = np.array([boost_curve(a, float(t), speed)[0] for t in a.torques])
    slopes = np.diff(boost) / np.diff(a.torques)
    return float(slopes[: max(int(np.sum(a.torques[:-1] + boost[:-1] < reach)), 1)].max())


def _straight_running(car: Car, a: Assist, slope: float, law: Any, speed: float, chassis: str) -> Point:
    """Straight running, hands off, with a slope of the boost."""
    curve = np.tile(slope * a.torques, (a.speeds.size, 1))
    p = car._replace(assist=frozen(a._replace(boost=curve))).plant(law, speed, chassis=chassis)
    return Point(p, plant.initial_state(p), np.zeros(len(INPUTS)), speed)


def _return_saturated(a: Assist) -> Assist:
    """The assist in a turn, where the active return is saturated and has no slope; the same one without a return."""
    f = a.functions
    if not isinstance(f, Functions) or not f.active_return.gain.any():
        return a
    off = f.active_return._replace(gain=np.zeros_like(f.active_return.gain))
    return a._replace(functions=f._replace(active_return=off))


def margins(
    car: Car, a: Assist, law: Any, load: float, reached: Sequence[float], chassis: str = "single_track"
) -> dict[str, float]:
    """The smallest margins of a car with an assist.

    Parameters
    ----------
    car : Car
    a : Assist
    law : parameters
        The friction at rest and of the free car, whose gear may change the loop while it slides (E25).
    load : float
        Of the laden car [kg].
    reached : sequence of float
        :func:`reaches` of the laden car with its own assist [N m].
    chassis : str

    Returns
    -------
    dict
        By speed V [km/h]: ``phase_V`` [deg] and ``gain_V`` [dB]; ``column_phase_V`` and ``column_gain_V``, those of the
        column with fixed hands; ``free_damping_V``, the least damping ratio of the free car [1]; ``free_pulse_V``, 1
        where its motion after a pulse decays. ``motor_limit``, the greatest boost over what the motor gives at
        ``KEEPS_UP`` [1]. ``stable`` is 1 where every loop is.
    """
    laden = car.loaded(load)
    found, stable, passed = dict[str, float](), True, transmissions(resolve(law))
    for v in sorted({0.0, *a.speeds.tolist()}):
        column = worst_margins(car.column, a, v, passed)
        found[f"column_phase_{KPH * v:.0f}"] = min(math.degrees(column.phase), ENOUGH[0])
        found[f"column_gain_{KPH * v:.0f}"] = min(_level(column.gain), ENOUGH[1])
        stable &= all(stability.stable(car.column, a, v, free=free) for free in (False, True))
    for kph, reach in zip(SPEEDS, reached, strict=True):
        slope, points = steepest(a, kph / KPH, reach), list[Point]()
        sliding = _straight_running(laden, a, slope, FRICTIONLESS, kph / KPH, chassis)
        points += [assist_loop.transmitted(sliding, factor) for factor in passed]
        if kph <= RESTING_UP_TO:
            points.append(_straight_running(laden, a, slope, law, kph / KPH, chassis))
        stable &= not any(map(assist_loop.grows, points))
        if (turning := _return_saturated(a)) is not a:
            sliding = _straight_running(laden, turning, slope, FRICTIONLESS, kph / KPH, chassis)
            points += [assist_loop.transmitted(sliding, factor) for factor in passed]
        each = [read(FREQUENCIES, assist_loop.open_loop(p).response(FREQUENCIES)) for p in points]
        found[f"phase_{kph:.0f}"] = min(math.degrees(min(m.phase for m in each)), ENOUGH[0])
        found[f"gain_{kph:.0f}"] = min(_level(min(m.gain for m in each)), ENOUGH[1])
    free = _free(car._replace(assist=a), law, load, chassis)
    return {**found, **free, "motor_limit": motor_share(a), "stable": float(stable)}


def motor_share(a: Assist) -> float:
    """The greatest boost over what the motor gives at ``KEEPS_UP`` [1]; finite where it gives nothing there."""
    return float(a.boost.max()) / max(available(a, KEEPS_UP), LEAST_SHARE * a.limit)


def _free(car: Car, law: Any, load: float, chassis: str) -> dict[str, float]:
    found = dict[str, float]()
    for kph in FREE_SPEEDS:
        damping, decays = math.inf, True
        for mass in dict.fromkeys((0.0, load)):
            p = car.loaded(mass).plant(law, kph / KPH, chassis=chassis)
            damping = min(damping, free_control.least_damping_ratio(p)[0])
            decays &= free_control.pulse(p._replace(friction_torque_scale=0.5)).decays
        found |= {f"free_damping_{kph:.0f}": damping, f"free_pulse_{kph:.0f}": float(decays)}
    return found


def least(found: Mapping[str, float]) -> dict[str, float]:
    """The smallest of each kind over the speeds: phase [deg], gain [dB], damping ratio of the free car, its decay."""
    kinds = {
        "phase_margin": ("phase_", "column_phase_"),
        "gain_margin": ("gain_", "column_gain_"),
        "free_damping": ("free_damping_",),
        "free_pulse": ("free_pulse_",),
    }
    return {kind: min(v for key, v in found.items() if key.startswith(starts)) for kind, starts in kinds.items()}


def violations(found: Mapping[str, float]) -> dict[str, float]:
    """By how much each limit is missed, over its size; kept where it is 0 or less."""
    missed = {"motor_limit": found["motor_limit"] - 1.0, "stable": 1.0 - found["stable"]}
    for key, value in found.items():
        if "phase_" in key:
            missed[key] = 1.0 - value / PHASE
        elif "gain_" in key:
            missed[key] = 1.0 - value / GAIN
        elif "damping_" in key:
            missed[key] = -value
        elif "pulse_" in key:
            missed[key] = 0.5 - value
    return missed


def kind(constraint: str) -> str:
    """Which limit a constraint is of, without its place and speed, as the values of ``LIMIT_WORDS``."""
    return next(words for part, words in LIMIT_WORDS.items() if part in constraint)


def describe_violation(constraint: str, violation: float) -> str:
    """A missed limit in words, from its :func:`violations`."""
    kind, _, end = constraint.rpartition("_")
    at = f" at {end} km/h" if end.isdigit() else ""
    where = "the column with fixed hands" if kind.startswith("column_") else "the laden car with hands off"
    if "phase" in constraint:
        return f"the phase margin of {where}{at}, {PHASE * (1.0 - violation):.3g} of {PHASE:g} deg"
    if "gain" in constraint:
        return f"the gain margin of {where}{at}, {GAIN * (1.0 - violation):.3g} of {GAIN:g} dB"
    if "damping" in constraint:
        return f"the damping of the free car{at}, a ratio of {-violation:.2g} where it must be above 0"
    if "pulse" in constraint:
        return f"the rest of the free car{at}, whose motion does not decay after a pulse of the hands"
    if constraint == "motor_limit":
        return f"the limit of the motor, of which the boost asks for {1.0 + violation:.3g} times"
    if constraint == "whole_map":
        return "the margins at a point of the whole map"
    return "stability, as a loop has a motion that grows"
