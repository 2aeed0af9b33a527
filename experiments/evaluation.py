"""Metrics of a recording by its manoeuvre, and their form in a JSON file."""

import math
from typing import Any

from experiments.friction_study import held_ripple
from steer_env import metrics
from steer_env.metrics import Value
from steer_env.recording import Recording

HOLD_RIPPLE = "torsion_bar_ripple"


def evaluate(recording: Recording) -> dict[str, Value]:
    """Every metric of the manoeuvre that the recording's meta names; refusals carry their reason.

    Raises
    ------
    ValueError
        If the meta names no manoeuvre that has metrics.
    """
    manoeuvre, frequency = recording.meta.get("manoeuvre"), recording.meta.get("frequency_hz") or 0.0
    if manoeuvre == "weave":
        return metrics.weave(recording, frequency)
    if manoeuvre == "slow-ramp":
        return metrics.slow_ramp(recording, frequency)
    if manoeuvre == "rig":  # the car stands still: what is read over its motion has no meaning
        values = metrics.weave(recording, frequency)
        return {name: value for name, value in values.items() if metrics.definition(name).validity is None}
    if manoeuvre == "hold":
        return {HOLD_RIPPLE: Value(held_ripple(recording), math.nan, math.nan, "N m")}
    raise ValueError(f"no metrics for manoeuvre {manoeuvre!r}; there are some for weave, slow-ramp, rig, hold")


def entry(value: Value) -> dict[str, Any]:
    """A metric as JSON: null for what there is not, and the reason of a refusal."""
    value_, low, high = (x if math.isfinite(x) else None for x in value[:3])
    reason = {"reason": value.reason} if value.reason else {}
    return {"value": value_, "ci": [low, high], "unit": value.unit, **reason}


def entries(values: dict[str, Value]) -> dict[str, dict[str, Any]]:
    """Metrics by name as JSON."""
    return {name: entry(value) for name, value in values.items()}
