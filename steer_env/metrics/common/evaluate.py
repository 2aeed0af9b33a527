"""Evaluation of a recording: every metric of a test with its 95 % interval, or the reason for which it is refused."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from steer_env.friction.numerics.check import not_negative, number
from steer_env.metrics.common import plausible
from steer_env.metrics.common.confidence import interval
from steer_env.metrics.common.definitions import (
    SPEED_SPREAD,
    UNITS,
    Bounded,
    Doubt,
    Metric,
    RefusedError,
    Value,
    available,
    definition,
    evaluation_of,
)
from steer_env.metrics.common.filtered_channels import ANGLE, TORQUE, DoubleFiltered
from steer_env.recording import driven
from steer_env.recording.recording import Recording

SCALE = "torque_scale_error"  # key of the meta
ROUNDING = 1e-9  # changes of a value below this fraction of it are rounding errors [1]


def evaluate(
    recording: Recording,
    test: str | None = None,
    *,
    timing: float = 0.0,
    torque_scale_error: float | None = None,
    intervals: bool = True,
    **given: Any,
) -> dict[str, Value]:
    """Every metric of a test for a recording from a simulation or from a car.

    Parameters
    ----------
    recording : Recording
    test : str, optional
        A name from :func:`steer_env.metrics.tests`; by default the manoeuvre that the recording's meta names.
    timing : float
        Largest error of the relative timing of the channels [s]. A channel that is late looks like a lag of the car.
        Each interval is therefore widened by the change of the metric when one channel after the other is shifted by
        +-timing relative to the handwheel angle.
    torque_scale_error : float, optional
        Largest error of the scale of the hand torque, as a fraction: 0.02 where the sensor may read 2 % too much or too
        little [1]. Each interval is widened by the change of the metric when the torque is divided by 1 +- the error.
        By default ``torque_scale_error`` of the recording's meta, or 0.
    intervals : bool
        False leaves the intervals out, which take half the time: ``low`` and ``high`` are NaN, the rest is the same.
    given
        Conditions that replace those of the meta and of the test, e.g. ``speed_m_s=22.2``.

    Where a metric has repeats, its interval is also widened by the change of the metric when every low-pass is applied
    twice, because the first application changes the metric by about as much. It is widened as well by what the reading
    of the test itself leaves open (:class:`steer_env.metrics.common.definitions.Doubt`).

    Returns
    -------
    dict of str to Value
        One entry for every name of ``available(test)``; a refused metric has a reason.

    Raises
    ------
    ValueError
        For an unknown test or condition, a negative timing, or an error of the scale that is not from 0 to below 1.
    """
    not_negative("timing", timing)
    scale = number(
        "torque_scale_error", recording.meta.get(SCALE, 0.0) if torque_scale_error is None else torque_scale_error
    )
    if not 0.0 <= scale < 1.0:
        raise ValueError(f"torque_scale_error is {scale:g}; it is a fraction from 0 to below 1, 0.02 for 2 %")
    names = available(evaluation_of(recording, test).name)

    def again(other: Recording) -> Any:
        return _read(other, test, given)

    reading = again(recording)
    repeats = _repeats(names, reading)
    filter_change = dict.fromkeys(names, 0.0)
    if intervals:
        filtered_twice = DoubleFiltered(recording.time, recording.channels, recording.units, recording.meta)
        others = _repeats(names, again(filtered_twice))
        filter_change = {name: _change(repeats[name], other) for name, other in others.items()}
    doubts = _declared(recording, timing, scale, again)
    if hasattr(reading, "doubts"):
        doubts += reading.doubts()
    # The largest change of every metric, by doubt.
    changes = [
        (doubt, [{n: _change(repeats[n], v) for n, v in _repeats(names, other).items()} for other in doubt.others])
        for doubt in doubts
    ]
    notes = tuple(reading.notes()) if hasattr(reading, "notes") else ()
    if scale and TORQUE in recording.channels:
        notes += (f"the intervals allow for an error of {scale:.2g} of the scale of {TORQUE}",)
    found = {}
    for name, values in repeats.items():
        widening = [(doubt, max(change[name] for change in of)) for doubt, of in changes]
        value = _value(definition(name), values, widening, filter_change[name])._replace(notes=notes)
        found[name] = value if intervals else value._replace(low=np.nan, high=np.nan)
    return found


def _declared(recording: Recording, timing: float, scale: float, again: Callable[[Recording], Any]) -> list[Doubt]:
    """The doubts that the user has declared: how well the channels are aligned, and how well the torque is scaled."""
    found = []
    for channel in recording.channels if timing else ():
        if channel != ANGLE and channel not in driven.CHANNELS:
            others = tuple(again(_shifted(recording, channel, by)) for by in (-timing, timing))
            found.append(Doubt(f"the timing of {channel}", "align the channels more closely", others))
    if scale and TORQUE in recording.channels:
        others = tuple(again(_scaled(recording, TORQUE, 1.0 / (1.0 + error))) for error in (-scale, scale))
        found.append(Doubt(f"the scale of {TORQUE}", "calibrate the sensor more closely", others))
    return found


def read(recording: Recording, test: str | None = None, **given: Any) -> Any:
    """The object that the metrics of a test take; arguments and errors as for :func:`evaluate`.

    Raises
    ------
    RefusedError
        Where no metric can be computed; the text says why.
    """
    entry = evaluation_of(recording, test)
    unknown = given.keys() - entry.conditions.keys()
    if unknown:
        allowed = ", ".join(entry.conditions) or "none"
        raise ValueError(f"{entry.name} has no condition {sorted(unknown)[0]!r}; there are {allowed}")
    meta = {key: recording.meta[key] for key in entry.conditions if recording.meta.get(key) is not None}
    conditions = {**entry.conditions, **meta, **given}
    try:
        driven.check(recording)
        if entry.constant_speed:
            _check_speed(recording, conditions)
        if entry.steered:
            plausible.check(recording, conditions.get("speed_m_s"))
        return entry.read(recording, conditions)
    except ValueError as error:  # a recording that cannot be filtered also says what to do
        raise RefusedError(str(error)) from None


def _read(recording: Recording, test: str | None, given: Mapping[str, Any]) -> Any:
    """The object that the metrics take, or the error that refused all of them."""
    try:
        return read(recording, test, **given)
    except RefusedError as error:
        return error


def _repeats(names: tuple[str, ...], reading: Any) -> dict[str, Bounded | RefusedError]:
    """Values (n,) of the repeats of every metric in its reporting unit, or the error that refused it."""
    if isinstance(reading, RefusedError):
        return dict.fromkeys(names, reading)
    return {name: _computed(definition(name), reading) for name in names}


def _shifted(recording: Recording, channel: str, seconds: float) -> Recording:
    """The recording with one channel moved to later."""
    later = np.interp(recording.time - seconds, recording.time, recording[channel])
    return replace(recording, channels={**recording.channels, channel: later})


def _scaled(recording: Recording, channel: str, factor: float) -> Recording:
    """The recording with one channel multiplied."""
    return replace(recording, channels={**recording.channels, channel: factor * recording[channel]})


def _change(found: Bounded | RefusedError, other: Bounded | RefusedError) -> float:
    """Absolute difference of the means; infinite where either was refused."""
    if isinstance(found, RefusedError) or isinstance(other, RefusedError):
        return np.inf
    return float(abs(other.values.mean() - found.values.mean()))


def _check_speed(recording: Recording, conditions: Mapping[str, Any]) -> None:
    """Refuse a recording whose mean speed is not the speed that the test prescribes."""
    speed = conditions.get("speed_m_s")
    if speed and recording.units.get("vehicle_speed") == "m/s":
        found = float(np.nanmean(recording["vehicle_speed"]))
        if not abs(found / speed - 1) <= SPEED_SPREAD:
            raise RefusedError(
                f"vehicle_speed is {3.6 * found:.4g} km/h on average, not {3.6 * speed:.4g} km/h +- "
                f"{SPEED_SPREAD:.0%}: drive at that speed, or say that the test was at {3.6 * found:.4g} km/h "
                f"(speed_m_s={found:.4g})"
            )


def _computed(entry: Metric, found: Any) -> Bounded | RefusedError:
    """Values of a metric in its reporting unit, or the error that refused it."""
    try:
        if entry.validity:
            low, high = entry.validity
            peak = found.peak_acceleration()
            if not low <= peak <= high:
                advice = f"below {low:g} g: steer further" if peak < low else f"above {high:g} g: steer less far"
                raise RefusedError(f"lateral_acceleration peaks at {peak:.3f} g, {advice}")
        result = entry.read(found)
        values, below, above = result if isinstance(result, Bounded) else (result, 0.0, 0.0)
        scale = UNITS[entry.unit]
        values = np.atleast_1d(np.asarray(values, dtype=float)) * scale
        if not np.all(np.isfinite(values)):
            raise RefusedError("the recording gives no finite value of this metric")
    except RefusedError as refused:
        return refused
    return Bounded(values, below * scale, above * scale)


def _value(
    entry: Metric, found: Bounded | RefusedError, widening: Sequence[tuple[Doubt, float]], filter_change: float
) -> Value:
    """Mean over the repeats and its interval, or the reason for which there is none.

    The interval is widened by the sum of ``widening`` at either end and, where it comes from repeats, by
    ``filter_change``.
    """
    if not isinstance(found, RefusedError):
        for doubt, size in widening:
            if np.isinf(size):
                found = RefusedError(f"{doubt.about} is in doubt so far that this metric is unreadable: {doubt.remedy}")
                break
    if isinstance(found, RefusedError):
        return Value(np.nan, np.nan, np.nan, entry.unit, str(found))
    repeats = found.values
    mean = float(repeats.mean())
    low, high = interval(repeats)
    change = sum((size for _, size in widening), 0.0)
    if repeats.size > 1 and np.isfinite(filter_change) and filter_change > ROUNDING * abs(mean):
        change += filter_change
    below, above = change + found.below, change + found.above
    if below or above:
        low, high = (low - below, high + above) if repeats.size > 1 else (mean - below, mean + above)
    return Value(mean, low, high, entry.unit, repeats=tuple(repeats.tolist()))
