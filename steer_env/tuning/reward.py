"""What a set earns: distances of its metrics to target bands, and what the assist loop's margins lack."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from steer_env.friction.numerics.check import not_negative
from steer_env.metrics import Value
from steer_env.targets import Band, Targets
from steer_env.tuning.scenarios import Scenario
from steer_env.vehicle.steering.margins import TARGETS as MARGINS
from steer_env.vehicle.steering.margins import Margins

FAR = 3.0  # bands off that count at most, and for a metric that is refused; assumed
MARGIN_WEIGHT = 5.0  # of a margin that lacks everything, against a metric one band off; assumed
MARGIN_TERMS = ("phase_margin", "gain_margin")


class Term(NamedTuple):
    """A metric in the reward."""

    band: Band
    weight: float  # per width of the band [1]


def terms(scenario: Scenario, targets: Targets, weights: Mapping[str, float] | None) -> dict[str, Term]:
    """Every metric of the scenario's tests that the targets have a band for.

    Raises
    ------
    ValueError
        Targets that have no band for any test of the scenario, or a weight of a term that there is not.
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


def distance(value: Value, band: Band) -> float:
    """How far a value is from the good band, over the band's width [1]; ``FAR`` at most, and where it is refused."""
    if value.reason:
        return FAR
    low, high = band.good
    return min(max(low - value.value, value.value - high, 0.0) / (high - low), FAR)


def decibels(gain: float) -> float:
    """A gain margin in dB."""
    return 20.0 * math.log10(gain)


def lacking(margins: Margins) -> dict[str, float]:
    """What each margin lacks of the usual 30 deg and 6 dB, over those [1]; all of it where the loop is unstable."""
    found = math.degrees(margins.phase), decibels(margins.gain)
    return {
        name: min(max(1.0 - have / least, 0.0), 1.0) if margins.stable else 1.0
        for name, have, least in zip(MARGIN_TERMS, found, MARGINS)
    }


def earned(wanted: Mapping[str, Term], values: Mapping[str, Value], lacks: Mapping[str, float]) -> dict[str, float]:
    """The terms of the reward, by name."""
    found = {name: -term.weight * distance(values[name], term.band) for name, term in wanted.items()}
    return found | {name: -MARGIN_WEIGHT * lack for name, lack in lacks.items()}
