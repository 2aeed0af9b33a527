"""Production yield: which share of cars built with tolerances stays in the target bands, and what drives failures.

A share of n cars is binomial; its interval is that of Clopper and Pearson, which holds the truth in at least 95 % of
all samples. A refused output counts as outside its band, as nothing shows that it is inside.

What drives failures is found by Monte Carlo filtering: the largest distance between the distribution of a parameter in
cars that fail and in those that pass (Kolmogorov and Smirnov), from 0 where the parameter does not matter to 1 where a
value of it divides both. It needs no assumption of how the outputs depend on the parameters.

Sources: Clopper and Pearson, Biometrika 26 (1934); Hornberger and Spear, J. Environmental Management 12 (1981);
Saltelli et al., Global Sensitivity Analysis: The Primer (2008), section 5.2.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from steer_env.experiments.calibration import population, variation
from steer_env.experiments.calibration.population import Population, column
from steer_env.experiments.calibration.variation import OF_LOOP, Block, Output, Study, evaluate
from steer_env.experiments.sweep import Runner, run
from steer_env.experiments.sweep.sweep import Notify
from steer_env.targets import Band, Targets

Array = NDArray[np.float64]
Which = NDArray[np.bool_]

LEVEL = 0.95  # of the intervals [1]
FEWEST = 8  # cars that fail, and that pass, below which nothing is said of what drives failures, assumed
INNER = 0.5  # part of a tolerance that a narrower one keeps [1]


class Share(NamedTuple):
    """A share of cars."""

    cars: int  # that have what is asked
    of: int

    @property
    def value(self) -> float:
        """The share [1]; NaN of no car."""
        return self.cars / self.of if self.of else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Its 95 % interval by Clopper and Pearson [1]."""
        if not self.of:
            return 0.0, 1.0
        found = stats.binomtest(self.cars, self.of).proportion_ci(LEVEL, method="exact")
        return float(found.low), float(found.high)


class Driver(NamedTuple):
    """What a parameter has to do with failures."""

    name: str
    distance: float  # between its distributions in failing and in passing cars, 0 to 1 [1]
    high: bool  # whether failing cars have the larger values in the mean
    told: bool  # whether the distance is told apart from none at 5 %, all parameters together


class Judged(NamedTuple):
    """An output of all cars beside its band."""

    test: str  # "" for a margin of the loop
    name: str
    unit: str
    own: float  # of the nominal car [unit]
    band: Band  # [unit]
    values: Array  # (n,), NaN where it is refused [unit]
    reason: str  # the most frequent one where it is refused
    drivers: tuple[Driver, ...]  # the strongest first; empty where too few cars fail or pass

    @property
    def nominal(self) -> bool:
        """Whether the nominal car is in the good band."""
        return self.band.good[0] <= self.own <= self.band.good[1]

    @property
    def inside(self) -> Which:
        """(n,) whether each car is in the good band."""
        low, high = self.band.good
        found: Which = (self.values >= low) & (self.values <= high)
        return found

    @property
    def share(self) -> Share:
        """Of cars in the good band."""
        return Share(int(self.inside.sum()), self.values.size)

    @property
    def fair(self) -> Share:
        """Of cars in the fair band, in which the good one lies."""
        low, high = self.band.fair
        return Share(int(((self.values >= low) & (self.values <= high)).sum()), self.values.size)

    @property
    def below(self) -> int:
        """Cars below the good band."""
        return int((self.values < self.band.good[0]).sum())

    @property
    def above(self) -> int:
        """Cars above it."""
        return int((self.values > self.band.good[1]).sum())

    @property
    def refused(self) -> int:
        """Cars of which the output is refused."""
        return int(np.isnan(self.values).sum())


class Results(NamedTuple):
    """All that the page shows."""

    study: Study
    law: str
    targets: str
    distribution: str
    seed: int
    cars: Population
    judged: list[Judged]
    held: Share  # of cars in every good band that the nominal car is in
    drivers: tuple[Driver, ...]  # of a car that misses one of these
    narrowed: dict[str, Share]  # parameter -> of cars with it in the inner half of its range, those in all of these

    @property
    def total(self) -> Share:
        """Of cars in every good band."""
        every = np.all([each.inside for each in self.judged], axis=0)
        return Share(int(every.sum()), every.size)

    @property
    def fair(self) -> Share:
        """Of cars in every fair band."""
        ends = [(each.values, *each.band.fair) for each in self.judged]
        every = np.all([(x >= low) & (x <= high) for x, low, high in ends], axis=0)
        return Share(int(every.sum()), every.size)


def bands_of(targets: Targets, study: Study) -> dict[Output, Band]:
    """The bands of the tests that are driven, and the limits of the margins; ValueError where a test has none."""
    for test in study.tests:
        if not targets.bands.get(test):
            known = ", ".join(test for test, bands in targets.bands.items() if bands)
            raise ValueError(f"targets {targets.name!r} have no band for {test}: it has {known}")
    found = {(test, name): band for test in study.tests for name, band in targets.bands[test].items()}
    limits = {("", name): Band((least, math.inf), (least, math.inf)) for name, (_, least) in OF_LOOP.items()}
    return found | limits


def drivers_of(parameters: Mapping[str, Array], fails: Which) -> tuple[Driver, ...]:
    """Parameters (n,) by what they have to do with failures (n,), the strongest first.

    Empty where fewer than ``FEWEST`` cars fail or pass.
    """
    if min(fails.sum(), (~fails).sum()) < FEWEST:
        return ()
    found = []
    for name, values in parameters.items():
        failing, passing = values[fails], values[~fails]
        test = stats.ks_2samp(failing, passing, method="asymp")
        told = bool(test.pvalue < (1.0 - LEVEL) / len(parameters))
        found.append(Driver(name, float(test.statistic), bool(failing.mean() > passing.mean()), told))
    return tuple(sorted(found, key=lambda each: -each.distance))


def collect(
    study: Study,
    targets: Targets,
    law: str,
    n: int,
    seed: int = 0,
    distribution: str = "uniform",
    sweep: Runner = run,
    notify: Notify = lambda *_: None,
) -> Results:
    """Draw and drive cars, and compare them with target bands.

    Parameters
    ----------
    study : Study
        Of :func:`steer_env.experiments.calibration.population.study_of`.
    targets : Targets
    law : str
        The friction law in words.
    n, seed, distribution
        As of :func:`steer_env.experiments.calibration.population.population`.
    sweep : Runner
    notify : (share, text) -> None

    Raises
    ------
    ValueError
        A test without bands, or a nominal car that cannot be driven.
    """
    bands, study = bands_of(targets, study), variation.near_nominal(study)
    (nominal,) = evaluate(Block(study, (tuple(f.own for f in study.factors),), "the nominal car"))
    if all(math.isnan(x) for (test, _), x in nominal.values.items() if test):
        why = next(iter(nominal.refused.values()))
        raise ValueError(f"the nominal car {study.car.name!r} cannot be driven: {why}")
    cars = population.collect(study, n, seed, distribution, sweep, notify)
    judged = [_judge(output, band, nominal.values[output], cars) for output, band in bands.items()]
    # Where the nominal car misses a band, nearly all do, and tolerances are not why.
    inside = np.all([np.ones(n, np.bool_), *(each.inside for each in judged if each.nominal)], axis=0)
    narrowed = {}
    for f in study.factors:
        inner = np.abs(cars.parameters[f.name] - 0.5 * (f.low + f.high)) <= 0.5 * INNER * (f.high - f.low)
        narrowed[f.name] = Share(int((inside & inner).sum()), int(inner.sum()))
    held, drivers = Share(int(inside.sum()), inside.size), drivers_of(cars.parameters, ~inside)
    return Results(study, law, targets.name, distribution, seed, cars, judged, held, drivers, narrowed)


def _judge(output: Output, band: Band, own: float, cars: Population) -> Judged:
    name = column(output)
    reasons = list(cars.refused.get(name, {}).values())
    reason = max(reasons, key=reasons.count) if reasons else ""
    row = Judged(*output, variation.unit_of(output), own, band, cars.outputs[name], reason, ())
    return row._replace(drivers=drivers_of(cars.parameters, ~row.inside))
