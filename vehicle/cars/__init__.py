"""Cars: a data file each, checked key by key, which makes the parameters of the plant."""

from steer_env.vehicle.cars.car import SPEEDS, Car
from steer_env.vehicle.cars.contents import write
from steer_env.vehicle.cars.files import available, changer, every_key, from_data, load
from steer_env.vehicle.cars.plausible import UnusualCar
from steer_env.vehicle.chassis.common.interface import SPEED_MAX, SPEED_MIN
from steer_env.vehicle.keys import declared_keys

__all__ = [
    "SPEEDS",
    "SPEED_MAX",
    "SPEED_MIN",
    "Car",
    "UnusualCar",
    "available",
    "changer",
    "declared_keys",
    "every_key",
    "from_data",
    "load",
    "write",
]
