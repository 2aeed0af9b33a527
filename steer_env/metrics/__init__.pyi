from .common.definitions import (
    UNITS,
    Bounded,
    ManoeuvreEvaluation,
    Metric,
    Metrics,
    RefusedError,
    Value,
    available,
    conditions,
    definition,
    evaluation_by_name,
    evaluation_of,
    metric,
    register_evaluation,
)
from .common.evaluate import evaluate, read
from .common.filtered_channels import CHANNELS, FilteredChannels
from .common.frequency_response import frequency_response_curve
from .common.registry import tests

__all__ = [
    "CHANNELS",
    "UNITS",
    "Bounded",
    "FilteredChannels",
    "ManoeuvreEvaluation",
    "Metric",
    "Metrics",
    "RefusedError",
    "Value",
    "available",
    "conditions",
    "definition",
    "evaluate",
    "evaluation_by_name",
    "evaluation_of",
    "frequency_response_curve",
    "metric",
    "read",
    "register_evaluation",
    "tests",
]
