"""Reward of a parameter set: distances of its metrics from target bands, and shortfall of the loop's margins."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from steer_env.friction.numerics.check import not_negative
from steer_env.metrics import Value
from steer_env.targets import Band, Targets
from steer_env.tuning.scenarios.common.definition import Scenario
from steer_env.vehicle.steering.margins import TARGETS as MARGINS
from steer_env.vehicle.steering.margins import Margins

MAX_DISTANCE = 3.0  # largest distance that counts, also for a refused metric; assumed [widths of the band]
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
    bands = {name: band for test in scenario.tests for name, band in targets.bands.get(test, {}).items()}
    if not bands:
        raise ValueError(f"targets {targets.name!r} have no bands for {', '.join(scenario.tests)}")
    given = dict(weights or {})
    for name in given:
        if name not in bands:
            raise ValueError(f"{scenario.name} has no reward term {name!r}; there are {', '.join(bands)}")
    weighted = {**dict.fromkeys(bands, 1.0), **scenario.weights, **given}
    return {name: Term(band, not_negative(f"weights[{name!r}]", weighted[name])) for name, band in bands.items()}


def worst(wanted: Mapping[str, Term], name: str) -> float:
    """The smallest value of a term of the reward."""
    return -wanted[name].weight * MAX_DISTANCE if name in wanted else -MARGIN_WEIGHT


def distance(value: Value, band: Band) -> float:
    """Distance of a value from the good band over the band's width [1].

    It is at most ``MAX_DISTANCE``, and exactly that where the metric was refused.
    """
    if value.reason:
        return MAX_DISTANCE
    low, high = band.good
    return min(max(low - value.value, value.value - high, 0.0) / (high - low), MAX_DISTANCE)


def decibels(gain: float) -> float:
    """A gain margin in dB."""
    return 20.0 * math.log10(gain)


def margin_shortfall(margins: Margins) -> dict[str, float]:
    """Shortfall of each margin below the usual 30 deg and 6 dB, over these [1]; 1 if the loop is unstable."""
    found = math.degrees(margins.phase), decibels(margins.gain)
    return {
        name: min(max(1.0 - have / least, 0.0), 1.0) if margins.stable else 1.0
        for name, have, least in zip(MARGIN_TERMS, found, MARGINS)
    }


def reward_terms(
    wanted: Mapping[str, Term], values: Mapping[str, Value], shortfall: Mapping[str, float]
) -> dict[str, float]:
    """The terms of the reward, by name; one that costs nothing is 0, not -0."""
    found = {name: 0.0 - term.weight * distance(values[name], term.band) for name, term in wanted.items()}
    return found | {name: 0.0 - MARGIN_WEIGHT * value for name, value in shortfall.items()}
