"""Which bands can be reached, alone and together, as all evaluated sets show it."""

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

from optuna.trial import FrozenTrial

from steer_env.experiments.calibration.constraints import GAIN, PHASE, describe_violation
from steer_env.experiments.calibration.problem import Problem, distance
from steer_env.experiments.calibration.search import best, keeps_constraints
from steer_env.experiments.pages.words import label, unit
from steer_env.targets import Band

IN_BAND = 1e-9  # distance that counts as within the band [1]
FEW_SETS = 100  # sets with which an optimiser has hardly begun, so that they show little; assumed


class Closest(NamedTuple):
    """How near the sets come to a band."""

    metric: str
    distance: float  # smallest of the worst over the conditions, of sets that keep the margins [1]
    unkept: float  # the same of all sets [1]
    low: float  # smallest and largest value over the conditions, of the nearest set [unit]
    high: float  # [unit]
    conditions: tuple[str, ...]  # of the nearest set, in which the metric is outside


class Pair(NamedTuple):
    """Two bands that are reached one by one, but by no set together."""

    metrics: tuple[str, str]
    distances: tuple[float, float]  # of the set that comes nearest to both [1]


class Feasibility(NamedTuple):
    """What the sets show."""

    sets: int
    reached: bool  # whether a set has all counted bands in every condition and keeps the constraints
    never: tuple[Closest, ...]  # bands that no set reaches while it keeps the constraints
    pairs: tuple[Pair, ...]
    missed: tuple[str, ...]  # bands that the best set misses
    constrained: int  # sets that miss a constraint
    nearest: tuple[
        tuple[str, float], ...
    ] = ()  # constraints that the set misses which misses them least, if none keeps
    # them, with the violation over the limit's size, the largest first [1]


def distances(problem: Problem, trial: FrozenTrial, counted: Sequence[str]) -> dict[str, float]:
    """The largest distance of each metric from its band over the conditions [1]."""
    each = trial.user_attrs["details"]["metrics"].values()
    return {name: max(distance(values[name], problem.bands[name]) for values in each) for name in counted}


def _closest(name: str, band: Band, trials: Sequence[FrozenTrial], far: Mapping[int, Mapping[str, float]]) -> Closest:
    def nearest(chosen: Sequence[FrozenTrial]) -> FrozenTrial:
        return min(chosen, key=lambda t: (far[id(t)][name], t.number))

    safe = [t for t in trials if keeps_constraints(t)]
    leader = nearest(safe or trials)
    of = {label: values[name] for label, values in leader.user_attrs["details"]["metrics"].items()}
    known = [value for value in of.values() if value is not None] or [float("nan")]
    outside = tuple(label for label, value in of.items() if distance(value, band) > IN_BAND)
    return Closest(name, far[id(leader)][name], far[id(nearest(trials))][name], min(known), max(known), outside)


def judge(problem: Problem, trials: Sequence[FrozenTrial], counted: Sequence[str]) -> Feasibility:
    """What the evaluated sets show of the bands that are counted."""
    far = {id(t): distances(problem, t, counted) for t in trials}
    safe = [t for t in trials if keeps_constraints(t)]
    alone = {name for name in counted if any(far[id(t)][name] <= IN_BAND for t in safe)}
    never = tuple(_closest(n, problem.bands[n], trials, far) for n in counted if n not in alone)
    pairs = []
    for a, b in combinations([n for n in counted if n in alone], 2):
        near = min(safe, key=lambda t: far[id(t)][a] + far[id(t)][b])
        if far[id(near)][a] + far[id(near)][b] > IN_BAND:
            pairs.append(Pair((a, b), (far[id(near)][a], far[id(near)][b])))
    leader = best(list(trials))
    missed = tuple(n for n in counted if leader is None or far[id(leader)][n] > IN_BAND)
    reached, constrained = leader is not None and not missed, len(trials) - len(safe)
    return Feasibility(len(trials), reached, never, tuple(pairs), missed, constrained, _least(trials, safe))


def nearest(trials: Sequence[FrozenTrial]) -> FrozenTrial:
    """The set whose largest violation of a constraint is the smallest."""
    return min(trials, key=lambda t: (max(t.constraints.values()), t.number))


def _least(trials: Sequence[FrozenTrial], safe: Sequence[FrozenTrial]) -> tuple[tuple[str, float], ...]:
    """What :func:`nearest` misses; nothing where a set keeps all constraints."""
    if safe or not trials:
        return ()
    missed = nearest(trials).constraints
    return tuple(sorted(((name, far) for name, far in missed.items() if far > 0.0), key=lambda item: -item[1]))


def sentences(problem: Problem, found: Feasibility, units: Mapping[str, str], confirmed: str) -> list[str]:
    """The verdict in words; ``confirmed`` names the optimisers whose sets these are."""
    margins = f"{PHASE:g} deg and {GAIN:g} dB"
    if found.reached:
        return [f"Feasible: a set has every counted band in all conditions and keeps {margins} at all speeds."]
    kept = found.sets - found.constrained
    tried = f"{found.sets} different sets of {confirmed} show" if found.sets > 1 else f"one set of {confirmed} shows"
    among = f", {kept} of which keep the constraints" if 0 < kept < found.sets else ""
    said = [
        f"Not feasible as far as {tried}{among}: none has every counted band in all conditions and keeps {margins}."
    ]
    if found.nearest:
        each = "; ".join(describe_violation(*miss) for miss in found.nearest[:3])
        more = f", and {len(found.nearest) - 3} more" if len(found.nearest) > 3 else ""
        said[0] = f"Not feasible as far as {tried}: no set keeps the constraints."
        said.append(f"The set that comes nearest misses {each}{more}.")
    for c in found.never:
        if not kept and c.unkept <= IN_BAND:
            continue  # it is reached, by sets that miss a constraint, as all do
        low, high = problem.bands[c.metric].good
        band = f"its band of {low:g} to {high:g} {unit(units[c.metric])}".rstrip()
        none = f"in no set in {band} in all conditions"
        if kept and c.unkept <= IN_BAND:
            none += " while the constraints are kept"
        where = f", outside at {'; '.join(c.conditions)}" if c.conditions else ""
        values = "refused in all conditions" if math.isnan(c.low) else f"{c.low:.3g} to {c.high:.3g}"
        said.append(f"The metric {label(c.metric)} is {none}: at best {values}{where}.")
    for pair in sorted(found.pairs, key=lambda p: -sum(p.distances))[:6]:
        (a, b), (x, y) = pair
        shown = f"conflict, as far as {kept} sets that keep the constraints show"
        if kept < FEW_SETS:
            shown = f"may conflict ({kept} sets that keep the constraints are too few to tell)"
        said.append(
            f"The metrics {label(a)} and {label(b)} {shown}: each band is reached, but no set reaches both; the one "
            f"that comes nearest to both is {x:.2g} and {y:.2g} widths off."
        )
    if not found.never and not found.pairs and found.missed and kept:
        missed = ", ".join(map(label, found.missed))
        said.append(f"Every two bands are reached together; the best set misses {missed}.")
    return said


def as_json(found: Feasibility) -> dict[str, Any]:
    """The verdict as JSON."""
    return {
        **found._asdict(),
        "never": [
            {key: None if isinstance(x, float) and math.isnan(x) else x for key, x in c._asdict().items()}
            for c in found.never
        ],
        "pairs": [p._asdict() for p in found.pairs],
    }
