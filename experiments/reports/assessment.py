"""Assessment of recordings of a test: metrics with ratings, differences, simulation against measurement.

Measured and simulated recordings are treated alike.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from steer_env import metrics, targets
from steer_env.experiments.pages import car_pictures, pictures, plots, provenance
from steer_env.experiments.pages.files import csv_text, replaced_directory, write_text
from steer_env.experiments.pages.metrics_json import entries
from steer_env.experiments.pages.pages import Page, image, write_page
from steer_env.experiments.pages.words import in_words, label, number, percent
from steer_env.experiments.studies.common import battery, comparison_power, explanation, simulation_vs_measurement
from steer_env.experiments.studies.common.battery import MATTERS
from steer_env.experiments.studies.common.comparison_power import Power
from steer_env.experiments.studies.common.explanation import Explanation
from steer_env.metrics import RefusedError, Value
from steer_env.metrics.common import frequency_response, just_noticeable
from steer_env.recording import driven
from steer_env.recording.recording import Recording
from steer_env.vehicle.steering.eps import SAMPLE_TIME

LONGEST = 10  # rows of a table of the first screen
LARGEST_SIMULATED_STEP = 1.01 * SAMPLE_TIME  # of a recording that was written as it was simulated, at most [s]


def title(found: "Assessment") -> str:
    """What the page is about: one recording, several, or a simulation against a measurement."""
    labels, test = list(found.values), found.test.replace("-", " ").capitalize()
    if found.pairs:
        return f"{test}: {labels[1]} against {labels[0]}"
    if found.differences:
        return f"{test}: {in_words(labels[1:])} compared with {labels[0]}"
    return f"{test}: {labels[0] if len(labels) == 1 else f'{len(labels)} recordings'}"


def verdict(found: "Assessment") -> str:
    """The answer in one sentence of at most 25 words, but for long names of recordings."""
    if found.pairs:
        return _agreement(found)
    if found.differences:
        return _comparison(found)
    return _rating(found)


def _agreement(found: "Assessment") -> str:
    reference, other = found.values
    if found.nearest:
        return explanation.verdict(found.nearest)
    if found.power is None:
        worst = max(found.pairs, key=lambda pair: pair.worst)
        return (
            f"{other} does not agree with {reference}, in {label(worst.y)} over {label(worst.x)} by up to "
            f"{number(worst.worst, 2)} tolerances; what would explain it is unknown."
        )
    said = f"Within the tolerances {other} agrees with {reference} in this {found.test}"
    if found.power.unknown:
        return f"{said}; what differences it would have shown is unknown."
    both_ways, laws = comparison_power.both_ways(found.power), found.power.laws.values()
    changed = f" changed {number(max(both_ways.values()))}-fold" if both_ways else ""
    return (
        f"{said}, which would have shown {len(both_ways)} of {len(found.power.parameters)} parameters{changed} and "
        f"{sum(laws)} of {len(laws)} laws."
    )


def _comparison(found: "Assessment") -> str:
    reference, *others = found.values
    many = {name: each for name, each in found.differences.items() if each}
    if not many:
        return f"{in_words(others)} and {reference} cannot be compared: no metric is read from both."
    large = {name: sum(d.matters for d in each.values()) for name, each in many.items()}
    known = [just_noticeable.UNKNOWN != d.perception.verdict for each in many.values() for d in each.values()]
    felt = {name: [d.perception.verdict for d in each.values()].count(just_noticeable.PERCEPTIBLE)
            for name, each in many.items()}  # fmt: skip
    if len(others) == 1:
        differ = "differs" if large[others[0]] == 1 else "differ"
        metrics = f"{large[others[0]]} of {len(many[others[0]])} metrics {differ} by more than {percent(MATTERS)}"
        if apart := len(found.values[reference]) - len(many[others[0]]):
            metrics = f"{metrics}, {apart} not compared"
        if not any(known):
            return f"{others[0]} and {reference}: {metrics}; no threshold of perception is known for any."
        if not felt[others[0]]:
            return f"{others[0]} and {reference}: {metrics}; none exceeds a threshold, known for {sum(known)}."
        return (
            f"A driver would tell {others[0]} from {reference} by {felt[others[0]]} of {sum(known)} known thresholds; "
            f"{metrics}."
        )
    most = max(large, key=lambda name: large[name])
    farthest = f"{most} differs most, over {percent(MATTERS)} in {large[most]}"
    if not large[most]:
        farthest = f"none differs by more than {percent(MATTERS)}"
    if apart := len(others) - len(many):
        farthest = f"{apart} {'other shares' if apart == 1 else 'others share'} no metric with it"
    read = {name: d for each in many.values() for name, d in each.items()}
    with_threshold = sum(d.perception.verdict != just_noticeable.UNKNOWN for d in read.values())
    told = sum(map(bool, felt.values()))
    if not with_threshold:
        return f"No threshold of perception is known to tell one from {reference}; {farthest}."
    return (
        f"By the thresholds known for {with_threshold} of {len(read)} metrics a driver tells {told} of {len(many)} "
        f"from {reference}; {farthest}."
    )


def _rating(found: "Assessment") -> str:
    counts = Counter(rating.colour for of in found.ratings.values() for rating in of.values() if rating)
    good, fair, bad = (counts[colour] for colour in targets.COLOURS)
    who = next(iter(found.values)) if len(found.values) == 1 else f"{len(found.values)} recordings"
    if found.targets and (rated := good + fair + bad):
        unsure = sum(each.sure is False for of in found.ratings.values() for each in of.values() if each)
        doubt = f"; {unsure} {'rating is' if unsure == 1 else 'ratings are'} not sure" if unsure else ""
        by = f"by the bands of {found.targets.name}"
        return f"Of {rated} rated metrics of {who}, {good} are good {by}, {fair} fair and {bad} outside{doubt}."
    read = [not value.reason for values in found.values.values() for value in values.values()]
    return f"{sum(read)} of {len(read)} metrics of {who} can be read as {found.test}; no targets rate them."


def differing(recordings: Mapping[str, Recording]) -> list[tuple[str, list[Any]]] | None:
    """Parameters of cars and laws that differ, by their key in a car file, with the value of each recording.

    A recording whose trace holds no car, as a measured one, has None. None in place of the list where fewer than two
    hold one, or where those that do are equal beside one that does not.
    """
    traces = [recording.meta.get("trace") or {} for recording in recordings.values()]
    flat = [_flat({**trace["car"], **_law(trace)}) if "car" in trace else None for trace in traces]
    known = [each for each in flat if each is not None]
    if len(known) < 2:
        return None
    keys = dict.fromkeys(key for each in known for key in each)
    differ = [key for key in keys if any(each.get(key) != known[0].get(key) for each in known)]
    if not differ and len(known) < len(flat):
        return None
    return [(key, [each and each.get(key) for each in flat]) for key in differ]


def _law(trace: Mapping[str, Any]) -> dict[str, Any]:
    """The law or the sites of a recording, and no text beside numbers, in place of those of the car."""
    laws = [provenance.friction_from_trace(each) for each in trace.get("friction", {}).values()]
    return {"description": None, "source": None, "friction": laws[0] if len(laws) == 1 else None}


def _flat(value: Any, key: str = "") -> dict[str, Any]:
    """The leaves of mappings by their dotted keys; a list of one number is that number."""
    if isinstance(value, list) and len(value) == 1:
        value = value[0]
    if not isinstance(value, Mapping):
        return {key: value}
    prefix = f"{key}." if key else ""
    return {k: leaf for name, each in value.items() for k, leaf in _flat(each, f"{prefix}{name}").items()}


CONTENTS = frozenset({"index.html", "evaluation.json", "metrics.csv"})


class Assessment(NamedTuple):
    """Metrics of recordings of a test, with their ratings, differences to the first and curves."""

    test: str
    values: Mapping[str, dict[str, Value]]  # label of the recording -> metric
    ratings: dict[str, dict[str, targets.Rating | None]]  # label -> metric with a target band
    bands: dict[str, targets.Band]
    targets: targets.Targets | None
    differences: dict[str, dict[str, battery.Difference]]  # label -> metric -> difference to the first recording
    noticed: float  # just-noticeable difference that they are judged by [1]
    parameters: list[tuple[str, list[Any]]] | None  # that differ, as of :func:`differing`
    pairs: Sequence[
        simulation_vs_measurement.Pair
    ]  # cross plots with boundaries, the first recording being the reference
    power: Power | None  # what the comparison would have shown, where the curves agree
    nearest: Explanation | None  # what would explain the difference, where they do not
    unexplained: str  # why that is unknown, in words
    allowed: Mapping[str, simulation_vs_measurement.Tolerance]  # by channel, that the boundaries are made of
    curves: dict[str, simulation_vs_measurement.Curves]
    zeros: dict[str, list[str]]  # what is known of the sensors' zeros in cross plots over time, in sentences
    simulated: frozenset[str]  # labels of recordings without chance, whose repeats say nothing of an uncertainty
    broken: Mapping[str, str] = MappingProxyType({})  # label -> why a recording that was asked for is left out

    def shown(self, label: str) -> dict[str, Value]:
        """The metrics of a recording, with an interval only where chance makes one."""
        return {
            name: value._replace(low=math.nan, high=math.nan) if label in self.simulated else value
            for name, value in self.values[label].items()
        }


def assess(
    recordings: Mapping[str, Recording],
    test: str | None = None,
    wanted: targets.Targets | None = None,
    allowed: Mapping[str, simulation_vs_measurement.Tolerance] | None = None,
    timing: float | None = None,
    noticed: float = just_noticeable.SHARE,
    compare: bool = True,
    **given: Any,
) -> Assessment:
    """Assess recordings of a test, and compare all with the first.

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
    timing : float, optional
        Bound on the unknown delay between channels, as for :func:`steer_env.metrics.evaluate` [s].
    noticed : float
        Just-noticeable difference of a sustained torque or angle, as for :func:`just_noticeable.perception` [1].
    compare : bool
        Whether differences are computed.
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
    base, *others = recordings
    differences = {
        label: _differences(values[label], values[base], noticed, {base, label} <= _simulated(recordings))
        for label in others
        if compare
    }
    curves = {}
    for name, recording in recordings.items():
        try:
            curves[name] = simulation_vs_measurement.curves(recording, evaluation, **given)
        except RefusedError:
            continue  # the metrics give the reason
    answer = _validated([*recordings.values()], evaluation.name, allowed, given) if allowed else Validated()
    return Assessment(
        test=evaluation.name,
        values=values,
        ratings={label: targets.ratings(found, held) for label, found in values.items()},
        bands=held,
        targets=wanted,
        differences=differences,
        noticed=noticed,
        parameters=differing(recordings) if compare and others else None,
        **answer._asdict(),
        allowed=allowed or {},
        curves=curves,
        zeros={
            label: simulation_vs_measurement.zero_notes(found, evaluation)
            for label, found in recordings.items()
            if answer.pairs
        },
        simulated=_simulated(recordings),
    )


class Validated(NamedTuple):
    """What a simulation against a measurement shows: the fields of an :class:`Assessment` with these names."""

    pairs: Sequence[simulation_vs_measurement.Pair] = ()
    power: Power | None = None
    nearest: Explanation | None = None
    unexplained: str = ""


def _validated(
    recordings: Sequence[Recording],
    test: str,
    allowed: Mapping[str, simulation_vs_measurement.Tolerance],
    given: Mapping[str, Any],
) -> Validated:
    """The cross plots of two recordings, and what they would have shown, or what explains where they do not agree."""
    reference, other = recordings
    pairs = simulation_vs_measurement.compare(reference, other, test, allowed, **given)
    if simulation_vs_measurement.passes(pairs):
        channels = frozenset(reference.channels)
        return Validated(pairs, comparison_power.power(other, test, allowed, channels, **given))
    try:
        return Validated(pairs, nearest=explanation.explain(reference, other, test, allowed, **given))
    except (ValueError, RefusedError) as error:
        return Validated(pairs, unexplained=str(error))


def _simulated(recordings: Mapping[str, Recording]) -> frozenset[str]:
    """Recordings of a car that a robot drove in this project, which noise never met."""
    return frozenset(
        label
        for label, each in recordings.items()
        if "car" in (each.meta.get("trace") or {}) and not driven.is_drive(each)
    )


def _step(recording: Recording) -> float:
    return float(np.median(np.diff(recording.time)))


def _differences(
    values: Mapping[str, Value], base: Mapping[str, Value], noticed: float, certain: bool
) -> dict[str, battery.Difference]:
    """Differences to the base of the metrics that both have; ``certain`` ones have no interval."""
    found = {
        name: battery.difference(name, values[name], base[name], noticed)
        for name in base
        if not base[name].reason and not values[name].reason
    }
    return {name: each._replace(half_width=0.0) for name, each in found.items()} if certain else found


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
            label: {name: {**battery.as_json(each), "unit": metrics.definition(name).unit} for name, each in of.items()}
            for label, of in found.differences.items()
        },
        "noticed_share": found.noticed,
        "parameters": found.parameters and dict(found.parameters),
        "verdict": verdict(found),
        "broken": dict(found.broken),
        "power": found.power
        and {**comparison_power.as_json(found.power), "in_words": comparison_power.in_words(found.power)},
        "explanation": found.nearest and explanation.as_json(found.nearest),
        "cross_plots": [{"x": p.x, "y": p.y, "inside": p.inside, "worst": p.worst} for p in found.pairs],
        "zeros": found.zeros,
        "version": metadata.version("steer-env"),
    }


COLUMNS = ("recording", "metric", "unit", "value", "low", "high", "rating", "difference", "share", "refused")


def as_rows(found: Assessment) -> Iterator[Sequence[Any]]:
    """A row for each metric of each recording below the names of ``COLUMNS``; empty for what there is not."""
    yield COLUMNS
    for recording in found.values:
        for name, value in found.shown(recording).items():
            rating = found.ratings[recording].get(name)
            gap = found.differences.get(recording, {}).get(name)
            numbers = (*value[:3], rating.colour if rating else "", *((gap.value, gap.share) if gap else ("", "")))
            shown = ["" if isinstance(x, float) and math.isnan(x) else x for x in numbers]
            yield recording, name, value.unit, *shown, value.reason


def largest(found: Assessment) -> list[str]:
    """Metrics with the largest differences from the first recording, at most ``LONGEST``, the largest first."""
    shares = dict[str, float]()
    for of in found.differences.values():
        for name, each in of.items():
            if math.isfinite(each.share):
                shares[name] = max(shares.get(name, 0.0), abs(each.share))
    return sorted(shares, key=lambda name: -shares[name])[:LONGEST]


def _metrics_off_band(found: Assessment) -> list[tuple[str, targets.Band]]:
    """Metrics of the only recording that are not in their good bands."""
    (ratings,) = found.ratings.values()
    return [(name, found.bands[name]) for name, r in ratings.items() if r and r.colour != targets.COLOURS[0]]


def _unknown(found: Assessment) -> str:
    """What validate cannot tell, in a sentence."""
    if found.unexplained:
        return f"What would explain the difference is unknown: {found.unexplained}."
    return comparison_power.in_words(found.power) if found.power and found.power.unknown else ""


def _picture(found: Assessment, drawn: Sequence[plots.Panel], limits: Sequence[plots.Panel], full: bool) -> str:
    """What the sentence says, as HTML: tolerances, differences, places in the target bands, or the curves."""
    if found.pairs:
        return plots.markup(limits[:1], "tolerances", full)
    if names := largest(found):
        rows = {
            label(name): {
                other: (of[name].share, of[name].reach) for other, of in found.differences.items() if name in of
            }
            for name in names
        }
        return f'<img src="{image(pictures.differences(rows, MATTERS))}" alt="Largest differences">'
    if found.bands:
        places, colours = dict[str, list[float]](), dict[str, list[str]]()
        for name, (low, high) in ((name, band.good) for name, band in found.bands.items()):
            rated = [(found.values[of][name], ratings[name]) for of, ratings in found.ratings.items()]
            places[label(name)] = [(value.value - low) / (high - low) for value, rating in rated if rating]
            colours[label(name)] = [rating.colour for _, rating in rated if rating]
        return f'<img src="{image(car_pictures.in_ranges(places, colours))}" alt="Metrics in their target bands">'
    return plots.markup(drawn[:1], found.test, full)


def _caption(found: Assessment) -> str:
    """What the picture shows, where its axes do not say it."""
    if found.pairs:
        return ""
    if found.differences:
        return f"Largest differences from {next(iter(found.values))}; less than {percent(MATTERS)} is shaded."
    if found.bands:
        return (
            "Each sign is a metric over its good band (shaded): ● good, ▲ fair, ■ outside, at the edge if far outside."
        )
    return ""


def make_page(
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
    channels = dict.fromkeys(name for pair in found.pairs for name in (pair.x, pair.y))
    limits = [plots.boundaries(pair, (labels[0], labels[1])) for pair in found.pairs]
    drawn = plots.panels(found.curves, metrics.evaluation_of(recordings[labels[0]], found.test).plots)
    responses = plots.responses(recordings, found.test) if found.test in frequency_response.TESTS else []
    values = {
        "f": found,
        "labels": labels,
        "values": {label: found.shown(label) for label in labels},
        "longest": LONGEST,
        "off": _metrics_off_band(found) if len(labels) == 1 else [],
        "title": title(found),
        "verdict": verdict(found),
        "thinned": [
            label for label in labels if label in found.simulated and _step(recordings[label]) > LARGEST_SIMULATED_STEP
        ],
        "unknown": _unknown(found),
        "nearest": found.nearest and explanation,
        "gained": [*zip(found.pairs, found.nearest.pairs)] if found.nearest else [],
        "largest": largest(found),
        "caption": _caption(found),
        "picture": _picture(found, drawn, limits, full),
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
    """Write ``index.html``, ``evaluation.json`` and ``metrics.csv`` into a directory, which is replaced as a whole.

    The first two hold the ``trace`` of :func:`steer_env.experiments.pages.provenance.trace`, by default that of a
    Python program. The plots of a ``full`` page are interactive.
    """
    trace = provenance.trace() if trace is None else trace
    with replaced_directory(out, CONTENTS) as part:
        write_page(part, make_page(found, recordings, trace, full), {"evaluation.json": as_json(found)}, trace)
        write_text(part / "metrics.csv", csv_text(as_rows(found)))
