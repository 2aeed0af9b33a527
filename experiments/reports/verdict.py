"""The first sentence of the page on one or two recordings."""

from collections import Counter
from typing import TYPE_CHECKING

from steer_env import targets
from steer_env.experiments.pages.words import label, number, percent
from steer_env.experiments.studies.common import simulation_vs_measurement
from steer_env.experiments.studies.common.battery import MATTERS
from steer_env.metrics.common import just_noticeable

if TYPE_CHECKING:
    from steer_env.experiments.reports.assessment import Assessment


def title(found: "Assessment") -> str:
    """What the page is about: one recording, two that are compared, or a simulation against a measurement."""
    labels, test = list(found.values), found.test.replace("-", " ").capitalize()
    if found.pairs:
        return f"{test}: is {labels[1]} a valid simulation of {labels[0]}?"
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
    if simulation_vs_measurement.passes(found.pairs):
        worst = number(max(pair.worst for pair in found.pairs), 2)
        return (
            f"Yes: {other} agrees with {reference} within the tolerances: at least {needed} of the points of every "
            f"cross plot are inside; the farthest is {worst} tolerances away."
        )
    missed = [pair for pair in found.pairs if not simulation_vs_measurement.passes([pair])]
    least = min(missed, key=lambda pair: pair.inside)
    return (
        f"No: {other} does not agree with {reference} within the tolerances: in {len(missed)} of {len(found.pairs)} "
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
            f"As far as a driver's thresholds are known, {reference} and {other} feel the same: none of {len(known)} "
            f"sustained torques and angles differs by the {percent(found.noticed)} that a driver notices; {large}."
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
