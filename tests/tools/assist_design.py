"""Design of the assist of a car: boost from torque build-up and parking effort, motor damping from free control.

The packaged cars have the tables that :func:`design` returns; ``python -m tests.maintain design-assist`` prints them.
With the quasi-static rack torque T_r(A) on the column at a lateral acceleration A, the hands hold T(A) if

    boost(T(A)) = T_r(A) - T(A)       with the torque build-up T(A) of (E7)                        (E8)
    boost(T) = T_p (T/T_e)^n - T      standing, with the largest rack torque T_p at the effort T_e (E9)

without friction. From standstill to 80 km/h the weight of the second falls as 1 - sqrt(v/80 km/h). The motor damping
at a speed is the least one, in steps of 0.25 N m s/rad, with which the free car (hands off, no friction) has the
damping ratio of ``FREE_DAMPING``, on a single track, which is less damped than two tracks at speed. The loop keeps its
margins also while the gear of that kind of steering slides, with its efficiency (E25).

Sources: the parking effort is within the limits of workshop manuals (3.7 to 7.8 N m); the rest is assumed. No range of
the damping ratio of free control has been published.
"""

import math
import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.sites import make_sites, transmissions
from steer_env.vehicle import plant
from steer_env.vehicle.analysis import free_control
from steer_env.vehicle.cars import Car, UnusualCar
from steer_env.vehicle.chassis.common.interface import HAND, HAND_SPEED, INPUTS
from steer_env.vehicle.constants import GRAVITY
from steer_env.vehicle.plant import CHANNEL
from steer_env.vehicle.steering import margins
from steer_env.vehicle.steering.assist.functions import Functions, NoFunctions
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.steering.torque_build_up import torque_build_up

Array = NDArray[np.float64]

SPEEDS = tuple(kph / 3.6 for kph in (0.0, 20.0, 40.0, 80.0, 100.0, 140.0, 180.0, 220.0))  # of the table [m/s]
TORQUES = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0)  # of the table [N m]
HIGHEST = 0.45  # lateral acceleration up to which the boost follows the build-up, then its slope goes on [g]
PARKING_EFFORT = 4.0  # T_e [N m]; higher where the loop would lose its margins
PARKING_EXPONENT = 1.5  # n: boost that grows with torque leaves the centre firm
BUILD_UP_FROM = 80.0 / 3.6  # speed from which on the build-up alone shapes the boost [m/s]
# Least damping ratio of the free car by speed [km/h, 1]: well damped in traffic, stable to the end of the table.
FREE_DAMPING = np.array([[0.0, 80.0, 100.0, 140.0, 180.0, 220.0], [0.0, 0.25, 0.25, 0.15, 0.05, 0.0]])
LEAST_DAMPING, MOST_DAMPING, DAMPING_STEP = 1.5, 8.0, 0.25  # of the motor, at the column [N m s/rad]
RAMP_TIME = 20.0  # of the quasi-static turns [s]


class Design(NamedTuple):
    """A designed assist, in the keys of a car file."""

    speeds: Array  # (V,) [m/s]
    torques: Array  # (T,) [N m]
    boost: Array  # (V, T) at the column [N m]
    damping: Array  # (V,) at the column [N m s/rad]


def _turn(car: Car, speed: float, chassis: str, angle: float, time: float) -> tuple[Array, Array]:
    """Lateral acceleration [m/s2] and rack torque on the column [N m] while the handwheel turns to an angle [rad]."""
    p = car.plant(free_control.FRICTIONLESS, speed, robot=True, chassis=chassis)
    u = np.zeros((round(time / SAMPLE_TIME), len(INPUTS)))
    u[:, HAND], u[:, HAND_SPEED] = np.linspace(0.0, angle, len(u)), angle / time
    record = np.zeros((len(u), len(plant.channels(p))))
    if not plant.run(p, plant.initial_state(p), u, record, 1):
        raise ValueError(f"the simulation of a turn of {car.name} at {speed:g} m/s diverged")
    begun = record[len(u) // 10 :]  # the turn has left its start behind
    return begun[:, CHANNEL["lateral_acceleration"]], p.pinion_radius * begun[:, CHANNEL["rack_force"]]


def rack_torque(car: Car, speed: float) -> tuple[Array, Array]:
    """Quasi-static rack torque on the column over lateral acceleration, up to ``HIGHEST``, without friction.

    Returns
    -------
    A, torque : (N,) array
        Lateral acceleration [m/s2] from zero on, and torque [N m].

    Raises
    ------
    ValueError
        A car that does not reach half of ``HIGHEST``.
    """
    angle, end = 0.1, -1
    while end < 0:
        A, torque = _turn(car, speed, "single_track", angle, RAMP_TIME)
        if A.max() > HIGHEST * GRAVITY:
            end = int(np.argmax(A > HIGHEST * GRAVITY))
        elif np.argmax(A) < 0.9 * len(A):  # the tyres slide
            end = int(np.argmax(A))
        angle *= 1.3
    if A[end] < 0.5 * HIGHEST * GRAVITY:
        raise ValueError(f"{car.name} reaches only {A[end]:.1f} m/s2 at {speed:g} m/s, too little to design an assist")
    return np.append(0.0, A[:end]), np.append(0.0, torque[:end])


def parking_torque(car: Car) -> float:
    """Largest rack torque on the column while a standing car is steered to nine tenths of its lock [N m]."""
    lock = 0.9 * car.steering["rack_limit"] / car.steering["pinion_radius"]
    return float(_turn(car, 0.0, "two_track", lock, 10.0)[1].max())


def _build_up_boost(car: Car, speed: float) -> Array:
    """Boost (T,) by the torque build-up (E8)."""
    A, rack = rack_torque(car, speed)
    rack = np.maximum.accumulate(rack)
    torque = np.array([torque_build_up(a) for a in A])
    boost = np.maximum(rack - torque, 0.0)  # (E8)
    found = np.interp(TORQUES, torque, boost)
    last = len(A) - len(A) // 8
    slope = (boost[-1] - boost[last]) / (torque[-1] - torque[last])
    beyond = np.array(TORQUES) > torque[-1]
    found[beyond] = boost[-1] + slope * (np.array(TORQUES)[beyond] - torque[-1])
    return found


def _parking_boost(torque: float, effort: float) -> Array:
    """Boost (T,) at standstill by the largest rack torque and the effort for it [N m] (E9)."""
    T = np.array(TORQUES)
    within = torque * (np.minimum(T, effort) / effort) ** PARKING_EXPONENT - np.minimum(T, effort)  # (E9)
    return np.maximum(within + (PARKING_EXPONENT * torque / effort - 1.0) * np.maximum(T - effort, 0.0), 0.0)


def _boost_table(standing: float, driving: dict[float, Array], effort: float) -> Array:
    """Boost (V, T) at ``SPEEDS`` and ``TORQUES``, to 0.01 N m.

    Parameters
    ----------
    standing : float
        Largest rack torque in parking [N m].
    driving : dict
        Boost (T,) by speed from ``BUILD_UP_FROM`` on [m/s, N m].
    effort : float
        Hand torque in parking [N m].
    """
    parked, first = _parking_boost(standing, effort), driving[min(driving)]
    shares = np.sqrt(np.minimum(np.array(SPEEDS) / BUILD_UP_FROM, 1.0))
    rows = [(1.0 - share) * parked + share * driving.get(speed, first) for speed, share in zip(SPEEDS, shares)]
    return np.round(rows, 2)


def _steady(car: Car, speed: float) -> bool:
    """Whether the loop of the assist is stable and keeps the usual margins at a speed [m/s], also through its gear."""
    phase, gain = margins.TARGETS
    gear = transmissions(make_sites({car.kind: "coulomb"}))
    found = margins.worst_margins(car.column, car.assist, speed, gear)
    return found.stable and math.degrees(found.phase) >= phase and 20.0 * math.log10(found.gain) >= gain


def functions_at(f: Functions | NoFunctions, speeds: Array) -> Functions | NoFunctions:
    """The same functions of the assist with their values at other speeds (V,) [m/s]."""
    if isinstance(f, NoFunctions):
        return f
    changed = {
        name: p._replace(gain=np.interp(speeds, f.speeds, p.gain))
        for name, p in f._asdict().items()
        if np.ndim(getattr(p, "gain", 0.0))
    }
    return frozen(f._replace(speeds=np.array(speeds), **changed))


def _with(car: Car, found: Design) -> Car:
    speeds, torques, boost, damping = (np.ascontiguousarray(values) for values in found)
    kept = functions_at(car.assist.functions, speeds)
    assist = car.assist._replace(speeds=speeds, torques=torques, boost=boost, damping=damping, functions=kept)
    return car._replace(assist=assist)


def least_damping(car: Car, speed: float, wanted: float) -> float:
    """Least motor damping with which the free car has a damping ratio and the loop its margins [N m s/rad].

    ``MOST_DAMPING``, with a warning, where the free car does not reach the ratio. The boost is that of the assist.

    Raises
    ------
    ValueError
        A loop without margins at every damping.
    """
    reached, steady = 0.0, False
    for step in range(round((MOST_DAMPING - LEAST_DAMPING) / DAMPING_STEP) + 1):
        damping = LEAST_DAMPING + step * DAMPING_STEP
        tried = car._replace(assist=car.assist._replace(damping=np.full(car.assist.speeds.size, damping)))
        if not _steady(tried, speed):
            continue
        steady, moves = True, max(speed, free_control.LOWEST)
        reached = free_control.least_damping_ratio(tried.plant(free_control.FRICTIONLESS, moves))[0]
        if reached >= wanted:
            return damping
    if not steady:
        raise ValueError(f"the assist of {car.name} has no margins at {speed:g} m/s with any motor damping")
    text = (
        f"{car.name} with free hands reaches a damping ratio of {reached:.3f} at {speed:g} m/s, wanted is {wanted:.3g}"
    )
    warnings.warn(text, UnusualCar, stacklevel=2)
    return MOST_DAMPING


def design(car: Car) -> Design:
    """Boost and damping for a car; lead, delay, bandwidth, limit and functions of its assist stay.

    The parking effort is raised from ``PARKING_EFFORT`` until the loop has its margins at standstill.

    Raises
    ------
    ValueError
        A car whose simulation diverges, that corners too little, or whose loop has no margins.

    Warns
    -----
    UnusualCar
        A car that does not reach the damping ratio with the greatest damping that is tried.
    """
    speeds, torques = np.array(SPEEDS), np.array(TORQUES)
    standing = parking_torque(car)
    driving = {speed: _build_up_boost(car, speed) for speed in SPEEDS if speed >= BUILD_UP_FROM}
    for effort in np.arange(PARKING_EFFORT, TORQUES[-1], 0.25):
        boost = _boost_table(standing, driving, float(effort))
        found = Design(speeds, torques, boost, np.full(speeds.size, LEAST_DAMPING))
        if _steady(_with(car, found), 0.0):
            break
    else:
        raise ValueError(f"the assist of {car.name} has no margins with any parking effort up to {TORQUES[-1]:g} N m")
    wanted = np.interp(3.6 * speeds, *FREE_DAMPING)
    boosted = _with(car, found)
    return found._replace(damping=np.array([least_damping(boosted, v, w) for v, w in zip(SPEEDS, wanted)]))
