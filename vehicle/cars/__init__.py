"""Cars: a data file each, checked key by key, which makes the parameters of the plant."""

from typing import Any

from steer_env.friction.numerics.renamed import REMOVED_IN
from steer_env.vehicle.cars.car import SPEEDS, Car
from steer_env.vehicle.cars.contents import key_meanings, write
from steer_env.vehicle.cars.files import available, every_key, from_data, load
from steer_env.vehicle.cars.plausible import UnusualCar
from steer_env.vehicle.chassis.common.interface import SPEED_MAX, SPEED_MIN

__all__ = [
    "SPEEDS",
    "SPEED_MAX",
    "SPEED_MIN",
    "Car",
    "UnusualCar",
    "available",
    "every_key",
    "from_data",
    "key_meanings",
    "load",
    "write",
]


def rack_ratio(car: Car) -> Any:
    """Former name of :meth:`Car.steering_ratio`."""
    import warnings

    text = f"cars.rack_ratio(car) is now car.steering_ratio(); the old name goes in release {REMOVED_IN}"
    warnings.warn(text, DeprecationWarning, stacklevel=2)
    return car.steering_ratio()
