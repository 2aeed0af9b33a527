"""Assessment of one or two recordings of a test: metrics with ratings, differences, simulation against measurement.

Measured and simulated recordings are treated alike.
"""

import math
from collections import Counter
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from steer_env import metrics, targets
from steer_env.experiments.pages import plots, provenance
from steer_env.experiments.pages.files import replaced_directory
from steer_env.experiments.pages.metrics_json import entries
from steer_env.experiments.pages.pages import Page, place
from steer_env.experiments.pages.words import label, number, percent
from steer_env.experiments.studies.common import battery, comparison_power, simulation_vs_measurement
from steer_env.experiments.studies.common.battery import MATTERS
from steer_env.experiments.studies.common.comparison_power import Power, in_words
from steer_env.metrics import RefusedError, Value
from steer_env.metrics.common import frequency_response, just_noticeable
from steer_env.metrics.common.confidence import difference
from steer_env.recording.recording import Recording


def title(found: "Assessment") -> str:
    """What the page is about: one recording, two that are compared, or a simulation against a measurement."""
    labels, test = list(found.values), found.test.replace("-", " ").capitalize()
    if found.pairs:
        return f"{test}: {labels[1]} against {labels[0]}"
    return f"{test}: {labels[1]} compared with {labels[0]}" if len(labels) == 2 else f"{test}: {labels[0]}"


def verdict(found: "Assessment") -> str:
    """The answer in one sentence; empty where no target and no other recording is given."""
    if found.pairs:
        return _agreement(found)
    if len(found.values) == 2:
        return _comparison(found)
    return _rating(found) if found.bands else ""


def _agreement(found: "Assessment") -> str:
    reference, other = found.values
    needed = percent(simulation_vs_measurement.ENOUGH, 3)
    if found.power is not None:
        worst = number(max(pair.worst for pair in found.pairs), 2)
        return (
            f"{other} agrees with {reference} in this {found.test}: at least {needed} of the points of every cross "
            f"plot are within the tolerances, the farthest {worst} tolerances away."
        )
    missed = [pair for pair in found.pairs if not simulation_vs_measurement.passes([pair])]
    least = min(missed, key=lambda pair: pair.inside)
    return (
        f"{other} does not agree with {reference} within the tolerances: in {len(missed)} of {len(found.pairs)} "
        f"cross plots less than {needed} of the points are inside; fewest ({percent(least.inside, 3)}, up to "
        f"{number(least.worst, 2)} tolerances away) in {label(least.y)} over {label(least.x)}."
    )


def _comparison(found: "Assessment") -> str:
    reference, other = found.values
    if not found.differences:
        return f"{other} and {reference} cannot be compared: no metric is read from both."
    large = f"{len(found.large)} of {len(found.differences)} metrics differ by more than {percent(MATTERS)}"
    known = {n: p.verdict for n, p in found.perceptions.items() if p.verdict != just_noticeable.UNKNOWN}
    felt = [label(name) for name, verdict in known.items() if verdict == just_noticeable.PERCEPTIBLE]
    if felt:
        names = ", ".join(felt)
        return f"A driver would feel the difference between {reference} and {other}: by {names}; {large}."
    if known:
        return (
            f"{large}; a driver's threshold is known for {len(known)} of them, sustained torques and angles, none of "
            f"which differs by the {percent(found.noticed)} that is noticed."
        )
    return f"No threshold of perception is known for what was driven here; {large}."


def _rating(found: "Assessment") -> str:
    (name,), (ratings,) = found.values, found.ratings.values()
    counts = Counter(rating.colour for rating in ratings.values() if rating)
    good, fair, bad = (counts[colour] for colour in targets.COLOURS)
    rated = good + fair + bad
    return (
        f"Of {rated} rated metrics of {name}, {good} are in their good band, {fair} in the fair band, {bad} outside it."
    )


def differing(recordings: Mapping[str, Recording]) -> list[tuple[str, list[Any]]] | None:
    """Parameters of cars and laws that differ, by their key in a car file, with the value of each recording.

    None where one of the recordings is not of a car that its trace holds.
    """
    traces = [recording.meta.get("trace") or {} for recording in recordings.values()]
    if not all("car" in trace for trace in traces):
        return None
    flat = [_flat({**trace["car"], **_law(trace)}) for trace in traces]
    rows = {key: [each.get(key) for each in flat] for key in dict.fromkeys(key for each in flat for key in each)}
    return [(key, row) for key, row in rows.items() if any(value != row[0] for value in row)]


def _law(trace: Mapping[str, Any]) -> dict[str, Any]:
    """The law of a recording, and no text beside numbers, in place of those of the car."""
    laws = [{"law": each["law"], **each["parameters"]} for each in trace.get("friction", {}).values()]
    return {"description": None, "source": None, "friction": laws[0] if len(laws) == 1 else None}


def _flat(value: Any, key: str = "") -> dict[str, Any]:
    """The leaves of mappings by their dotted keys; a list of one number is that number."""
    if isinstance(value, list) and len(value) == 1:
        value = value[0]
    if not isinstance(value, Mapping):
        return {key: value}
    prefix = f"{key}." if key else ""
    return {k: leaf for name, each in value.items() for k, leaf in _flat(each, f"{prefix}{name}").items()}


CONTENTS = frozenset({"index.html", "evaluation.json"})


class Assessment(NamedTuple):
    """Metrics of one or two recordings of a test, with their ratings, differences and curves."""

    test: str
    values: dict[str, dict[str, Value]]  # label of the recording -> metric
    ratings: dict[str, dict[str, targets.Rating | None]]  # label -> metric with a target band
    bands: dict[str, targets.Band]
    targets: targets.Targets | None
    differences: dict[str, tuple[float, float, float]]  # second less first with its 95 % interval [unit of the metric]
    perceptions: dict[str, just_noticeable.Perception]  # of the differences
    noticed: float  # just-noticeable difference that they are judged by [1]
    large: frozenset[str]  # metrics whose difference counts as large, as in the report
    parameters: list[tuple[str, list[Any]]] | None  # that differ, as of :func:`differing`
    pairs: list[simulation_vs_measurement.Pair]  # cross plots with boundaries, the first recording being the reference
    power: Power | None  # what the comparison would have shown, where the curves agree
    allowed: Mapping[str, simulation_vs_measurement.Tolerance]  # by channel, that the boundaries are made of
    curves: dict[str, simulation_vs_measurement.Curves]
    zeros: dict[str, list[str]]  # what is known of the sensors' zeros in cross plots over time, in sentences


def assess(
    recordings: Mapping[str, Recording],
    test: str | None = None,
    wanted: targets.Targets | None = None,
    allowed: Mapping[str, simulation_vs_measurement.Tolerance] | None = None,
    timing: float = 0.0,
    noticed: float = just_noticeable.SHARE,
    **given: Any,
) -> Assessment:
    """Assess one recording, or compare a second with the first.

    Parameters
    ----------
    recordings : mapping of str to Recording
        Label -> recording; the first is the reference.
    test : str, optional
        By default the manoeuvre that the first recording's meta names.
    wanted : Targets, optional
        Target bands that the values are rated by.
    allowed : mapping of str to Tolerance, optional
        Tolerances by channel; if given, the second recording is compared with the boundaries around the first.
    timing : float
        Bound on the unknown delay between channels, as for :func:`steer_env.metrics.evaluate` [s].
    noticed : float
        Just-noticeable difference of a sustained torque or angle, as for :func:`just_noticeable.perception` [1].
    given
        Conditions as for :func:`steer_env.metrics.evaluate`.

    Raises
    ------
    ValueError
        For an unknown test or condition, or if no cross plot is possible.
    """
    first = next(iter(recordings.values()))
    evaluation = metrics.evaluation_of(first, test)
    values = {
        label: metrics.evaluate(found, evaluation.name, timing=timing, **given) for label, found in recordings.items()
    }
    held = wanted.bands.get(evaluation.name, {}) if wanted else {}
    differences = _differences(*values.values()) if len(values) == 2 else {}
    of = list(values.values())
    curves = {}
    for name, recording in recordings.items():
        try:
            curves[name] = simulation_vs_measurement.curves(recording, evaluation, **given)
        except RefusedError:
            continue  # the metrics give the reason
    pairs, power = [], None
    if allowed:
        reference, other = recordings.values()
        pairs = simulation_vs_measurement.compare(reference, other, evaluation.name, allowed, **given)
        if simulation_vs_measurement.passes(pairs):
            power = comparison_power.power(other, evaluation.name, allowed, frozenset(reference.channels), **given)
    return Assessment(
        test=evaluation.name,
        values=values,
        ratings={label: targets.ratings(found, held) for label, found in values.items()},
        bands=held,
        targets=wanted,
        differences=differences,
        perceptions={
            name: just_noticeable.perception(name, of[0][name].value, gap, noticed) for name, gap in differences.items()
        },
        noticed=noticed,
        large=frozenset(name for name in differences if battery.difference(name, of[-1][name], of[0][name]).matters),
        parameters=differing(recordings) if len(recordings) > 1 else None,
        pairs=pairs,
        power=power,
        allowed=allowed or {},
        curves=curves,
        zeros={
            label: simulation_vs_measurement.zero_notes(found, evaluation)
            for label, found in recordings.items()
            if pairs
        },
    )


def _differences(a: Mapping[str, Value], b: Mapping[str, Value]) -> dict[str, tuple[float, float, float]]:
    """The second less the first with its 95 % interval, of the metrics that both have."""
    return {
        name: difference(np.array(a[name].repeats), np.array(b[name].repeats))
        for name in a
        if not a[name].reason and not b[name].reason
    }


def as_json(found: Assessment) -> dict[str, Any]:
    """The assessment as JSON."""

    def finite(x: float) -> float | None:
        return x if math.isfinite(x) else None

    return {
        "manoeuvre": found.test,
        "metrics": {label: entries(values) for label, values in found.values.items()},
        "targets": found.targets.name if found.targets else None,
        "lights": {
            label: {name: rating._asdict() if rating else None for name, rating in ratings.items()}
            for label, ratings in found.ratings.items()
        },
        "differences": {
            name: {
                "value": finite(gap),
                "ci": [finite(low), finite(high)],
                "unit": metrics.definition(name).unit,
                "large": name in found.large,
                "perception": found.perceptions[name].verdict,
                "perception_sure": found.perceptions[name].sure,
            }
            for name, (gap, low, high) in found.differences.items()
        },
        "noticed_share": found.noticed,
        "parameters": found.parameters and dict(found.parameters),
        "verdict": " ".join([verdict(found), *([in_words(found.power)] if found.power else [])]),
        "power": found.power and comparison_power.as_json(found.power),
        "cross_plots": [{"x": p.x, "y": p.y, "inside": p.inside, "worst": p.worst} for p in found.pairs],
        "zeros": found.zeros,
        "version": metadata.version("steer-env"),
    }


def page_of(
    found: Assessment,
    recordings: Mapping[str, Recording],
    trace: Mapping[str, Any] | None = None,
    full: bool = False,
) -> Page:
    """The page: verdict, tolerances, values with ratings, differences, plots, definitions, and what it is made from.

    The mappings are those of the ``trace``; the plots of a ``full`` page are interactive.
    """
    labels = list(recordings)
    trace = trace or {}
    unknown = found.power if found.power and found.power.unknown else None  # else a table says it
    channels = dict.fromkeys(name for pair in found.pairs for name in (pair.x, pair.y))
    limits = [plots.boundaries(pair, (labels[0], labels[1])) for pair in found.pairs]
    drawn = plots.panels(found.curves, metrics.evaluation_of(recordings[labels[0]], found.test).plots)
    responses = plots.responses(recordings, found.test) if found.test in frequency_response.TESTS else []
    values = {
        "f": found,
        "labels": labels,
        "title": title(found),
        "verdict": " ".join([verdict(found), *([in_words(unknown)] if unknown else [])]),
        "mappings": {label: of for label, of in trace.get("mapping", {}).items() if of["channels"] or of["meta"]},
        "tolerances": {plots.axis(name): found.allowed[name] for name in channels},
        "enough": simulation_vs_measurement.ENOUGH,
        "matters": battery.MATTERS,
        "leasts": battery.LEAST,
        "metas": {label: {k: v for k, v in r.meta.items() if k != "trace"} for label, r in recordings.items()},
        "definitions": {name: metrics.definition(name) for name in metrics.available(found.test)},
        "power": comparison_power.rows(found.power) if found.power and not found.power.unknown else [],
        "tried": comparison_power.FACTORS[-1],
        "script": plots.script() if full else "",
        "figure": plots.markup(drawn, found.test, full),
        "noticeable": just_noticeable,
        "responses": plots.markup(responses, "frequency-responses", full, columns=3),
        "boundaries": plots.markup(limits, "tolerances", full),
    }
    return Page("evaluation", values)


def write(
    out: Path,
    found: Assessment,
    recordings: Mapping[str, Recording],
    trace: Mapping[str, Any] | None = None,
    full: bool = False,
) -> None:
    """Write ``index.html`` and ``evaluation.json`` into a directory, which appears or is replaced as a whole.

    Both hold the ``trace`` of :func:`steer_env.experiments.pages.provenance.trace`, by default that of a Python
    program. The plots of a ``full`` page are interactive.
    """
    trace = provenance.trace() if trace is None else trace
    with replaced_directory(out, CONTENTS) as part:
        place(part, page_of(found, recordings, trace, full), {"evaluation.json": as_json(found)}, trace)
