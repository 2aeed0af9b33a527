"""Metrics of a recording by its manoeuvre, and their form in a JSON file."""

import math
from typing import Any

import control
import numpy as np

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
    if manoeuvre == "step-steer":
        return step_response(recording)
    if manoeuvre == "parking":
        return parking(recording)
    if manoeuvre == "hold":
        return {HOLD_RIPPLE: _plain(held_ripple(recording), "N m")}
    raise ValueError(
        f"no metrics for manoeuvre {manoeuvre!r}; there are some for weave, slow-ramp, step-steer, parking, rig, hold"
    )


def step_response(recording: Recording) -> dict[str, Value]:
    """Response of yaw rate and lateral acceleration, timed from where the handwheel has turned half of its way."""
    angle = recording["handwheel_angle"]
    middle = int(np.argmax(np.abs(angle) >= 0.5 * abs(angle[-1])))
    values: dict[str, Value] = {}
    for name, unit, short in (("yaw_rate", "1/s", "yaw_rate"), ("lateral_acceleration", "m/s2/rad", "ay")):
        response = recording[name] * np.sign(angle[-1])
        last = recording.time > recording.time[-1] - 1.0
        steady = float(response[last].mean())
        found = control.step_info(response, T=recording.time, yfinal=steady, SettlingTimeThreshold=0.05)
        values |= {
            f"{short}_gain": _plain(steady / abs(float(angle[-1])), unit),
            f"{short}_time_to_90": _plain(
                float(recording.time[np.argmax(response >= 0.9 * steady)] - recording.time[middle]), "s"
            ),
            f"{short}_peak_time": _plain(found["PeakTime"] - float(recording.time[middle]), "s"),
            f"{short}_overshoot": _plain(found["Overshoot"] / 100.0, "1"),
        }
    return values


def parking(recording: Recording) -> dict[str, Value]:
    """Effort of the last cycle between its locks; the rack's end stops are left out by 5 % of the angle."""
    settled = recording.time > recording.time[-1] - 1.0 / recording.meta["frequency_hz"]
    angle, rate = recording["handwheel_angle"][settled], recording["handwheel_speed"][settled]
    force, torque = recording["rack_force"][settled], recording["handwheel_torque"][settled]
    inside, centre = np.abs(angle) < 0.95 * np.abs(angle).max(), np.abs(angle) < 0.05 * np.abs(angle).max()
    outward = inside & (rate * angle > 0.0)
    return {
        "rack_force_at_centre": _plain(float(np.abs(force[centre]).mean()), "N"),
        "rack_force_peak": _plain(float(np.abs(force[inside]).max()), "N"),
        "rack_force_mean_towards_lock": _plain(float(np.abs(force[outward]).mean()), "N"),
        "handwheel_torque_at_centre": _plain(float(np.abs(torque[centre]).mean()), "N m"),
        "handwheel_torque_peak": _plain(float(np.abs(torque[inside]).max()), "N m"),
        "motor_torque_peak": _plain(float(np.abs(recording["motor_torque"][settled][inside]).max()), "N m"),
    }


def _plain(value: float, unit: str) -> Value:
    """A reading without repeats, so without an interval."""
    return Value(value, math.nan, math.nan, unit)


def entry(value: Value) -> dict[str, Any]:
    """A metric as JSON: null for what there is not, and the reason of a refusal."""
    value_, low, high = (x if math.isfinite(x) else None for x in value[:3])
    reason = {"reason": value.reason} if value.reason else {}
    return {"value": value_, "ci": [low, high], "unit": value.unit, **reason}


def entries(values: dict[str, Value]) -> dict[str, dict[str, Any]]:
    """Metrics by name as JSON."""
    return {name: entry(value) for name, value in values.items()}
