"""Evaluation of a recording: every metric of a test with its 95 % interval, or the reason for which it is refused."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from steer_env.friction.numerics.check import not_negative
from steer_env.metrics.common.confidence import interval
from steer_env.metrics.common.definitions import (
    SPEED_SPREAD,
    UNITS,
    Bounded,
    Metric,
    RefusedError,
    Value,
    available,
    definition,
    evaluation_of,
)
from steer_env.metrics.common.filtered_channels import DoubleFiltered
from steer_env.recording.recording import Recording

REFERENCE = "handwheel_angle"  # the channel relative to which the timing of the others matters
ROUNDING = 1e-9  # changes of a value below this fraction of it are rounding errors [1]


def evaluate(recording: Recording, test: str | None = None, *, timing: float = 0.0, **given: Any) -> dict[str, Value]:
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
    given
        Conditions that replace those of the meta and of the test, e.g. ``speed_m_s=22.2``.

    Where a metric has repeats, its interval is also widened by the change of the metric when every low-pass is applied
    twice, because the first application changes the metric by about as much.

    Returns
    -------
    dict of str to Value
        One entry for every name of ``available(test)``; a refused metric has a reason.

    Raises
    ------
    ValueError
        For an unknown test or condition, or a negative timing.
    """
    not_negative("timing", timing)
    names = available(evaluation_of(recording, test).name)
    repeats = _repeats(names, recording, test, given)
    filtered_twice = DoubleFiltered(recording.time, recording.channels, recording.units, recording.meta)
    again = _repeats(names, filtered_twice, test, given)
    filter_change = {name: _change(found, again[name]) for name, found in repeats.items()}
    timing_change: dict[str, float] = dict.fromkeys(names, 0.0)
    for channel in recording.channels if timing else ():
        if channel != REFERENCE:
            shifted = [_repeats(names, _shifted(recording, channel, by), test, given) for by in (-timing, timing)]
            for name, found in repeats.items():
                timing_change[name] += max(_change(found, other[name]) for other in shifted)
    return {
        name: _value(definition(name), found, timing_change[name], filter_change[name])
        for name, found in repeats.items()
    }


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
        if entry.constant_speed:
            _check_speed(recording, conditions)
        return entry.read(recording, conditions)
    except ValueError as error:  # a recording that cannot be filtered also says what to do
        raise RefusedError(str(error)) from None


def _repeats(
    names: tuple[str, ...], recording: Recording, test: str | None, given: Mapping[str, Any]
) -> dict[str, Bounded | RefusedError]:
    """Values (n,) of the repeats of every metric in its reporting unit, or the error that refused it."""
    try:
        found = read(recording, test, **given)
    except RefusedError as error:
        return dict.fromkeys(names, error)
    return {name: _computed(definition(name), found) for name in names}


def _shifted(recording: Recording, channel: str, seconds: float) -> Recording:
    """The recording with one channel moved to later."""
    later = np.interp(recording.time - seconds, recording.time, recording[channel])
    return replace(recording, channels={**recording.channels, channel: later})


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


def _value(entry: Metric, found: Bounded | RefusedError, timing_change: float, filter_change: float) -> Value:
    """Mean over the repeats and its interval, or the reason for which there is none.

    The interval is widened by ``timing_change`` at either end and, where it comes from repeats, by ``filter_change``.
    """
    if np.isinf(timing_change) and not isinstance(found, RefusedError):
        found = RefusedError(
            "a shift of the channels within the given timing makes this metric unreadable: align the channels more "
            "closely"
        )
    if isinstance(found, RefusedError):
        return Value(np.nan, np.nan, np.nan, entry.unit, str(found))
    repeats = found.values
    mean = float(repeats.mean())
    low, high = interval(repeats)
    change = timing_change
    if repeats.size > 1 and np.isfinite(filter_change) and filter_change > ROUNDING * abs(mean):
        change += filter_change
    below, above = change + found.below, change + found.above
    if below or above:
        low, high = (low - below, high + above) if repeats.size > 1 else (mean - below, mean + above)
    return Value(mean, low, high, entry.unit, repeats=tuple(repeats.tolist()))
