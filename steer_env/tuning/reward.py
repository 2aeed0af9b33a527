"""Reward of a parameter set: distances of its metrics from wanted bands, and shortfall of the loop's margins.

A wanted band is a tenth of the target band, about the value that the car's own assist gives, moved into the target band
where that is not in it (:func:`wanted_terms`). So the wanted bands can nearly be reached together, in any context, and
cover a small part of the parameters.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

from steer_env.friction.numerics.check import not_negative
from steer_env.metrics import Value
from steer_env.targets import Band, Targets
from steer_env.tuning.scenarios.common.definition import Scenario
from steer_env.vehicle.steering.margins import TARGETS as MARGINS
from steer_env.vehicle.steering.margins import Margins

MAX_DISTANCE = 3.0  # bound of the distance, that of a refused metric; assumed [widths of the band]
MARGIN_WEIGHT = 5.0  # of a full shortfall of a margin, relative to a metric one band off; assumed
MARGIN_TERMS = ("phase_margin", "gain_margin")


class Term(NamedTuple):
    """A metric in the reward."""

    band: Band
    weight: float  # per width of the band [1]


def terms(scenario: Scenario, targets: Targets, weights: Mapping[str, float] | None) -> dict[str, Term]:
    """Every metric of the scenario's tests for which the targets have a band.

    Raises
    ------
    ValueError
        The targets have no band for any test of the scenario, or a weight is for an unknown term.
    """
    bands = targets.of_tests(scenario.tests)
    given = dict(weights or {})
    for name in given:
        if name not in bands:
            raise ValueError(f"{scenario.name} has no reward term {name!r}; there are {', '.join(bands)}")
    weighted = {**dict.fromkeys(bands, 1.0), **scenario.weights, **given}
    return {name: Term(band, not_negative(f"weights[{name!r}]", weighted[name])) for name, band in bands.items()}


def wanted_terms(every: Mapping[str, Term], own: Mapping[str, Value], tolerance: float) -> dict[str, Term]:
    """The terms with the wanted bands: as wide as the target bands times the tolerance, at the car's own metrics.

    Parameters
    ----------
    every : mapping of str to Term
        With the target bands.
    own : mapping of str to Value
        Metrics of the car's own assist in the context; the whole target band counts where one is refused.
    tolerance : float
        Above 0 and at most 1, where the wanted bands are the target bands [1].
    """
    found = {}
    for name, term in every.items():
        (low, high), value = term.band.good, own[name]
        if not value.reason:
            half = 0.5 * tolerance * (high - low)
            middle = min(max(value.value, low + half), high - half)
            term = term._replace(band=term.band._replace(good=(middle - half, middle + half)))
        found[name] = term
    return found


def worst_reward(wanted: Mapping[str, Term], name: str) -> float:
    """The smallest value of a term of the reward."""
    return -wanted[name].weight * MAX_DISTANCE if name in wanted else -MARGIN_WEIGHT


def distance(value: Value, band: Band) -> float:
    """Distance x of a value from the good band over the band's width, as x/(1 + x/``MAX_DISTANCE``) [1].

    It rises everywhere, so that a set far away still tells where to go, and is bounded by ``MAX_DISTANCE``, which a
    refused metric has.
    """
    if value.reason:
        return MAX_DISTANCE
    x = band.distance(value.value)
    return x / (1.0 + x / MAX_DISTANCE)


def degrees_and_decibels(margins: Margins) -> tuple[float, float]:
    """Phase margin [deg] and gain margin [dB], whether or not the loop is stable."""
    return math.degrees(margins.phase), 20.0 * math.log10(margins.gain)


def margin_shortfall(margins: Margins) -> dict[str, float]:
    """Shortfall of each margin below the usual 30 deg and 6 dB, over these [1]; 1 if the loop is unstable."""
    return {
        name: min(max(1.0 - margin / least, 0.0), 1.0) if margins.stable else 1.0
        for name, margin, least in zip(MARGIN_TERMS, degrees_and_decibels(margins), MARGINS)
    }


def reward_terms(
    wanted: Mapping[str, Term], values: Mapping[str, Value], shortfall: Mapping[str, float]
) -> dict[str, float]:
    """The terms of the reward, by name; one that costs nothing is 0, not -0."""
    found = {name: 0.0 - term.weight * distance(values[name], term.band) for name, term in wanted.items()}
    return found | {name: 0.0 - MARGIN_WEIGHT * value for name, value in shortfall.items()}
