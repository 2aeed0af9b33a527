from .kinds import CLASSES, SUBSYSTEMS, Car, Chassis, Steering, advance, bound, make, register
from .subsystem import Signal, Subsystem, channel_signals, is_finite

__all__ = [
    "CLASSES",
    "SUBSYSTEMS",
    "Car",
    "Chassis",
    "Signal",
    "Steering",
    "Subsystem",
    "advance",
    "bound",
    "channel_signals",
    "is_finite",
    "make",
    "register",
]
