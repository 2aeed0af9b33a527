"""How fast a car can enter a lane-change course.

The speed is that of car and driver together. The preview driver is the same for all cars; a person may pass faster.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from steer_env import manoeuvres
from steer_env.experiments.pages import car_options
from steer_env.friction.numerics.check import number
from steer_env.manoeuvres.common.driving import LostControlError
from steer_env.metrics import evaluate
from steer_env.vehicle import cars
from steer_env.vehicle.cars import Car

KPH = 1.0 / 3.6  # [m/s]
SLOWEST, FASTEST, STRIDE = (
    30.0 * KPH,
    200.0 * KPH,
    10.0 * KPH,
)  # speeds that are tried before the bisection, assumed [m/s]


def passes(car: Car, friction: Any, manoeuvre: manoeuvres.Manoeuvre) -> bool:
    """Whether the driver takes the car through a course without touching a cone."""
    try:
        values = evaluate(manoeuvres.drive(car, manoeuvre, friction))
    except LostControlError:
        return False
    return values["course_completed"].value == 1.0 and values["cones_hit"].value == 0.0


def maximum_entry_speed(
    car: Car,
    friction: Any = None,
    manoeuvre: str | manoeuvres.Manoeuvre = "double-lane-change",
    tolerance: float = 1.0 * KPH,
) -> float:
    """The highest speed at which the driver enters a lane-change course and passes it.

    The speed is raised in strides of 10 km/h to the first failure, and bisected between that and the last pass.

    Parameters
    ----------
    car : Car
    friction : str or parameters
        A law's name, for its defaults, or parameters from ``friction.make``.
    manoeuvre : str or Manoeuvre
        "double-lane-change" or "obstacle-avoidance", or one with other options.
    tolerance : float
        Accuracy of the speed, 0.01 to 5 [m/s].

    Returns
    -------
    float
        A speed at which the driver passes; at ``tolerance`` above it a cone falls [m/s].

    Raises
    ------
    ValueError
        If a cone falls at 30 km/h already, none falls at 200 km/h, or a value is out of range.
    """
    tolerance = number("tolerance [m/s]", tolerance, minimum=0.01, maximum=5.0)
    test = manoeuvres.make(manoeuvre) if isinstance(manoeuvre, str) else manoeuvre
    if test.driver is None:
        raise ValueError(f"{test.name} has no driver: give a closed-loop manoeuvre")
    low, high = 0.0, SLOWEST
    while passes(car, friction, replace(test, speed=high)):
        low, high = high, high + STRIDE
        if high > FASTEST:
            raise ValueError(f"{test.name}: no cone falls at {low / KPH:.4g} km/h yet")
    if not low:
        raise ValueError(f"{test.name}: a cone falls at {high / KPH:.4g} km/h already")
    while high - low > tolerance:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if passes(car, friction, replace(test, speed=middle)) else (low, middle)
    return low


def main(argv: Sequence[str] | None = None) -> None:
    """Print the entry speeds of a car on both chassis and both courses."""
    parser = argparse.ArgumentParser(prog="steer-env study entry-speed", description=main.__doc__)
    car_options.add(parser)
    laws = ["lugre", "masing"]
    text = f"laws by name (default {' '.join(laws)})"
    parser.add_argument("--friction", metavar="LAW", nargs="+", default=laws, help=text)
    args = parser.parse_args(argv)
    car = car_options.load(args)
    for name in ("double-lane-change", "obstacle-avoidance"):
        for chassis in cars.SPEEDS:
            for law in args.friction:
                test = replace(manoeuvres.make(name), chassis=chassis)
                speed = maximum_entry_speed(car, law, test)
                print(f"{name}, {chassis}, {law}: {speed / KPH:.4g} km/h", flush=True)
