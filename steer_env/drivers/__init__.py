"""Driver models; importing the package registers them."""

from steer_env.drivers import free, macadam, preview, two_point  # noqa: F401 (they register themselves)
from steer_env.drivers.crew import Controller, Crew, gripped
from steer_env.drivers.definition import Arm, Driver, arm, available, make, register, register_eyes, resolve

__all__ = [
    "Arm",
    "Controller",
    "Crew",
    "Driver",
    "arm",
    "available",
    "gripped",
    "make",
    "register",
    "register_eyes",
    "resolve",
]
