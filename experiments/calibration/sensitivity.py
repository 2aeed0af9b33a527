"""Sensitivity of every metric and margin to parameters of the assist, the friction, the load and the car."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.experiments.calibration import screening, variation
from steer_env.experiments.calibration.problem import Range
from steer_env.experiments.calibration.screening import Design, Effect
from steer_env.experiments.calibration.variation import FRICTION, OF_LOOP, Block, Study, evaluate, unit_of
from steer_env.experiments.sweep import Runner, run
from steer_env.friction.numerics.check import number
from steer_env.targets import Targets
from steer_env.tuning.parameters import KNOWN
from steer_env.tuning.scenarios.tune_all_round import SCENARIO
from steer_env.vehicle.cars import Car

SPAN = 0.5  # part of the tuning range to either side of the car's own value that a parameter of the assist goes over
FACTOR = 1.25  # by which another quantity of the car is multiplied and divided by default, assumed
FACTOR_OF_LAW = 2.0  # by which a parameter of the law is multiplied and divided by default, assumed
# Ranges of the conditions by default; assumed [their units].
RANGES = {"load": (0.0, 300.0), "road_friction": (0.75, 1.0), "friction_level": (0.5, 2.0), "speed": (22.0, 33.0)}


class Row(NamedTuple):
    """An output with what every parameter does to it."""

    name: str
    test: str  # "" for a margin of the loop
    unit: str
    own: float  # of the car as it is [unit]
    band: tuple[float, float] | None  # target [unit]
    effects: list[Effect] | None  # by factor; None where it is refused too often
    refused: int  # points of the design at which it is refused
    reason: str  # the most frequent one

    @property
    def scale(self) -> float:
        """What a change is told as a share of: width of the band, limit of a margin, else size of the own value."""
        if self.band is None:
            return abs(self.own) if self.own else math.nan
        low, high = self.band
        return low if math.isinf(high) else high - low


class Results(NamedTuple):
    """All that the page shows."""

    study: Study
    law: str
    targets: str
    design: Design
    rows: list[Row]

    @property
    def points(self) -> int:
        """Number of parameter sets in the design."""
        return int(np.prod(self.design.points.shape[:2]))


def factors_of(car: Car, law: Any, names: Sequence[str], span: float = SPAN) -> tuple[Range, ...]:
    """The parameters by name, each with the range that it is given as ``NAME=LOW:HIGH``, or the usual one.

    Names are those of :func:`steer_env.experiments.calibration.variation.quantity`.

    Raises
    ------
    ValueError
        An unknown name, one that is given twice, or a range that is empty or not allowed.
    """
    number("--span", span, minimum=0.0, maximum=1.0, above=True)
    given = dict[str, tuple[float, float] | None]()
    for text in names:
        name, equals, ends = text.partition("=")
        if name in given:
            raise ValueError(f"--parameters gives {name} twice: give it once")
        given[name] = _ends(name, ends) if equals else None
    if len(given) < 2:
        raise ValueError(f"--parameters needs two or more of them, got {', '.join(given) or 'none'}")
    return tuple(_factor(car, law, name, ends, span) for name, ends in given.items())


def _ends(name: str, text: str) -> tuple[float, float]:
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        raise ValueError(f"--parameters {name} takes a range as {name}=LOW:HIGH, got {text!r}") from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ValueError(f"--parameters {name}={text}: the range must be finite, with LOW below HIGH")
    return low, high


def _factor(car: Car, law: Any, name: str, ends: tuple[float, float] | None, span: float) -> Range:
    unit, own, limits = variation.quantity(car, law, name)
    if name == "road_friction":
        limits = SCENARIO.least_road_friction, limits[1]
    if name in KNOWN:
        usual = KNOWN[name].value(car.assist, -span), KNOWN[name].value(car.assist, span)
    elif name in RANGES:
        usual = RANGES[name]
    else:
        by = FACTOR_OF_LAW if name.startswith(FRICTION) else FACTOR
        usual = max(own / by, limits[0]), min(own * by, limits[1])
        if ends is None and own <= 0.0:
            raise ValueError(f"{name} is {own:g}: give its range, --parameters {name}=LOW:HIGH")
    low, high = ends or usual
    if not limits[0] <= low < high <= limits[1]:
        raise ValueError(
            f"--parameters {name}={low:g}:{high:g}: it may go from {limits[0]:g} to {limits[1]:g} [{unit}]"
        )
    return Range(name, unit, low, high, own, low > 0.0, limits)


def value(factor: Range, x: float) -> float:
    """The value of a parameter at x in [0, 1] of its range, by its logarithm where the range is above 0."""
    if factor.logarithmic:
        return factor.low * (factor.high / factor.low) ** x
    return factor.low + x * (factor.high - factor.low)


def collect(
    study: Study,
    targets: Targets,
    law: str,
    design: Design,
    sweep: Runner = run,
    notify: Callable[[float, str], None] = lambda *_: None,
) -> Results:
    """Evaluate the points of a design, and the effects of every parameter.

    Parameters
    ----------
    study : Study
    targets : Targets
        Whose bands changes are told as shares of.
    law : str
        The friction law in words.
    design : Design
        Of as many parameters as the study has.
    sweep : Runner
    notify : (share, text) -> None

    Raises
    ------
    ValueError
        The car as it is cannot be driven through the tests, or too few parameter sets can.
    """
    bands = {name: band.good for name, band in targets.of_tests(study.tests).items()}
    study = variation.near_nominal(study)
    cases = [Block(study, (tuple(factor.own for factor in study.factors),), "the car as it is")]
    for k, points in enumerate(design.points.tolist(), 1):
        rows = tuple(tuple(map(value, study.factors, point)) for point in points)
        cases.append(Block(study, rows, f"parameter sets of block {k}"))
    results = sweep(evaluate, cases, notify=notify, words=lambda case: case.label)
    (first,), blocks = results[0], results[1:]
    if all(math.isnan(x) for (test, _), x in first.values.items() if test):
        raise ValueError(f"the car {study.car.name!r} cannot be driven as it is: {next(iter(first.refused.values()))}")
    found = []
    for output in study.outputs:
        test, name = output
        outputs: NDArray[np.float64] = np.array([[each.values[output] for each in block] for block in blocks])
        reasons = [each.refused[output] for block in blocks for each in block if output in each.refused]
        band = bands.get(name) if test else (OF_LOOP[name][1], math.inf)
        reason = max(reasons, key=reasons.count) if reasons else ""
        effects = screening.effects(design, outputs)
        found.append(Row(name, test, unit_of(output), first.values[output], band, effects, len(reasons), reason))
    banded = [row for row in found if row.test and row.band]
    if all(row.effects is None for row in banded):
        raise ValueError(
            f"every metric with a target band is refused at most parameter sets: {banded[0].reason}; narrow the ranges "
            "with --span or --parameters NAME=LOW:HIGH"
        )
    return Results(study, law, targets.name, design, found)
