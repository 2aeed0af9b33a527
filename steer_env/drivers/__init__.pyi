from .common.definition import Arm, Driver, arm, available, make, register, register_eyes, resolve
from .common.driver_batch import Controller, Crew, gripped

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
