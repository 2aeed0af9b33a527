"""Steering metrics: one file a kind of test, each metric with its definition, source, validity and interval.

``evaluate(recording)`` reads a recording by the manoeuvre that its meta names. Every module in this folder is imported,
which registers its tests and metrics.
"""

import importlib
import pkgutil

from steer_env.metrics.common.definitions import (
    UNITS,
    Bounded,
    Metric,
    Procedure,
    RefusedError,
    Value,
    available,
    conditions,
    definition,
    evaluate,
    metric,
    procedure,
    procedure_by_name,
    procedure_of,
    read,
    tests,
)
from steer_env.metrics.common.reading import CHANNELS, Reading

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")

__all__ = [
    "CHANNELS",
    "UNITS",
    "Bounded",
    "Metric",
    "Procedure",
    "Reading",
    "RefusedError",
    "Value",
    "available",
    "conditions",
    "definition",
    "evaluate",
    "metric",
    "procedure",
    "procedure_by_name",
    "procedure_of",
    "read",
    "tests",
]
