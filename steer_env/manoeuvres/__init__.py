"""Manoeuvres: what the hands do, defined once for the environments and for the test battery, one file each.

A manoeuvre prescribes the handwheel angle (steering robot) or the hand torque over time, at a held speed. Its amplitude
is given, or found so that the car reaches a lateral acceleration. Test conditions are after the named standards; no
conformance is claimed. Every module in this folder is imported, which registers its manoeuvre.
"""

import importlib
import pkgutil

from steer_env.manoeuvres.definition import Manoeuvre, available, make, options, register
from steer_env.manoeuvres.driving import build_plant, drive, find_amplitude, inputs

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")

__all__ = ["Manoeuvre", "available", "build_plant", "drive", "find_amplitude", "inputs", "make", "options", "register"]
