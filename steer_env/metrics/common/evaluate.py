"""Evaluation of a recording: every metric of a test with its 95 % interval, or the reason for which it is refused.

Before that, the sizes of handwheel angle, torque, yaw rate and lateral acceleration have to fit each other, as they do
in any car. A unit that a file names wrongly makes a channel 57 times (degrees, radians), 9.8 times (g) or 3.6 times
(km/h) too large or too small. The yaw rate of a car in a steady turn is

    r/delta = v/(i l (1 + (v/v_ch)^2))        a_y = v r

with steering ratio i, wheelbase l and characteristic speed v_ch. The bounds below contain every passenger car; a factor
of two beyond them is left for the dynamics of a car and for the noise of its sensors.

The torque bounds the angle also where nothing tells how the car moves. Even if the rack were held fast, the handwheel
would turn by the twist of the torsion bar, and the rest of the steering only adds to it:

    |T| <= K_tb |delta| + T_f

with the stiffness K_tb of the bar and the friction T_f above it. The inertia of the handwheel adds less than a tenth of
K_tb up to 2 Hz.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from steer_env.friction.numerics.check import not_negative, number
from steer_env.metrics.common.confidence import interval
from steer_env.metrics.common.definitions import (
    SPEED_SPREAD,
    UNITS,
    Bounded,
    Doubt,
    Metric,
    Metrics,
    RefusedError,
    Value,
    available,
    definition,
    evaluation_of,
)
from steer_env.metrics.common.filtered_channels import ANGLE, AY, PLAUSIBLE, SPEED, TORQUE, YAW, DoubleFiltered
from steer_env.metrics.common.kept import kept
from steer_env.recording import driven
from steer_env.recording.recording import DEGREE, Recording
from steer_env.recording.table import TIMING
from steer_env.vehicle.tyre import BEYOND_TYRE, Beyond

# i l [m], least and largest, and the lowest characteristic speed [m/s] of passenger cars; assumed.
LEAST_RATIO_TIMES_WHEELBASE, LARGEST_RATIO_TIMES_WHEELBASE, LOWEST_CHARACTERISTIC = 8.0 * 2.2, 25.0 * 3.6, 15.0
UNSTEADY_FACTOR = 2.0  # factor on the bounds for what is not steady; assumed [1]
# Factor between lateral acceleration and speed times yaw rate that a test may reach; assumed [1]
ACCELERATION_FACTOR = 4.0
LEAST_SPEED = 5.0  # at which the motion tells enough; assumed [m/s]
# Torsion bar, above any of passenger cars, and the friction of the column above it; assumed [N m/rad], [N m].
STIFFEST, COLUMN_FRICTION = 2.5 / DEGREE, 0.5
GRIP = 12.0  # lateral acceleration that no road tyre gives; assumed [m/s2]


def check(recording: Recording, speed: float | None) -> None:
    """Refuse a recording whose sizes contradict each other, and name the channel with the unit that would fit.

    ``speed`` is the condition of the test [m/s]; the recorded speed is used where there is one.

    Raises
    ------
    RefusedError
        If a channel is in another unit than it says.
    """
    angle, torque, yaw, ay = (_size(recording, name) for name in (ANGLE, TORQUE, YAW, AY))
    _check_motion(recording, speed, angle, yaw, ay)
    most = UNSTEADY_FACTOR * (STIFFEST * angle + COLUMN_FRICTION)
    if angle > 0.0 and most < torque <= PLAUSIBLE[TORQUE]:  # beyond that the torque is wrong
        raise RefusedError(
            f"{ANGLE} reaches {angle / DEGREE:.3g} deg, at which the torsion bar of any car twists with less than "
            f"{most:.2g} N m, and {TORQUE} reaches {torque:.3g} N m: {_remedy(ANGLE, 'rad')}, or check that of {TORQUE}"
        )


def _check_motion(recording: Recording, speed: float | None, angle: float, yaw: float, ay: float) -> None:
    """Refuse a recording whose motion and handwheel angle contradict each other, by their sizes [SI]."""
    v = abs(float(np.nanmean(recording[SPEED]))) if recording.units.get(SPEED) == "m/s" else speed
    if v is None or not v >= LEAST_SPEED or not angle > 0.0:
        return
    low, high = (
        v / (LARGEST_RATIO_TIMES_WHEELBASE * (1.0 + (v / LOWEST_CHARACTERISTIC) ** 2)) / UNSTEADY_FACTOR,
        v / LEAST_RATIO_TIMES_WHEELBASE * UNSTEADY_FACTOR,
    )
    gains = {name: turn / angle for name, turn in ((YAW, yaw), (AY, ay / v)) if turn > 0.0}  # [1/s]
    reach = f"{ANGLE} reaches {angle / DEGREE:.3g} deg"
    if len(gains) == 2 and not 1.0 / ACCELERATION_FACTOR <= gains[AY] / gains[YAW] <= ACCELERATION_FACTOR:
        wrong = max(gains, key=lambda name: abs(np.log(gains[name] ** 2 / (low * high))))
        unit = {YAW: ("rad/s", "deg/s"), AY: ("g", "m/s2")}[wrong][int(gains[wrong] ** 2 > low * high)]
        text = f"{AY} is {gains[AY] / gains[YAW]:.3g} times speed and {YAW}, and about once in a car"
        raise RefusedError(f"{text}: {_remedy(wrong, unit)}")
    if gains and not any(low <= gain <= high for gain in gains.values()):
        name, gain = next(iter(gains.items()))
        text = f"{reach}, and by {name} the car yaws at {gain:.3g} 1/s for every angle, where cars have {low:.2g} to"
        unit = "rad" if gain > high else "deg"
        raise RefusedError(f"{text} {high:.2g} 1/s at {3.6 * v:.0f} km/h: {_remedy(ANGLE, unit)}")
    if not gains and low * angle * v > GRIP:
        text = f"{reach}, for which any car has at least {low * angle * v:.2g} m/s2 at {3.6 * v:.0f} km/h"
        raise RefusedError(f"{text}: {_remedy(ANGLE, 'deg')}")


def _remedy(name: str, unit: str) -> str:
    return f'check the unit of {name} in the file; a mapping corrects it, [channels.{name}] unit = "{unit}"'


@kept
def _size(recording: Recording, name: str) -> float:
    """Half the span of a channel [SI], without its outermost hundredths; 0 where the channel says nothing."""
    values = recording.channels.get(name, np.zeros(0))
    values = values[np.isfinite(values)]
    if values.size == 0 or recording.units[name] not in ("rad", "rad/s", "m/s2", "N m"):
        return 0.0
    low, high = np.quantile(values, [0.01, 0.99])
    return float(high - low) / 2.0


TORQUE_SCALE_KEY = "torque_scale_error"  # key of the meta
ROUNDING = 1e-9  # changes of a value below this fraction of it are rounding errors [1]


def evaluate(
    recording: Recording,
    test: str | None = None,
    *,
    timing: float | None = None,
    torque_scale_error: float | None = None,
    intervals: bool = True,
    **given: Any,
) -> Metrics:
    """Every metric of a test for a recording from a simulation or from a car.

    Parameters
    ----------
    recording : Recording
    test : str, optional
        A name from :func:`steer_env.metrics.tests`; by default the manoeuvre that the recording's meta names.
    timing : float, optional
        Largest error of the relative timing of the channels [s]. A channel that is late looks like a lag of the car.
        Each interval is therefore widened by the change of the metric when one channel after the other is shifted by
        +-timing relative to the handwheel angle. By default ``timing_error_s`` of the recording's meta, or 0. A CAN
        log that stamps frames in batches has there which channels may be early or late together, and by how much.
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
    Metrics
        A dict with a :class:`Value` for every name of ``available(test)``; a refused metric has a reason.

    Raises
    ------
    ValueError
        For an unknown test or condition, a negative timing, or an error of the scale that is not from 0 to below 1.
    """
    scale = number(
        "torque_scale_error",
        recording.meta.get(TORQUE_SCALE_KEY, 0.0) if torque_scale_error is None else torque_scale_error,
    )
    if not 0.0 <= scale < 1.0:
        raise ValueError(f"torque_scale_error is {scale:g}; it is a fraction from 0 to below 1, 0.02 for 2 %")
    names = available(evaluation_of(recording, test).name)

    def again(other: Recording) -> Any:
        return _read(other, test, given)

    reading = again(recording)
    repeats = _repeats(names, reading)
    filter_change: dict[str, float | None] = dict.fromkeys(names)
    if intervals and not isinstance(reading, RefusedError):
        filtered_twice = DoubleFiltered(recording.time, recording.channels, recording.units, recording.meta)
        vars(filtered_twice).update(vars(recording))  # with what is kept of the same channels
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
    notes += tuple(Beyond(**each).words for each in recording.meta.get(BEYOND_TYRE, ()))
    if scale and (torque := _hand_torque(recording)):
        notes += (f"the intervals allow for an error of {scale:.2g} of the scale of {torque}",)
    found = Metrics()
    for name, values in repeats.items():
        widening = [(doubt, max(change[name] for change in of)) for doubt, of in changes]
        found[name] = _value(definition(name), values, widening, filter_change[name])._replace(notes=notes)
    return found


def _declared(
    recording: Recording, timing: float | None, scale: float, again: Callable[[Recording], Any]
) -> list[Doubt]:
    """The doubts that the user has declared: how well the channels are aligned, and how well the torque is scaled."""
    found = []
    for channels, most in _timing(recording, timing):
        others = tuple(again(_shifted(recording, channels, by)) for by in (-most, most))
        found.append(Doubt(f"the timing of {', '.join(channels)}", "align the channels more closely", others))
    if scale and (torque := _hand_torque(recording)):
        others = tuple(again(_scaled(recording, torque, 1.0 / (1.0 + error))) for error in (-scale, scale))
        found.append(Doubt(f"the scale of {torque}", "calibrate the sensor more closely", others))
    return found


def _timing(recording: Recording, timing: float | None) -> list[tuple[list[str], float]]:
    """Channels that may be early or late together, and by how much [s]."""
    told = recording.meta.get(TIMING, 0.0) if timing is None else timing
    if isinstance(told, list):
        try:
            groups = [(each["channels"], not_negative(TIMING, each["seconds"])) for each in told]
        except (KeyError, TypeError):
            raise ValueError(
                f"{TIMING} of the meta is a number, or a list of channels and seconds; got {told}"
            ) from None
        return [([name for name in channels if name in recording.channels], most) for channels, most in groups]
    most = not_negative(TIMING if timing is None else "timing", told)
    return [([name], most) for name in recording.channels if most and name not in (ANGLE, *driven.CHANNELS)]


def _hand_torque(recording: Recording) -> str | None:
    """The channel of the hand torque, or that of the torsion bar where there is no other; None without both."""
    return next((name for name in (TORQUE, "torsion_bar_torque") if name in recording.channels), None)


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
            check(recording, conditions.get("speed_m_s"))
        return entry.read(recording, conditions)
    except ValueError as error:  # a recording that cannot be filtered also says what to do
        raise RefusedError(str(error)) from None


def _read(recording: Recording, test: str | None, given: Mapping[str, Any]) -> Any:
    """The object that the metrics take, or the error that refused all of them."""
    try:
        return read(recording, test, **given)
    except RefusedError as error:
        return RefusedError(str(error))  # without the traceback, as in `_computed`


def _repeats(names: tuple[str, ...], reading: Any) -> dict[str, Bounded | RefusedError]:
    """Values (n,) of the repeats of every metric in its reporting unit, or the error that refused it."""
    if isinstance(reading, RefusedError):
        return dict.fromkeys(names, reading)
    return {name: _computed(definition(name), reading) for name in names}


def _shifted(recording: Recording, channels: Sequence[str], seconds: float) -> Recording:
    """The recording with some channels moved to later."""
    later = {name: np.interp(recording.time - seconds, recording.time, recording[name]) for name in channels}
    return replace(recording, channels={**recording.channels, **later})


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
        return RefusedError(str(refused))  # the traceback of this one holds the recording, in a circle with a frame
    return Bounded(values, below * scale, above * scale)


def _value(
    entry: Metric, found: Bounded | RefusedError, widening: Sequence[tuple[Doubt, float]], filter_change: float | None
) -> Value:
    """Mean over the repeats and its interval (none where ``filter_change`` is None), or the reason for a refusal."""
    if not isinstance(found, RefusedError):
        for doubt, size in widening:
            if np.isinf(size):
                found = RefusedError(f"{doubt.about} is in doubt so far that this metric is unreadable: {doubt.remedy}")
                break
    if isinstance(found, RefusedError):
        return Value(np.nan, np.nan, np.nan, entry.unit, str(found))
    change, ends = sum((size for _, size in widening), 0.0), (np.nan, np.nan)
    if filter_change is not None:
        ends = _interval(found, change, filter_change)
    return Value(float(found.values.mean()), *ends, entry.unit, repeats=tuple(found.values.tolist()))


def _interval(found: Bounded, change: float, filter_change: float) -> tuple[float, float]:
    """The interval of the mean, widened by ``change`` at either end and, of several repeats, by ``filter_change``."""
    repeats, mean = found.values, float(found.values.mean())
    low, high = interval(repeats)
    if repeats.size > 1 and np.isfinite(filter_change) and filter_change > ROUNDING * abs(mean):
        change += filter_change
    below, above = change + found.below, change + found.above
    if below or above:
        low, high = (low - below, high + above) if repeats.size > 1 else (mean - below, mean + above)
    return low, high
