"""Tuning of baseline assists: a small search for the options with which a task's own reward is largest.

A candidate counts only if it passes the suite for assists (:mod:`steer_env.experiments.learning.assist_suite`). The
search starts with the defaults, then tries a Latin hypercube over the declared ranges (``Baseline.tuned``), then draws
around the best, ever closer. Its budget is the number of candidates times the episodes that each drives, on seeds apart
from those of training and evaluation, under the conditions that the training of the id's policies draws. What it finds
is kept for ``steer_env.assists.make``, whose defaults it becomes.
"""

import json
import math
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import qmc

from steer_env import assists
from steer_env.assists.common.definition import BASELINES, TUNED
from steer_env.experiments.learning import assist_suite, held_out, training
from steer_env.experiments.pages.files import write_json
from steer_env.vehicle.cars import Car

SEED = 5_000_000  # first of the episodes of a search
SPREAD, SHRINK = 0.2, 0.85  # of the draws around the best, over the range: the first, and of each over the one before


class Tuned(NamedTuple):
    """What a search has found."""

    options: dict[str, float]  # of the baseline; the defaults where nothing better passes the suite
    reward: float  # mean over the episodes; NaN if no candidate passes the suite
    usual: float  # that of the defaults
    candidates: int
    refused: int  # candidates that were better than the best before them, but failed the suite


def _option(low: float, high: float, share: float) -> float:
    """The value at a share of a range, 0 to 1; on a logarithmic scale where the least is above zero."""
    value = low * (high / low) ** share if low > 0.0 else low + share * (high - low)
    return float(f"{value:.3g}")


def tune(
    name: str,
    env_id: str,
    budget: int = 30,
    episodes: int = 16,
    seed: int = 0,
    car: Car | None = None,
    notify: Callable[[float, str], None] = lambda *_: None,
    **arguments: Any,
) -> Tuned:
    """Search for the options of a baseline with the largest reward that pass the suite.

    Parameters
    ----------
    name : str
        One of ``steer_env.assists.available()``.
    env_id : str
        An assist task's.
    budget : int
        Number of candidates, the defaults among them.
    episodes : int
        For each candidate, the same for all.
    seed : int
        Of the search's own draws.
    car : Car, optional
        Of the episodes and of the suite, in place of theirs.
    notify : (share, text) -> None
        Is told how far the search is.
    **arguments
        Of ``gymnasium.make_vec``, for the episodes; those that are not given are the conditions of the training.
    """
    arguments = {**training.conditions(env_id), **arguments}
    ranges, rng = BASELINES[name].tuned, np.random.default_rng(seed)
    first = qmc.LatinHypercube(max(len(ranges), 1), seed=rng).random(max(budget // 2, 1))
    if car is not None:
        arguments["vehicle"] = car.data()
    best: dict[str, float] = {}
    reward = usual = -math.inf
    centre, refused, tried = np.full(len(ranges), 0.5), 0, 1 if not ranges else budget
    for k in range(tried):
        share = centre
        if 0 < k <= len(first):
            share = first[k - 1]
        elif k:
            spread = SPREAD * SHRINK ** (k - 1 - len(first))
            share = np.clip(centre + spread * rng.standard_normal(len(ranges)), 0.0, 1.0)
        options = {key: _option(*ends, s) for (key, ends), s in zip(ranges.items(), share.tolist())} if k else {}
        notify(k / tried, f"{name}: {options}")
        make = partial(assists.make, name, tuned=False, **options)
        found = float(held_out.collect(env_id, make, episodes, SEED, **arguments).reward.mean())
        if k == 0:
            usual = found
        if found <= reward:
            continue
        if not all(result.holds for result in assist_suite.examine(make, env_id, to_first_failure=True, car=car)):
            refused += 1
            continue
        best, reward, centre = options, found, share
    return Tuned(best, reward if math.isfinite(reward) else math.nan, usual, tried, refused)


def keep(env_id: str, found: Mapping[str, dict[str, Any]], path: Path = TUNED) -> None:
    """Put what searches for an id have found, by baseline, into a file; what it has of other searches stays."""
    every = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    every[env_id] = {**every.get(env_id, {}), **found}
    write_json(path, dict(sorted(every.items())))


class Search(NamedTuple):
    """A search that a worker makes; the fields are arguments of :func:`tune`."""

    name: str
    env_id: str
    budget: int
    episodes: int
    seed: int
    car: Car | None = None


def searched(search: Search) -> Tuned:
    """What a search finds."""
    return tune(*search)


def as_json(found: Tuned, episodes: int) -> dict[str, Any]:
    """What a search has found, as JSON."""
    reward = found.reward if math.isfinite(found.reward) else None
    return {**found._asdict(), "reward": reward, "episodes": episodes, "first_seed": SEED}
