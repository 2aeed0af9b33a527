"""A sampler of Optuna that models what the objectives are made of: response surfaces of every metric and constraint.

A distance from a band has no slope inside the band and jumps from one condition to another, but the metrics themselves
are smooth in the parameters. So radial basis functions are fitted to the place of every metric in its band in every
condition and to every constraint, and the next set is the best one of the model within a distance of the best set so
far. The distances take turns, from coarse to fine, as in the stochastic method of Regis and Shoemaker, A stochastic
radial basis function method for the global optimization of expensive functions, INFORMS Journal on Computing 19 (2007).
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from optuna.distributions import BaseDistribution, FloatDistribution
from optuna.samplers import BaseSampler, RandomSampler
from optuna.search_space import IntersectionSearchSpace
from optuna.study import Study
from optuna.trial import FrozenTrial, TrialState
from scipy.interpolate import RBFInterpolator

Array = NDArray[np.float64]

RADII = (1.0, 0.3, 0.15, 0.08, 0.04)  # of the region around the best set, in turns; assumed [widths of the ranges]
CANDIDATES, STAGES = 600, 4  # sets that are tried on the model in each stage; assumed
SMOOTHING = 1e-3  # of the surfaces, as a metric is not quite smooth; assumed
PENALTY = 20.0  # of a modelled violation over a distance of one width; assumed
GUARD = 0.02  # by which the model should keep a constraint, assumed [its limit]
FAR = 4.0  # places and violations are modelled up to this, assumed [widths of the band, limits]
APART = 1e-3  # least distance between two sets, assumed [widths of the ranges]


def distances(places: Array) -> Array:
    """Sum (N,) over the metrics of the largest distance in a condition, of places (N, metrics, conditions) [1]."""
    off = np.maximum(np.maximum(-places, places - 1.0), 0.0)
    return off.max(axis=2).sum(axis=1)


class ResponseSurfaces(BaseSampler):
    """Sets that the modelled metrics make good; sets so far have ``places`` (metrics, conditions) as an attribute."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._random = RandomSampler(seed=seed)
        self._space = IntersectionSearchSpace()

    def infer_relative_search_space(self, study: Study, trial: FrozenTrial) -> dict[str, BaseDistribution]:
        """The parameters that all sets have."""
        return self._space.calculate(study)

    def sample_independent(self, study: Study, trial: FrozenTrial, name: str, distribution: BaseDistribution) -> Any:
        """A value at random, while there are too few sets for a model."""
        return self._random.sample_independent(study, trial, name, distribution)

    def sample_relative(
        self, study: Study, trial: FrozenTrial, search_space: dict[str, BaseDistribution]
    ) -> dict[str, Any]:
        """The best set of the model near the best set so far; nothing where there are too few."""
        trials = [t for t in study.get_trials(deepcopy=False) if t.state is not TrialState.FAIL]  # tried again
        # In an order of their own, so that rounding does not depend on which set was finished first.
        done = sorted((t for t in trials if t.state is TrialState.COMPLETE), key=lambda t: sorted(t.params.items()))
        driven = [t for t in done if np.isfinite(_places(t)).all()]
        if not search_space or len(driven) < len(search_space) + 2:
            return {}
        spaces = [(name, s) for name, s in search_space.items() if isinstance(s, FloatDistribution)]
        known = _unit([t for t in trials if t.params.keys() >= search_space.keys()], spaces)
        X, Y = _unit(driven, spaces), np.array([_places(t) for t in driven])
        shape = Y.shape[1:]
        surfaces = _surfaces(X, np.clip(Y, -FAR, FAR + 1.0).reshape(len(X), -1))
        limits = np.array([list(t.constraints.values()) for t in done])
        walls = _surfaces(_unit(done, spaces), np.clip(limits, -FAR, 1.0)) if limits.size else None

        def worth(sets: Array) -> Array:
            value = distances(surfaces(sets).reshape(len(sets), *shape))
            if walls is not None:
                value = value + PENALTY * np.maximum(walls(sets) + GUARD, 0.0).sum(axis=1)
            gap = np.abs(sets[:, None, :] - known[None]).max(axis=2).min(axis=1)
            return np.where(gap < APART, math.inf, value)

        violated = np.array([max([*t.constraints.values(), 0.0]) for t in driven])
        centre = X[np.argmin(distances(Y) + PENALTY * violated)]
        x = self._chosen(worth, centre, RADII[len(trials) % len(RADII)])
        return {name: _value(s, float(u)) for (name, s), u in zip(spaces, x)}

    def _chosen(self, worth: Any, centre: Array, radius: float) -> Array:
        """The best of sets (d,) within a radius of a centre, by the model."""
        low, high = np.maximum(centre - radius, 0.0), np.minimum(centre + radius, 1.0)
        at, spread, found = centre, radius, math.inf
        for stage in range(STAGES):
            steps = spread * self._rng.standard_normal((CANDIDATES, centre.size))
            # Some candidates change a few parameters only, as most metrics have few that matter.
            steps *= self._rng.random(steps.shape) < self._rng.choice([0.3, 0.6, 1.0], (CANDIDATES, 1))
            sets = np.clip(at + steps, low, high)
            if stage == 0:
                sets = np.vstack([sets, self._rng.uniform(low, high, sets.shape)])
            values = worth(sets)
            k = int(np.argmin(values))
            if values[k] < found:
                at, found = sets[k], float(values[k])
            spread *= 0.5
        return at


def _surfaces(X: Array, Y: Array) -> RBFInterpolator:
    degree = 1 if len(X) >= X.shape[1] + 2 else 0
    return RBFInterpolator(X, Y, kernel="cubic", degree=degree, smoothing=SMOOTHING)


def _places(trial: FrozenTrial) -> Array:
    return np.array([[math.nan if x is None else x for x in row] for row in trial.user_attrs["places"]])


def _unit(trials: Sequence[FrozenTrial], spaces: Sequence[tuple[str, FloatDistribution]]) -> Array:
    """Sets (N, d) as shares of the ranges [1]."""
    rows = [[_share(s, t.params[name]) for name, s in spaces] for t in trials]
    return np.array(rows).reshape(len(trials), len(spaces))


def _share(s: FloatDistribution, value: float) -> float:
    return math.log(value / s.low) / math.log(s.high / s.low) if s.log else (value - s.low) / (s.high - s.low)


def _value(s: FloatDistribution, share: float) -> float:
    value = s.low * (s.high / s.low) ** share if s.log else s.low + share * (s.high - s.low)
    return min(max(float(value), s.low), s.high)
