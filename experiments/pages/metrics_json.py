"""Metrics as JSON."""

import math
from typing import Any

from steer_env.metrics import Value


def entry(value: Value) -> dict[str, Any]:
    """A metric as JSON: null for a value that is missing, the reason of a refusal, and notes where there are some."""
    value_, low, high = (x if math.isfinite(x) else None for x in value[:3])
    reason = {"reason": value.reason} if value.reason else {}
    notes = {"notes": list(value.notes)} if value.notes else {}
    return {"value": value_, "ci": [low, high], "unit": value.unit, **reason, **notes}


def entries(values: dict[str, Value]) -> dict[str, dict[str, Any]]:
    """Metrics by name, each as JSON."""
    return {name: entry(value) for name, value in values.items()}
