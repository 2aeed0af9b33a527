"""Simulation against measurement, or any two recordings of a test: cross plots with tolerance boundaries.

The form follows ISO 19364 and ISO 22140: every channel may be off by a share of its value and by a fixed amount. The
tolerances of both channels of a cross plot make a box; swept along the measured curve it covers the band in which the
simulated curve has to lie. No conformance is claimed.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from steer_env import metrics
from steer_env.friction.numerics import toml
from steer_env.friction.numerics.check import not_negative, one_of
from steer_env.metrics import UNITS, ManoeuvreEvaluation, RefusedError
from steer_env.metrics.common import straight
from steer_env.metrics.common.filtered_channels import ANGLE, filtered_once
from steer_env.recording.recording import Recording

Array = NDArray[np.float64]
Curves = dict[str, Array]  # channel, or "time" -> (n,) [SI]

FOLDER = Path(__file__).parents[2] / "data" / "tolerances"
RATE = 100.0  # of curves over time [Hz]
CUTOFF = 10.0  # of their low-pass [Hz]
ENOUGH = 0.99  # share of the points within tolerance; the rest is left for the noise of a time history; assumed [1]
POINTS = 250  # of a curve whose distances from the other curve are computed, at least


class Tolerance(NamedTuple):
    """How far a channel may be off."""

    relative: float  # of its value [1]
    absolute: float  # [SI]

    def at(self, values: Array) -> Array:
        """Half width around each value."""
        return self.absolute + self.relative * np.abs(values)


class Pair(NamedTuple):
    """One cross plot: the reference's curve, the other's, and the boundaries [SI]."""

    x: str
    y: str
    reference: Array  # (n, 2)
    other: Array  # (m, 2)
    left: Array  # (n, 2) boundary to the left of the reference, along its run
    right: Array  # (n, 2)
    inside: float  # share of both curves' points within tolerance of the other curve [1]
    worst: float  # largest distance of a point from the other curve, in tolerances: up to 1 is inside [1]


def tolerances(name: str = "default") -> dict[str, Tolerance]:
    """Tolerances by channel, packaged or from a TOML file; ValueError that names the first error in the file."""
    path = Path(name) if name.endswith(".toml") else FOLDER / f"{name}.toml"
    if not path.is_file():
        packaged = ", ".join(sorted(found.stem for found in FOLDER.glob("*.toml")))
        raise ValueError(f"no tolerances {name!r}; there are {packaged}, or give a .toml file")
    channels = toml.read(path).get("channels", {})
    if not isinstance(channels, dict):
        raise ValueError(f"{path}, channels: expected a table of each channel, got {channels!r}")
    return {channel: _tolerance(f"{path}, {channel}", entry) for channel, entry in channels.items()}


def _tolerance(where: str, entry: Any) -> Tolerance:
    if not isinstance(entry, dict) or entry.keys() != {"relative", "absolute", "unit"}:
        raise ValueError(f"{where}: expected relative, absolute and unit, got {entry!r}")
    unit = one_of(f"{where}, unit", entry["unit"], UNITS)
    relative, absolute = (not_negative(f"{where}, {key}", entry[key]) for key in ("relative", "absolute"))
    if not relative + absolute > 0.0:
        raise ValueError(f"{where}: relative and absolute are both 0: give at least one above 0")
    return Tolerance(relative, absolute / UNITS[unit])


def compare(
    reference: Recording,
    other: Recording,
    test: str | None = None,
    allowed: Mapping[str, Tolerance] | None = None,
    **given: Any,
) -> list[Pair]:
    """The cross plots of a test for two recordings, except pairs of channels that either of them lacks.

    Raises
    ------
    ValueError
        If a recording cannot be read as this test, or both have the channels of none of its cross plots.
    """
    allowed = tolerances() if allowed is None else allowed
    evaluation = metrics.evaluation_of(reference, test)
    first, second = (curves(recording, evaluation, **given) for recording in (reference, other))
    if "time" in first:
        second = _align(first, second)
        first = _cut_curve(first, second["time"][0], second["time"][-1])
    pairs = [
        _pair(x, y, first, second, allowed)
        for x, y in evaluation.plots
        if {x, y} <= first.keys() & second.keys() & allowed.keys()
    ]
    if not pairs:
        needed = "; ".join(f"{y} over {x}" for x, y in evaluation.plots)
        raise ValueError(f"none of the cross plots of {evaluation.name} is in both recordings: {needed}")
    return pairs


def passes(pairs: Sequence[Pair]) -> bool:
    """Whether the curves agree: all but single points of every cross plot are within its tolerances."""
    return all(pair.inside >= ENOUGH for pair in pairs)


def curves(recording: Recording, evaluation: ManoeuvreEvaluation, **given: Any) -> Curves:
    """Curves of a recording for the plots: its mean settled cycle if the test is periodic, else time histories.

    Both count from where the car goes straight, time histories as far as the recording begins there
    (:func:`zero_notes`).
    """
    names = {name for pair in evaluation.plots for name in pair} - {"time"}
    reading = metrics.read(recording, evaluation.name, **given)
    if hasattr(reading, "mean_cycle"):
        found: Curves = {}
        for name in names:
            try:
                found[name] = reading.mean_cycle(name)
            except RefusedError:
                continue
        return found
    present = sorted(names & recording.units.keys())
    fast = recording.rate >= 4.0 * CUTOFF
    smooth = {n: filtered_once(recording, n, CUTOFF) if fast else recording[n] for n in present}
    kept = Recording(recording.time, smooth, {n: recording.units[n] for n in present}).resampled(RATE)
    try:
        zeros = straight.zeros(recording)
    except RefusedError:  # told by zero_notes
        zeros = {}
    channels = {name: values - zeros.get(name, 0.0) for name, values in kept.channels.items()}
    return {"time": kept.time - kept.time[0], **channels}


def zero_notes(recording: Recording, evaluation: ManoeuvreEvaluation) -> list[str]:
    """What is known of the sensors' zeros in time histories, in sentences; the metrics of a periodic test tell it."""
    return straight.notes(recording) if any("time" in pair for pair in evaluation.plots) else []


def _align(first: Curves, second: Curves) -> Curves:
    """The second curves, shifted in time so that the handwheel speeds agree best, over the time that both cover."""
    if ANGLE not in first or ANGLE not in second:
        return second
    time = second["time"] + lag(first, second)
    return _cut_curve({**second, "time": time}, 0.0, first["time"][-1])


def lag(first: Curves, second: Curves) -> float:
    """Time by which the first curves over time are later, by the speeds of their handwheels [s]."""
    a, b = (np.gradient(curve[ANGLE]) for curve in (first, second))  # the angle of a step varies too little to align by
    return float(signal.correlation_lags(a.size, b.size)[signal.correlate(a, b).argmax()]) / RATE


def _cut_curve(curve: Curves, start: float, end: float) -> Curves:
    inside = (curve["time"] >= start - 0.5 / RATE) & (curve["time"] <= end + 0.5 / RATE)
    return {name: values[inside] for name, values in curve.items()}


def _distance(points: Array, curve: Array, at_curve: Array | None, at_points: Array | None = None) -> Array:
    """Distance of points (m, 2) from a curve (n, 2) that is straight between its samples, in tolerances.

    The tolerances are those at the curve (n, 2) or, if that is None, those at the points (m, 2).
    """
    found = np.empty(len(points))
    step = np.diff(curve, axis=0)
    for k, point in enumerate(points):
        half = at_curve[:-1] if at_curve is not None else at_points[k]  # type: ignore[index]
        off, way = (curve[:-1] - point) / half, step / half
        # The larger of two ratios is least at an end, where one of them is zero, or where both have the same size.
        places = [np.zeros(len(way)), np.ones(len(way))]
        for a, b in ((off[:, 0], way[:, 0]), (off[:, 1], way[:, 1]), *_even(off, way)):
            places.append(np.clip(np.divide(-a, b, out=np.zeros_like(a), where=b != 0.0), 0.0, 1.0))
        found[k] = min(np.min(np.maximum(*np.abs(off + s[:, None] * way).T)) for s in places)
    return found


def _even(off: Array, way: Array) -> list[tuple[Array, Array]]:
    return [(off[:, 0] - off[:, 1], way[:, 0] - way[:, 1]), (off[:, 0] + off[:, 1], way[:, 0] + way[:, 1])]


def _pair(x: str, y: str, first: Curves, second: Curves, allowed: Mapping[str, Tolerance]) -> Pair:
    reference, other = (np.column_stack((curve[x], curve[y])) for curve in (first, second))
    half = np.column_stack([allowed[name].at(reference[:, k]) for k, name in enumerate((x, y))])
    # Both ways: the other curve has to stay in the band, and also to reach as far as the reference.
    some, many = (slice(None, None, max(len(curve) // POINTS, 1)) for curve in (reference, other))
    distance = np.append(_distance(other[many], reference, half), _distance(reference[some], other, None, half[some]))
    way = np.gradient(reference, axis=0) / half
    corner = np.sign(np.column_stack((-way[:, 1], way[:, 0]))) * half  # of the box, to the left of the way
    return Pair(
        *(x, y, reference, other, reference + corner, reference - corner),
        float(np.mean(distance <= 1.0)),
        float(distance.max()),
    )
