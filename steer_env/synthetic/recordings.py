"""What the recordings with known answers are made of, and single changes to them."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env import metrics
from steer_env.recording.recording import Recording

Array = NDArray[np.floating[Any]]
Answers = dict[str, float | str]  # metric -> its value in the reporting unit, or what its refusal must say
Made = tuple[Recording, Answers]

UNSIGNED = ("vehicle_speed", "x")  # channels that are the same to the left and to the right


def recording(test: str, time: Array, meta: Mapping[str, Any] | None = None, /, **channels: Array) -> Recording:
    """Channels (T,) in SI as a recording of a test."""
    units = {name: metrics.CHANNELS[name] for name in channels}
    return Recording(time, channels, units, {"manoeuvre": test, **(meta or {})})


def changed(given: Recording, **channels: Array | None) -> Recording:
    """The recording with other values (T,) in some channels; None leaves one out."""
    merged = {name: values for name, values in {**given.channels, **channels}.items() if values is not None}
    return replace(given, channels=merged, units={name: metrics.CHANNELS[name] for name in merged})


def mirrored(given: Recording) -> Recording:
    """The same to the other side."""
    return changed(given, **{name: -values for name, values in given.channels.items() if name not in UNSIGNED})


def half_cosine(x: Array) -> Array:
    """From 0 to 1 while x goes from 0 to 1."""
    return 0.5 * (1.0 - np.cos(np.pi * np.clip(x, 0.0, 1.0)))


def smooth_step(x: Array) -> Array:
    """From 0 to 1 while x goes from 0 to 1, 3 x^2 - 2 x^3."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def second_order(t: Array, damping: float, omega: float) -> Array:
    """From 1 to 0 by a damped oscillation that starts from t = 0 without a slope; ``omega`` undamped [rad/s]."""
    t = np.clip(t, 0.0, None)
    damped = omega * np.sqrt(1.0 - damping**2)
    return np.exp(-damping * omega * t) * (np.cos(damped * t) + damping * omega / damped * np.sin(damped * t))


def overshoot(damping: float) -> float:
    """First extreme of :func:`second_order` beyond zero, over where it began."""
    return float(np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2)))
