from .common.definition import Manoeuvre, make, options, register
from .common.driving import build_plant, drive, find_amplitude, inputs
from .common.registry import available

__all__ = ["Manoeuvre", "available", "build_plant", "drive", "find_amplitude", "inputs", "make", "options", "register"]
