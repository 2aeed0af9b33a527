"""What the page of a car takes from simulations of the plant: steady turns, yaw lag, parking, weave, hands off."""

from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import manoeuvres, metrics
from steer_env.experiments.studies import vehicle
from steer_env.experiments.studies.common.assist_margins import Cell, assist_cells
from steer_env.manoeuvres.common.shapes import ramp_and_hold, sine
from steer_env.metrics import Value
from steer_env.vehicle import plant
from steer_env.vehicle.analysis import free_control
from steer_env.vehicle.cars import Car
from steer_env.vehicle.chassis import available as every_chassis
from steer_env.vehicle.steering.by_wire import ratio_at
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]

SPEED = 100.0 / 3.6  # of quantities that depend on it [m/s]
SPEEDS = tuple(float(v) for v in range(10, 61, 5))  # of the curves over speed [m/s]
ASSISTED = (0.0, 50.0, 100.0)  # of the margins of the assist loop; 0 is parking [km/h]
LAG_FREQUENCY = 0.2  # of the yaw lag, as in the weave [Hz]
HELD_SPEED_SHARE = 0.98  # share of the speed that counts as held, assumed [1]
LAG_ACCELERATION = 2.0  # of the yaw lag, as in the weave [m/s2]
# Lateral acceleration of the steady turn, small enough for the slopes straight ahead, assumed [m/s2]
SMALL_ACCELERATION = 0.3
STEADY = 0.01  # change of the yaw rate in the last second of a steady turn, assumed [1]
OWN_FRICTION, NO_FRICTION = "own", "none"  # with the friction of the car, and without
LAWS: dict[str, Any] = {OWN_FRICTION: None, NO_FRICTION: free_control.FRICTIONLESS}


class Steady(NamedTuple):
    """Slopes over the lateral acceleration in a slight steady turn, without friction."""

    angle: float  # handwheel angle [rad s2/m]
    understeer: float  # angle of the road wheels, as the rack commands it, beyond that of the path [rad s2/m]
    twist: float  # twist of the torsion bar [rad s2/m]
    roll: float  # roll angle [rad s2/m]


class HandsOff(NamedTuple):
    """The car without hands on one chassis, over SPEEDS."""

    damping: Array  # (n,) damping ratio of the least damped mode without friction, negative where it grows [1]
    limit: dict[str, float]  # OWN, NO_FRICTION -> highest speed without a spin or a sustained oscillation [m/s]
    pulses: dict[str, list[free_control.Pulse]]  # OWN, NO_FRICTION -> motion after a pulse of 3 N m


class Simulated(NamedTuple):
    """Simulations of one car."""

    steady: dict[str, Steady]  # chassis
    lags: dict[tuple[str, str], Array]  # chassis, OWN or NO_FRICTION -> (len(SPEEDS),) yaw lag [s]
    lag: dict[tuple[str, str], float]  # the same at SPEED [s]
    parking: dict[str, vehicle.Parking]  # "assisted", "unassisted"
    weave: dict[str, Value]  # metrics
    hands_off: dict[str, HandsOff]  # chassis
    assist: dict[float, list[Cell]]  # speed [km/h] -> margins of the assist loop in each cell that assists


def _run(p: plant.Plant, hand: tuple[Array, Array]) -> dict[str, Array]:
    """Channels (T,) of a robot's steering; ValueError where the car spins or a state does not stay finite."""
    u = np.zeros((len(hand[0]), len(plant.INPUTS)))
    u[:, plant.HAND], u[:, plant.HAND_SPEED] = hand
    names = [name for name, _ in plant.channels(p)]
    record = np.zeros((len(u), len(names)))
    plant.run(p, plant.initial_state(p), u, record, 1)
    found = dict(zip(names, record.T))
    if not np.isfinite(record).all() or np.abs(found["yaw_rate"]).max() > 2.0:
        raise ValueError("the car spins")
    return found


def _times(duration: float) -> Array:
    return SAMPLE_TIME * np.arange(1.0, round(duration / SAMPLE_TIME) + 1.0)


def steady(car: Car, chassis: str, speed: float = SPEED) -> Steady:
    """The slopes in a steady turn of some 0.03 g; the slopes of larger turns differ, as tyres are not linear.

    Raises
    ------
    ValueError
        The car spins or finds no steady turn.
    """
    p, gain, angle = car.plant(free_control.FRICTIONLESS, speed, robot=True, chassis=chassis), car.steering_gain(), 0.01
    wheelbase = car.chassis["front_axle"] + car.chassis["rear_axle"]
    for _ in range(2):  # the second angle is that of the wanted lateral acceleration
        found = _run(p, ramp_and_hold(_times(8.0), angle, 1.0))
        if abs(found["yaw_rate"][-1] / found["yaw_rate"][-1000] - 1.0) > STEADY:
            raise ValueError("the turn does not become steady")
        v = float(found["longitudinal_speed"][-1]) if "longitudinal_speed" in found else speed
        acceleration = v * float(found["yaw_rate"][-1])
        slope = angle / acceleration
        angle = SMALL_ACCELERATION * slope
    column = float(found["column_angle"][-1]) / acceleration
    at_handwheel = column / ratio_at(car.assist.wire, speed)  # without twist
    roll = float(found["roll_angle"][-1]) / acceleration
    return Steady(slope, gain * column - wheelbase / v**2, slope - at_handwheel, roll)


def yaw_lag(car: Car, chassis: str, law: Any, speed: float) -> float:
    """Time by which the yaw rate follows the handwheel angle in a settled cycle of the weave [s].

    Raises
    ------
    ValueError
        As :func:`steady`, and where the engine does not hold the speed.
    """
    amplitude = LAG_ACCELERATION * steady(car, chassis, speed).angle
    t, period = _times(3.0 / LAG_FREQUENCY), round(1.0 / LAG_FREQUENCY / SAMPLE_TIME)
    found = _run(car.plant(law, speed, robot=True, chassis=chassis), sine(t, amplitude, LAG_FREQUENCY))
    if "longitudinal_speed" in found and found["longitudinal_speed"][-1] < HELD_SPEED_SHARE * speed:
        raise ValueError("the engine does not hold the speed")
    wave = np.exp(-2j * np.pi * LAG_FREQUENCY * t[-period:])
    response = (found["yaw_rate"][-period:] @ wave) / (found["handwheel_angle"][-period:] @ wave)
    return float(-np.angle(response) / (2.0 * np.pi * LAG_FREQUENCY))


def hands_off(car: Car, chassis: str) -> HandsOff:
    """Least damping and pulses over SPEEDS, and the limits, with and without friction."""
    plants = {name: [car.plant(law, v, chassis=chassis) for v in SPEEDS] for name, law in LAWS.items()}
    return HandsOff(
        damping=np.array([free_control.least_damping_ratio(p)[0] for p in plants[NO_FRICTION]]),
        limit={name: free_control.limit(car, law, chassis) for name, law in LAWS.items()},
        pulses={name: [free_control.pulse(p) for p in found] for name, found in plants.items()},
    )


def _lag(car: Car, chassis: str, law: str, speed: float) -> float:
    """The yaw lag, or NaN where the car finds no steady turn [s]."""
    try:
        return yaw_lag(car, chassis, LAWS[law], speed)
    except ValueError:
        return np.nan


def _weave(car: Car) -> dict[str, Value]:
    """Metrics of the weave, refused where the car cannot drive it."""
    try:
        return metrics.evaluate(manoeuvres.drive(car, manoeuvres.make("weave")))
    except ValueError as error:
        units = {name: metrics.definition(name).unit for name in metrics.available("weave")}
        return {name: Value(np.nan, np.nan, np.nan, unit, str(error)) for name, unit in units.items()}


def simulate(car: Car) -> Simulated:
    """Drive the simulations of a car; a value is NaN where the car spins or finds no steady turn.

    Raises
    ------
    ValueError
        Parking that cannot be driven.
    """
    unknown = Steady(np.nan, np.nan, np.nan, np.nan)
    found, cases = {}, list(product(every_chassis(), LAWS))
    for chassis in every_chassis():
        try:
            found[chassis] = steady(car, chassis)
        except ValueError:
            found[chassis] = unknown
    return Simulated(
        steady=found,
        lags={key: np.array([_lag(car, *key, v) for v in SPEEDS]) for key in cases},
        lag={key: _lag(car, *key, SPEED) for key in cases},
        parking={state: vehicle.park(car, car.friction, state == "assisted") for state in ("assisted", "unassisted")},
        weave=_weave(car),
        hands_off={name: hands_off(car, name) for name in every_chassis()},
        assist={kph: assist_cells(car, kph, [car.friction]) for kph in ASSISTED},
    )
