"""The test battery of the report: each manoeuvre with each law, and how the metrics of the laws differ."""

import hashlib
import math
import pickle
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import manoeuvres, metrics
from steer_env.experiments.pages.plots import thin_out
from steer_env.experiments.studies.common import simulation_vs_measurement
from steer_env.manoeuvres.common import driving
from steer_env.metrics import RefusedError, Value
from steer_env.metrics.common import just_noticeable
from steer_env.metrics.common.confidence import difference as gap_between
from steer_env.recording.recording import Recording
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]

# Manoeuvres that a script describes; free driving is for recordings, as a script shows the same more sharply.
SCRIPTED = tuple(name for name in manoeuvres.available() if name != "road")
POINTS = 500  # of a curve
PER_SECOND = 12.0  # points of a long history [1/s]
MATTERS = 0.05  # share of a metric above which a difference is said to matter; assumed
# Least scale of a share, by unit, as a share of a value near zero says nothing: the least torque and angle that shares
# are felt by, and an assumed yaw rate.
LEAST = {**just_noticeable.LEAST_STIMULUS, "deg/s": 1.0}


class Drive(NamedTuple):
    """One law in one test."""

    values: dict[str, Value]
    curves: simulation_vs_measurement.Curves  # as in ``simulation_vs_measurement.curves``, thinned; empty if refused
    amplitude: float  # of the handwheel angle [rad], or of the hand torque [N m]; NaN for a driver
    site_loss: float | None  # loss at the friction site in each cycle [J]; None unless the test is periodic
    failure: str = ""  # why the test could not be driven


LIKE = "lugre"  # with its default parameters, whose amplitudes lie near those of any law
_NO_NUMBERS = ("hand", "reach", "driver", "others")  # functions of a manoeuvre, which cannot be compared
_near_amplitudes: dict[bytes, driving.FoundAmplitude] = {}  # of this process


def near_amplitude(car: Car, manoeuvre: manoeuvres.Manoeuvre) -> driving.FoundAmplitude | None:
    """Where the search for an amplitude begins, whatever the law.

    Every process looks for it by itself, so that no result depends on where and after what it is computed.
    """
    if manoeuvre.lateral_acceleration is None or manoeuvre.amplitude is not None:
        return None
    told = [getattr(manoeuvre, each.name) for each in fields(manoeuvre) if each.name not in _NO_NUMBERS]
    hand = manoeuvre.hand(np.linspace(0.0, manoeuvre.duration, POINTS), 1.0)
    key = hashlib.sha256(pickle.dumps((car, told, hand))).digest()
    if key not in _near_amplitudes:
        with suppress(ValueError):
            _near_amplitudes[key] = driving.search(
                driving.build_plant(car, manoeuvre, LIKE), manoeuvre, near=driving.FAR_START_AMPLITUDE
            )
    return _near_amplitudes.get(key)


def recording(car: Car, manoeuvre: manoeuvres.Manoeuvre, p: Any) -> Recording:
    """Drive a manoeuvre, as :func:`steer_env.manoeuvres.drive` does."""
    return manoeuvres.drive(car, manoeuvre, p, near=near_amplitude(car, manoeuvre))


def drive(
    car: Car,
    p: Any,
    test: str,
    options: Mapping[str, Any] | None = None,
    run: Callable[[Car, manoeuvres.Manoeuvre, Any], Recording] = recording,
) -> Drive:
    """Drive a test and evaluate its metrics; every metric of a test that cannot be driven carries the reason.

    ``run`` drives a manoeuvre.
    """
    try:
        recording = run(car, manoeuvres.make(test, **(options or {})), p)
    except ValueError as error:
        refused = {
            name: Value(np.nan, np.nan, np.nan, metrics.definition(name).unit, str(error))
            for name in metrics.available(test)
        }
        return Drive(refused, {}, math.nan, None, str(error))
    meta = recording.meta
    return Drive(
        metrics.evaluate(recording),
        _thin(recording),
        meta.get("amplitude_rad", meta.get("amplitude_nm", math.nan)),
        _site_loss(recording, 1.0 / meta["frequency_hz"]) if meta["frequency_hz"] else None,
    )


def _thin(recording: Recording) -> simulation_vs_measurement.Curves:
    try:
        curves = simulation_vs_measurement.curves(recording, metrics.evaluation_of(recording))
    except RefusedError:  # the metrics give the reason
        return {}
    points = max(POINTS, round(PER_SECOND * curves["time"][-1])) if "time" in curves else POINTS
    return {name: thin_out(values, points).astype(np.float32) for name, values in curves.items()}


def _site_loss(recording: Recording, period: float) -> float:
    """Work done against friction in the last cycle but one [J]."""
    end = recording.time[-1] - period
    power = recording["friction_torque"] * recording["column_speed"]
    return float(np.sum(power[(recording.time > end - period) & (recording.time <= end)]) * SAMPLE_TIME)


class Difference(NamedTuple):
    """A metric with one law less the metric with the base law, with its 95 % interval; NaN if either is refused."""

    value: float  # [unit of the metric]
    half_width: float  # of the interval [unit of the metric]
    share: float  # of the larger of the base law's value and the usual range's width, or LEAST without a range [1]
    perception: just_noticeable.Perception = just_noticeable.Perception(just_noticeable.UNKNOWN)

    @property
    def reach(self) -> float:
        """The half width as a share, as the difference itself is [1]; 0 without an interval."""
        reach = self.half_width * abs(self.share / self.value) if self.value else 0.0
        return reach if math.isfinite(reach) else 0.0

    @property
    def real(self) -> bool:
        """Whether the interval excludes zero; a difference of single events counts as real."""
        return math.isfinite(self.share) and not abs(self.value) <= self.half_width

    @property
    def matters(self) -> bool:
        """Whether it is real and large enough to matter."""
        return self.real and abs(self.share) > MATTERS


def difference(name: str, value: Value, base: Value, noticed: float = just_noticeable.SHARE) -> Difference:
    """Difference between two values of a metric, with the interval of independent readings.

    ``noticed`` is the just-noticeable difference of :func:`just_noticeable.perception`.
    """
    about = metrics.definition(name)
    scale = max(abs(base.value), about.usual[1] - about.usual[0] if about.usual else LEAST.get(about.unit, 0.0))
    if value.reason or base.reason:
        return Difference(math.nan, math.nan, math.nan)
    gap, low, high = gap_between(np.array(base.repeats), np.array(value.repeats))
    perceived = just_noticeable.perception(name, base.value, (gap, low, high), noticed)
    return Difference(gap, 0.5 * (high - low), gap / scale if scale > 0.0 else math.nan, perceived)


def as_json(found: Difference) -> dict[str, Any]:
    """A difference as JSON: null for what is not finite."""
    numbers = {name: getattr(found, name) for name in ("value", "half_width", "share")}
    return {
        **{name: x if math.isfinite(x) else None for name, x in numbers.items()},
        "real": found.real,
        "large": found.matters,
        "perception": found.perception.verdict,
        "perception_sure": found.perception.sure,
    }


def differences(
    drives: dict[str, Drive], base: str, noticed: float = just_noticeable.SHARE
) -> dict[str, dict[str, Difference]]:
    """Metric -> law -> difference to the base law; ``noticed`` as for :func:`difference`."""
    return {
        name: {
            law: difference(name, found.values[name], drives[base].values[name], noticed)
            for law, found in drives.items()
            if law != base
        }
        for name in drives[base].values
    }


class Largest(NamedTuple):
    """The metric in which a law differs most from the base law."""

    share: float  # as in ``Difference`` [1]
    law: str
    metric: str


def largest(table: dict[str, dict[str, Difference]], laws: list[str]) -> Largest | None:
    """The largest share among some laws; None if there is none."""
    shares = [
        Largest(abs(row[law].share), law, name)
        for name, row in table.items()
        for law in laws
        if law in row and row[law].real
    ]
    return max(shares, default=None)
