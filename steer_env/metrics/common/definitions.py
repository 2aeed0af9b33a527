"""What a metric is, how a test is read, and the one registry of both.

A test is a manoeuvre as it is evaluated: its name, the class that reads a recording of it, and the conditions that the
recording's meta may override. A metric is a function from that reading to one value a repeat (a cycle, a step, ...),
in SI; its docstring is its definition, from which the documentation and the report's glossary are made.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.check import not_negative
from steer_env.metrics.common.confidence import interval
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle.constants import GRAVITY as G

Array = NDArray[np.float64]

# Reporting unit -> its number for one SI unit.
UNITS = dict.fromkeys(("1", "s", "Hz", "N", "N m", "J", "W", "m", "m/s", "m/s2", "1/s", "dB", "kg"), 1.0)
UNITS |= {"ms": 1e3, "g": 1 / G, "N m/g": G, "deg": 1 / DEGREE, "deg/s": 1 / DEGREE, "deg/g": G / DEGREE, "km/h": 3.6}
UNITS["deg s"] = 1 / DEGREE
UNITS |= {"N m/deg": DEGREE, "g/100 deg": 100 * DEGREE / G, "g/(100 N m deg)": 100 * DEGREE / G, "%": 100.0}

_SHOWN = ("handwheel_angle", "handwheel_torque", "yaw_rate", "lateral_acceleration")
HISTORIES = tuple(("time", name) for name in _SHOWN)
REFERENCE = "handwheel_angle"  # against which the other channels' timing counts
ROUNDING = 1e-9  # of a value: less is no change
SPEED_SPREAD = 0.03  # of the mean speed around the one asked for


class Blurred(Recording):
    """A recording whose readings run each low-pass twice: what a metric then changes is what the low-pass does."""


class RefusedError(ValueError):
    """A metric has no meaning for this recording; the text says why and how to get it."""


class Bounded(NamedTuple):
    """Repeats of a metric that all may be wrong alike, by what their scatter does not show."""

    values: Array  # (n,) [SI]
    below: float  # how far below their mean the truth may lie for that [SI]
    above: float  # how far above [SI]


class Value(NamedTuple):
    """A metric of a recording: mean over the repeats and its 95 % interval; NaN with a reason if refused."""

    value: float  # mean over the repeats [unit]
    low: float  # lower end of the interval; NaN where there is one repeat, and no bound [unit]
    high: float  # upper end [unit]
    unit: str
    reason: str = ""
    repeats: tuple[float, ...] = ()  # the values of which it is the mean [unit]


@dataclass(frozen=True)
class Metric:
    """What a metric is; declared by :func:`metric` above the function that reads it."""

    name: str
    unit: str  # of the reported value, a key of UNITS
    definition: str
    source: str
    usual: tuple[float, float] | None  # range of passenger cars [unit]
    validity: tuple[float, float] | None  # peak lateral acceleration from and up to which it may be read [g]; None: any
    tests: tuple[str, ...]  # that report it
    read: Callable[[Any], Any]  # reading of a test -> value, values (n,) of its repeats, or Bounded [SI]


@dataclass(frozen=True)
class Procedure:
    """How a recording of a test is read."""

    name: str
    read: Callable[..., Any]  # (recording, conditions) -> reading; RefusedError where the data cannot carry one
    conditions: Mapping[str, Any]  # as the test has them, with the unit in the name
    constant_speed: bool
    plots: tuple[tuple[str, str], ...]  # pairs (x, y) of channels, or "time" for x, that show the test


_metrics: dict[str, Metric] = {}
_procedures: dict[str, Procedure] = {}


def procedure(
    name: str,
    read: Callable[..., Any],
    *,
    constant_speed: bool = True,
    plots: tuple[tuple[str, str], ...] = HISTORIES,
    **conditions: Any,
) -> None:
    """Register how recordings of a test are read.

    Parameters
    ----------
    name : str
        Of the manoeuvre.
    read : callable
        ``read(recording, conditions)`` gives what the metrics of the test take; it raises :class:`RefusedError` where
        no metric can be read.
    constant_speed : bool
        Whether the mean of ``vehicle_speed`` must be within 3 % of ``speed_m_s``.
    plots : tuple of (str, str)
        Channels over each other, or over "time", that show the test; over time where not given.
    conditions
        Defaults of what the test prescribes: ``speed_m_s``, ``frequency_hz``, ...; a recording's meta comes first.
    """
    _procedures[name] = Procedure(name, read, conditions, constant_speed, plots)


def metric(
    unit: str,
    *tests: str,
    usual: tuple[float, float] | None = None,
    validity: tuple[float, float] | None = None,
    source: str,
) -> Callable[[Callable[[Any], Any]], Callable[[Any], Any]]:
    """Register a function under its name, with its docstring as definition; the rest as in :class:`Metric`."""

    def register(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
        name, text = function.__name__, " ".join((inspect.getdoc(function) or "").split())
        if name in _metrics or not text or unit not in UNITS:
            raise ValueError(f"metric {name!r} needs a name of its own, a docstring and a unit out of {list(UNITS)}")
        _metrics[name] = Metric(name, unit, text, source, usual, validity, tests, function)
        return function

    return register


def tests() -> tuple[str, ...]:
    """Names of the tests that have metrics."""
    return tuple(_procedures)


def conditions(test: str) -> dict[str, Any]:
    """What the test prescribes, with units in the names; ValueError for a test that there is not."""
    return dict(procedure_by_name(test).conditions)


def available(test: str | None = None) -> tuple[str, ...]:
    """Names of the metrics of a test, or of all; ValueError for a test that there is not."""
    if test is not None:
        procedure_by_name(test)
    return tuple(name for name, entry in _metrics.items() if test in (None, *entry.tests))


def definition(name: str) -> Metric:
    """Unit, definition, source, usual range and validity of a metric; ValueError if there is none of that name."""
    if name not in _metrics:
        raise ValueError(f"no metric {name!r}; there are {', '.join(_metrics)}")
    return _metrics[name]


def evaluate(recording: Recording, test: str | None = None, *, timing: float = 0.0, **given: Any) -> dict[str, Value]:
    """Every metric of a test, for a recording from a simulation or from a car.

    Parameters
    ----------
    recording : Recording
        In SI, left positive; a missing channel costs the metrics that need it.
    test : str, optional
        Name out of :func:`tests`; by default the manoeuvre that the recording's meta names.
    timing : float
        To which the channels are known to be simultaneous [s]. A channel that may be late by so much looks like a
        car's lag, so each interval is widened by what the metric changes when one channel after the other is shifted
        by +-timing against the handwheel angle.
    given
        Conditions that differ from those of the meta and of the test, e.g. ``speed_m_s=22.2``.

    Where a metric has repeats, its interval is widened by what the metric changes when every low-pass runs twice: what
    the first one took is about as much.

    Returns
    -------
    dict of str to Value
        One entry for every name of ``available(test)``; what is refused says so in its reason.

    Raises
    ------
    ValueError
        For a test or a condition that there is not, or a timing below zero.
    """
    not_negative("timing", timing)
    names = available(procedure_of(recording, test).name)
    repeats = _repeats(names, recording, test, given)
    slack: dict[str, float] = dict.fromkeys(names, 0.0)
    blurred = Blurred(recording.time, recording.channels, recording.units, recording.meta)
    again = _repeats(names, blurred, test, given)
    blur = {name: _change(found, again[name]) for name, found in repeats.items()}
    for channel in recording.channels if timing else ():
        if channel != REFERENCE:
            shifted = [_repeats(names, _shifted(recording, channel, by), test, given) for by in (-timing, timing)]
            for name, found in repeats.items():
                slack[name] += max(_change(found, other[name]) for other in shifted)
    return {name: _value(_metrics[name], found, slack[name], blur[name]) for name, found in repeats.items()}


def read(recording: Recording, test: str | None = None, **given: Any) -> Any:
    """What the metrics of a test take; arguments and errors as in :func:`evaluate`.

    Raises
    ------
    RefusedError
        Where no metric can be read; the text says why.
    """
    entry = procedure_of(recording, test)
    unknown = given.keys() - entry.conditions.keys()
    if unknown:
        allowed = ", ".join(entry.conditions) or "none"
        raise ValueError(f"{entry.name} has no condition {sorted(unknown)[0]!r}; there are {allowed}")
    meta = {key: recording.meta[key] for key in entry.conditions if recording.meta.get(key) is not None}
    asked = {**entry.conditions, **meta, **given}
    try:
        if entry.constant_speed:
            _check_speed(recording, asked)
        return entry.read(recording, asked)
    except ValueError as error:  # a recording that cannot be filtered says what to do, too
        raise RefusedError(str(error)) from None


def _repeats(
    names: tuple[str, ...], recording: Recording, test: str | None, given: Mapping[str, Any]
) -> dict[str, Bounded | RefusedError]:
    """Values (n,) of the repeats of every metric in its reporting unit, or why there are none."""
    try:
        reading = read(recording, test, **given)
    except RefusedError as error:
        return dict.fromkeys(names, error)
    return {name: _read(_metrics[name], reading) for name in names}


def _shifted(recording: Recording, channel: str, seconds: float) -> Recording:
    later = np.interp(recording.time - seconds, recording.time, recording[channel])
    return replace(recording, channels={**recording.channels, channel: later})


def _change(found: Bounded | RefusedError, other: Bounded | RefusedError) -> float:
    """Of the mean; without limit where the other was refused."""
    if isinstance(found, RefusedError) or isinstance(other, RefusedError):
        return np.inf
    return float(abs(other.values.mean() - found.values.mean()))


def procedure_of(recording: Recording, test: str | None = None) -> Procedure:
    """How a test is read, by default that of the recording's manoeuvre; ValueError for one that there is not."""
    return procedure_by_name(test or str(recording.meta.get("manoeuvre")))


def procedure_by_name(test: str) -> Procedure:
    """How a test is read; ValueError for one that there is not."""
    if test not in _procedures:
        raise ValueError(f"no metrics for manoeuvre {test!r}; there are some for {', '.join(_procedures)}")
    return _procedures[test]


def _check_speed(recording: Recording, asked: Mapping[str, Any]) -> None:
    speed = asked.get("speed_m_s")
    if speed and recording.units.get("vehicle_speed") == "m/s":
        found = float(np.nanmean(recording["vehicle_speed"]))
        if not abs(found / speed - 1) <= SPEED_SPREAD:
            raise RefusedError(
                f"vehicle_speed is {3.6 * found:.4g} km/h in the mean, not {3.6 * speed:.4g} km/h +- "
                f"{SPEED_SPREAD:.0%}: drive at that speed, or say that the test was at {3.6 * found:.4g} km/h "
                f"(speed_m_s={found:.4g})"
            )


def _read(entry: Metric, reading: Any) -> Bounded | RefusedError:
    try:
        if entry.validity:
            low, high = entry.validity
            peak = reading.peak_acceleration()
            if not low <= peak <= high:
                advice = f"below {low:g} g: steer further" if peak < low else f"above {high:g} g: steer less far"
                raise RefusedError(f"lateral_acceleration peaks at {peak:.3f} g, {advice}")
        found = entry.read(reading)
        values, below, above = found if isinstance(found, Bounded) else (found, 0.0, 0.0)
        scale = UNITS[entry.unit]
        values = np.atleast_1d(np.asarray(values, dtype=float)) * scale
        if not np.all(np.isfinite(values)):
            raise RefusedError("the recording holds no finite value of it")
    except RefusedError as refused:
        return refused
    return Bounded(values, below * scale, above * scale)


def _value(entry: Metric, found: Bounded | RefusedError, slack: float, blur: float) -> Value:
    """Mean over the repeats and its interval, or the reason for none.

    The interval is wider by ``slack`` at either end and, where it comes from repeats, by ``blur``.
    """
    if np.isinf(slack) and not isinstance(found, RefusedError):
        found = RefusedError("it can be read or not within the timing given: align the channels more closely")
    if isinstance(found, RefusedError):
        return Value(np.nan, np.nan, np.nan, entry.unit, str(found))
    repeats = found.values
    mean = float(repeats.mean())
    low, high = interval(repeats)
    if repeats.size > 1 and np.isfinite(blur) and blur > ROUNDING * abs(mean):
        slack += blur
    below, above = slack + found.below, slack + found.above
    if below or above:
        low, high = (low - below, high + above) if repeats.size > 1 else (mean - below, mean + above)
    return Value(mean, low, high, entry.unit, repeats=tuple(repeats.tolist()))
