from .common.definition import Manoeuvre, available, make, options, register
from .common.driving import build_plant, drive, find_amplitude, inputs

__all__ = ["Manoeuvre", "available", "build_plant", "drive", "find_amplitude", "inputs", "make", "options", "register"]
