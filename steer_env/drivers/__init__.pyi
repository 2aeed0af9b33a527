from .common.angle_servo import AngleServo
from .common.definition import Arm, Driver, arm, as_mapping, available, make, register, register_preview_model, resolve
from .common.driver_batch import Controller, DriverBatch, with_arms

__all__ = [
    "AngleServo",
    "Arm",
    "Controller",
    "Driver",
    "DriverBatch",
    "arm",
    "as_mapping",
    "available",
    "make",
    "register",
    "register_preview_model",
    "resolve",
    "with_arms",
]
