"""Baseline assist controllers. Every module in this folder is imported, which registers its baseline."""

import importlib
import pkgutil

from steer_env.assists.definition import Baseline, available, make, register

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")

__all__ = ["Baseline", "available", "make", "register"]
