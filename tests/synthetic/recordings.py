"""Building blocks of the recordings with known answers, and changes to recordings."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env import metrics
from steer_env.recording.recording import Recording

Array = NDArray[np.floating[Any]]
Answers = dict[str, float | str]  # metric -> its value in the reporting unit, or a part of the reason for its refusal
Example = tuple[Recording, Answers]

UNSIGNED = ("vehicle_speed", "x")  # channels that are the same to the left and to the right


def recording(test: str, time: Array, meta: Mapping[str, Any] | None = None, /, **channels: Array) -> Recording:
    """A recording of a test with channels (T,) in SI."""
    units = {name: metrics.CHANNELS[name] for name in channels}
    return Recording(time, channels, units, {"manoeuvre": test, **(meta or {})})


def changed(given: Recording, **channels: Array | None) -> Recording:
    """The recording with other values (T,) in some channels; None removes a channel."""
    merged = {name: values for name, values in {**given.channels, **channels}.items() if values is not None}
    return replace(given, channels=merged, units={name: metrics.CHANNELS[name] for name in merged})


def mirrored(given: Recording) -> Recording:
    """The recording with left and right exchanged."""
    return changed(given, **{name: -values for name, values in given.channels.items() if name not in UNSIGNED})


def half_cosine(x: Array) -> Array:
    """A half cosine from 0 to 1 while x goes from 0 to 1."""
    return 0.5 * (1.0 - np.cos(np.pi * np.clip(x, 0.0, 1.0)))


def smooth_step(x: Array) -> Array:
    """The polynomial 3 x^2 - 2 x^3 from 0 to 1 while x goes from 0 to 1."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


def second_order(t: Array, damping: float, omega: float) -> Array:
    """A damped oscillation from 1 to 0 that starts at t = 0 with zero slope; ``omega`` is undamped [rad/s]."""
    t = np.clip(t, 0.0, None)
    damped = omega * np.sqrt(1.0 - damping**2)
    return np.exp(-damping * omega * t) * (np.cos(damped * t) + damping * omega / damped * np.sin(damped * t))


def overshoot(damping: float) -> float:
    """Size of the first extreme of :func:`second_order` beyond zero, over its initial value."""
    return float(np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2)))
