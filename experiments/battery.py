"""The test battery of the report: weave and slow ramp with every law, and what the law changes in each metric."""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import manoeuvres, metrics
from steer_env.metrics import Value, evaluate
from steer_env.metrics.loops import Loops
from steer_env.metrics.reading import ANGLE, AY, TORQUE
from steer_env.recording import Recording
from vehicle.assist import SAMPLE_TIME
from vehicle.cars import Car

Array = NDArray[np.float64]


class Drive(NamedTuple):
    """One law in one test."""

    values: dict[str, Value]
    cycle: dict[str, Array]  # (1000,) mean settled cycle of angle, torque, lateral acceleration [SI]; empty if refused
    amplitude: float  # of the handwheel angle [rad]
    site_loss: float  # at the friction site, each cycle [J]


def manoeuvre(test: str, cycles: int) -> manoeuvres.Manoeuvre:
    """Weave or slow ramp with a number of cycles."""
    return manoeuvres.make(test, cycles=cycles)


def drive(car: Car, p: Any, test: str, cycles: int, chassis: str = "single_track") -> Drive:
    """Drive a test and read its metrics; ValueError where the manoeuvre cannot be driven."""
    recording = manoeuvres.drive(car, replace(manoeuvre(test, cycles), chassis=chassis), p)
    frequency = recording.meta["frequency_hz"]
    try:
        loops = Loops(recording, recording.meta, fewest=1)
        cycle = {name: loops.cycles(name).mean(axis=0) for name in (ANGLE, TORQUE, AY)}
    except ValueError:  # evaluate says why in every metric's reason
        cycle = {}
    return Drive(evaluate(recording), cycle, recording.meta["amplitude_rad"], _site_loss(recording, 1.0 / frequency))


def _site_loss(recording: Recording, period: float) -> float:
    """Work that friction takes in the last cycle but one [J]."""
    end = recording.time[-1] - period
    power = recording["friction_torque"] * recording["column_speed"]
    return float(np.sum(power[(recording.time > end - period) & (recording.time <= end)]) * SAMPLE_TIME)


class Difference(NamedTuple):
    """A metric of one law less that of the base law, with its 95 % interval; NaN if either is refused."""

    value: float  # [unit of the metric]
    half_width: float  # of the interval [unit of the metric]
    share: float  # of the base law's value, or of the width of the usual range if that is larger [1]


def difference(name: str, value: Value, base: Value) -> Difference:
    """What the law changes; the two intervals add as those of independent readings."""
    usual = metrics.definition(name).usual
    scale = max(abs(base.value), usual[1] - usual[0] if usual else 0.0)
    gap = value.value - base.value
    half = math.hypot(value.high - value.low, base.high - base.low) / 2.0
    return Difference(gap, half, gap / scale if scale > 0.0 else math.nan)


def differences(drives: dict[str, Drive], base: str) -> dict[str, dict[str, Difference]]:
    """Metric -> law -> difference to the base law."""
    return {
        name: {
            law: difference(name, found.values[name], drives[base].values[name])
            for law, found in drives.items()
            if law != base
        }
        for name in drives[base].values
    }


class Largest(NamedTuple):
    """The metric that the law changes most."""

    share: float  # as in ``Difference`` [1]
    law: str
    metric: str


def largest(table: dict[str, dict[str, Difference]], laws: list[str]) -> Largest | None:
    """The largest share among some laws; None if there is none."""
    shares = [
        Largest(abs(row[law].share), law, name)
        for name, row in table.items()
        for law in laws
        if law in row and math.isfinite(row[law].share)
    ]
    return max(shares, default=None)
