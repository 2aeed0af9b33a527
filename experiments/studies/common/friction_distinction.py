"""Where friction laws of one calibration can be told apart: the same displacement imposed on each of them.

Every experiment is one thing that hands do on centre. The difference of two laws is the RMS of the difference of their
torques over the saturated torque.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import friction
from steer_env.experiments.studies.friction_laws import HISTORIES, NESTED_TURN, SATURATED_TURN, turning_points_history
from steer_env.friction import defaults
from steer_env.recording.recording import DEGREE

Array = NDArray[np.float64]

# RMS difference over F_c from which on two laws count as told apart: three times a noise of 1 %; assumed
DISTINCTION_THRESHOLD = 0.03


class Experiment(NamedTuple):
    """A displacement and the part of it that is compared."""

    short: str
    title: str
    x: Array  # (T,) [rad]
    dt: float  # [s]
    part: slice


def _sine(amplitude: float, frequency: float, cycles: int) -> Array:
    t = np.arange(0.0, cycles / frequency, 1e-3 / frequency)
    return np.asarray(amplitude * DEGREE * np.sin(2.0 * math.pi * frequency * t))


def _corrections() -> Experiment:
    """Small corrections of 0.2 deg at 0.5 Hz around a place that was reached from saturation."""
    approach = turning_points_history((0.0, 4.0), 0.004) * DEGREE
    small = approach[-1] - 0.2 * DEGREE + 0.2 * DEGREE * np.cos(2.0 * math.pi * 0.5 * 2e-3 * np.arange(1, 4001))
    return Experiment(
        "small corrections",
        "small corrections (0.2 deg at 0.5 Hz)",
        np.append(approach, small),
        2e-3,
        slice(2001, None),
    )


def experiments() -> dict[str, Experiment]:
    """The experiments by a short name."""
    nested, held = HISTORIES["nested_loops"], HISTORIES["held"]
    cycles = {
        "slow": ("a sine of 12 deg at 0.02 Hz", 12.0, 0.02),
        "usual": ("a sine of 12 deg at 0.2 Hz", 12.0, 0.2),
        "quick": ("a sine of 12 deg at 2 Hz", 12.0, 2.0),
    }
    last = slice(1000, None)  # without the first cycle
    sines = {
        name: Experiment(f"sines at {frequency:g} Hz", title, _sine(amplitude, frequency, 3), 1e-3 / frequency, last)
        for name, (title, amplitude, frequency) in cycles.items()
    }
    return {
        "saturated": Experiment(
            "large slow loops",
            "reversals from saturation (0.01 deg/s)",
            nested.x,
            nested.dt,
            slice(SATURATED_TURN + 1, NESTED_TURN),
        ),
        "nested": Experiment(
            "nested loops", "nested loops (0.01 deg/s)", nested.x, nested.dt, slice(NESTED_TURN + 1, None)
        ),
        "corrections": _corrections(),
        "held": Experiment("rests", "motion with rests (1 deg/s)", held.x, held.dt, slice(None)),
        **sines,
    }


def differences(laws: Mapping[str, Any], base: str) -> dict[str, dict[str, float]]:
    """Experiment -> law -> RMS difference from the base law over the saturated torque [1]."""
    found: dict[str, dict[str, float]] = {}
    for name, each in experiments().items():
        torques = {law: friction.response(p, each.x, each.dt)[each.part] for law, p in laws.items()}
        found[name] = {
            law: float(np.sqrt(np.mean((torque - torques[base]) ** 2))) / defaults.F_C
            for law, torque in torques.items()
            if law != base
        }
    return found
