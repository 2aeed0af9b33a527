"""The page of a tuning: what it means first, then parameters, bands, what is not reached, margins and the front."""

import functools
import itertools
import math
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import optuna
from optuna.importance import PedAnovaImportanceEvaluator, get_param_importances
from optuna.trial import FrozenTrial

from steer_env import metrics
from steer_env.experiments.calibration import (
    constraints,
    feasibility,
    margin_map,
    own_angles,
    search,
)
from steer_env.experiments.calibration import problem as problems
from steer_env.experiments.calibration.margin_map import Cell
from steer_env.experiments.calibration.problem import Range, distance
from steer_env.experiments.calibration.tuning import MOVED, Outcome
from steer_env.experiments.pages import tuning_pictures
from steer_env.experiments.pages.pages import Page
from steer_env.experiments.pages.words import label as in_words
from steer_env.experiments.pages.words import number, unit

NAME = "tune"
LABELS = {
    "surface": "response surfaces",
    "tpe": "TPE",
    "nsga2": "NSGA-II",
    "nsga3": "NSGA-III",
    "random": "random search",
}
BOOST_SPEEDS, BOOST_POINTS = 4, 71  # of the picture of the boost
AXIS_REACH = 1.5  # of the farthest marked set, up to which the axes of the front go; assumed [1]


def label(name: str) -> str:
    """An optimiser as people write it, from the name of its study; different for every study."""
    optimiser = LABELS[name.split()[-1]]
    return f"{optimiser}, confirming" if name.startswith("second ") else optimiser


def _objectives(trials: list[FrozenTrial]) -> Any:
    width = len(trials[0].user_attrs["objectives"]) if trials else 1
    return np.array([t.user_attrs["objectives"] for t in trials if search.keeps_constraints(t)]).reshape(-1, width)


def _front(values: Any) -> Any:
    """The rows that no other row is at least as good as in everything and better in something."""
    better = [bool(np.any(np.all(values <= row, axis=1) & np.any(values < row, axis=1))) for row in values]
    return np.unique(values[~np.array(better, bool)], axis=0)


def ends(values: Any, marks: Sequence[Sequence[float]]) -> list[float]:
    """Ends (K,) of the axes of the front: all sets (N, K) where they are near, and the marked ones [1]."""
    farthest = np.max([*marks, *_front(values)], axis=0)
    most = np.maximum(np.max([*marks, *values], axis=0), 0.1)
    return [float(x) for x in np.minimum(1.05 * most, np.maximum(AXIS_REACH * farthest, 0.1))]


def outside(values: Any, ends: Sequence[float]) -> int:
    """Number of sets (N, K) beyond the end of an axis."""
    return int(np.sum(np.any(np.asarray(values) > np.asarray(ends), axis=1)))


def _pareto(o: Outcome) -> dict[str, Any]:
    """The sets by their objectives."""
    names = list(dict.fromkeys(o.problem.groups[name] for name in o.counted))
    sets = {label(key): _objectives(trials) for key, trials in o.trials.items()}
    every = np.concatenate(list(sets.values()))
    marks = {
        text: t.user_attrs["objectives"] for text, t in (("starting point", o.own), ("best", o.best)) if t is not None
    }
    limits = ends(every, list(marks.values())) if len(every) else []
    course = {}
    for key, trials in o.trials.items():
        best = np.minimum.accumulate([search.total(t) if search.keeps_constraints(t) else math.inf for t in trials])
        course[label(key)] = np.where(np.isfinite(best), best, np.nan)
    own = search.total(o.own) if o.own is not None else math.nan
    return {
        "parts": [] if o.best is None else [number(x) for x in o.best.user_attrs["objectives"]],
        "total": "" if o.best is None else number(search.total(o.best)),
        "single": {} if o.best is None else {name: float(every[:, k].min()) for k, name in enumerate(names)},
        "sets": len(every),
        "beyond": outside(every, limits) if len(every) else 0,
        "picture": tuning_pictures.front(sets, _front(every), marks, names, limits) if len(every) else "",
        "course": tuning_pictures.course(course, own),
    }


def _units(o: Outcome) -> dict[str, str]:
    return {name: metrics.definition(name).unit for name in o.problem.bands}


def _span(trial: FrozenTrial | None, name: str) -> tuple[float, float]:
    """Smallest and largest value of a metric over the conditions [its unit]; NaN where a test refused it."""
    if trial is None:
        return math.nan, math.nan
    values = [values[name] for values in trial.user_attrs["details"]["metrics"].values()]
    known = [math.nan if value is None else value for value in values]
    return float(np.min(known)), float(np.max(known))


def _metric_off_band(o: Outcome, trial: FrozenTrial | None, name: str) -> str:
    if trial is None:
        return "–"
    each = trial.user_attrs["details"]["metrics"]
    far = {text: distance(values[name], o.problem.bands[name]) for text, values in each.items()}
    worst = max(far, key=lambda text: far[text])
    return "in band" if far[worst] <= feasibility.IN_BAND else f"{number(far[worst])} off, {worst}"


def _bands_of_set(o: Outcome, trial: FrozenTrial | None) -> tuple[str, ...]:
    """The counted bands that a set reaches in all conditions."""
    return () if trial is None else tuple(name for name in o.counted if _metric_off_band(o, trial, name) == "in band")


def other(o: Outcome) -> FrozenTrial | None:
    """What is set against the starting point: the best set, or where none keeps the limits that which misses least."""
    every = [t for trials in o.trials.values() for t in trials]
    return o.best or (feasibility.nearest(every) if every else None)


class Answer(NamedTuple):
    """What a tuning has found, in terms of its limits and bands."""

    start: tuple[str, ...]  # limits that the starting point breaks, in words
    broken: tuple[str, ...]  # those that :func:`other` breaks
    points: int  # of the margin map at which it does
    kept: bool  # whether a set keeps all constraints
    alone: bool  # whether no set is better than the starting point
    reached: tuple[str, ...]  # bands that it reaches in all conditions
    never: tuple[str, ...]  # that no set reaches while it keeps the limits
    given_up: tuple[str, ...]  # that only the starting point reaches
    farther: float  # distance from all bands beyond that of the starting point, 0 where it is nearer [widths]


def _broken(trial: FrozenTrial | None, cells: Sequence[Cell]) -> tuple[str, ...]:
    """The limits that a set breaks where the search looks or on its map, in words and in the order of all limits."""
    found = set[str]()
    if trial is not None:
        found = {constraints.kind(name) for name, far in trial.constraints.items() if far > 0.0}
    found |= {words for cell in cells for words in cell.broken}
    if cells:
        found.discard(constraints.LIMIT_WORDS["map"])  # the cells say which margin
    return tuple(words for words in constraints.LIMIT_WORDS.values() if words in found)


def answer(o: Outcome) -> Answer:
    """What the first screen says."""
    shown, far = other(o), 0.0
    if o.own is not None and shown is not None:
        far = max(search.total(shown) - search.total(o.own), 0.0)
    before, after = _bands_of_set(o, o.own), _bands_of_set(o, shown)
    return Answer(
        start=_broken(o.own, o.start_cells),
        broken=_broken(shown, o.cells),
        points=len(margin_map.cells_below_limits(o.cells)),
        kept=o.best is not None,
        alone=o.best is not None and o.own is not None and o.best.params == o.own.params,
        reached=after,
        never=tuple(c.metric for c in o.feasibility.never),
        given_up=tuple(name for name in before if name not in after),
        farther=far,
    )


class Side(NamedTuple):
    """A value in the table of the first screen."""

    text: str
    kept: bool | None = None  # whether it keeps the limit of its row; None where the row has none


def _digits_to_limit(value: float, limit: float, highest: bool = False) -> Side:
    """A value beside its least limit, or its highest one, with as many digits as tell a broken limit."""
    kept = value <= limit if highest else value >= limit
    told = (number(value, digits) for digits in range(3, 9))
    return Side(number(value) if kept else next((x for x in told if x != number(limit)), number(value)), kept)


def _side(trial: FrozenTrial | None, cells: Sequence[Cell]) -> dict[str, Side]:
    """What a set has beside each limit, by row."""
    if trial is None:
        return {}
    margins = trial.user_attrs["details"]["margins"]
    least, known = constraints.least(margins), [cell for cell in cells if cell.margins]
    phase = min([least["phase_margin"], *(cell.phase_deg for cell in known)])
    gain = min([least["gain_margin"], *(cell.gain_db for cell in known)])
    missed = len(margin_map.cells_below_limits(known))
    return {
        "phase": _digits_to_limit(phase, constraints.PHASE),
        "gain": _digits_to_limit(gain, constraints.GAIN),
        "map": Side(f"{missed}\u00a0of\u00a0{len(known)}", not missed) if known else Side("–"),
        "motor": _digits_to_limit(margins["motor_limit"], 1.0, highest=True),
        "damping": _digits_to_limit(least["free_damping"], 0.0),
        "rest": Side("yes" if least["free_pulse"] else "no", bool(least["free_pulse"])),
    }


def _comparison(o: Outcome, found: Answer) -> dict[str, tuple[Side, Side]]:
    """The table of the first screen: the starting point and :func:`other` in each row, at most ten."""
    shown = other(o)
    sides = [(o.own, o.start_cells), (shown, o.cells)]
    rows = {"bands": [Side("–" if t is None else str(len(_bands_of_set(o, t)))) for t, _ in sides]}
    rows["distance"] = [Side("–" if t is None else number(search.total(t))) for t, _ in sides]
    rows["given_up"] = [Side("–"), Side(", ".join(map(in_words, found.given_up)) or "none")]
    if found.farther and found.kept:
        rows["farther"] = [Side("–"), Side(number(found.farther))]
    each = [_side(*side) for side in sides]
    for key in ("phase", "gain", "map", "motor", "damping", "rest"):
        rows[key] = [side.get(key, Side("–")) for side in each]
    return {key: (row[0], row[1]) for key, row in rows.items()}


def _bands(o: Outcome) -> dict[str, Any]:
    """Every band before and after."""
    units, against, rows = _units(o), other(o), []
    places = dict[str, dict[str, tuple[float, float]]]()
    never = [in_words(c.metric) for c in o.feasibility.never if o.best is not None]
    for name in o.counted:
        low, high = o.problem.bands[name].good
        before, after = _span(o.own, name), _span(against, name)
        shown = [f"{number(a)} to {number(b)}" for a, b in (before, after)]
        off = [_metric_off_band(o, o.own, name), _metric_off_band(o, against, name)]
        rows.append((in_words(name), unit(units[name]), f"{low:g} to {high:g}", shown[0], off[0], shown[1], off[1]))
        if not any(map(math.isnan, (*before, *after))):
            of = {"start": before, "best" if o.best is not None else "nearest": after}
            places[in_words(name)] = {
                text: ((a - low) / (high - low), (b - low) / (high - low)) for text, (a, b) in of.items()
            }
    left = [
        (in_words(name), unit(units[name]), f"{o.problem.bands[name].good[0]:g} to {o.problem.bands[name].good[1]:g}",
         *(f"{number(a)} to {number(b)}" for a, b in (_span(o.own, name), _span(against, name))), number(o.moved[name]))
        for name in o.problem.bands if name not in o.counted
    ]  # fmt: skip
    return {
        "rows": rows,
        "left": left,
        "most_changed": max((check.difference for check in o.checks.values()), default=0.0),
        "picture": tuning_pictures.bands(places, never) if places else "",
    }


def _boost(o: Outcome) -> Any:
    """The boost of the start and of :func:`other`, at some speeds of the car's table, as a picture."""
    shown = other(o)
    if shown is None:
        return ""
    start, tuned = o.problem.car.assist, problems.tuned_car_quietly(o.problem, shown.params).assist
    torques = np.linspace(0.0, start.torques[-1], BOOST_POINTS)
    speeds = np.unique(np.linspace(0, start.speeds.size - 1, BOOST_SPEEDS).round().astype(int))
    sides = [[np.interp(torques, a.torques, a.boost[k]) for k in speeds] for a in (start, tuned)]
    named = [number(3.6 * start.speeds[k]) for k in speeds]
    return tuning_pictures.boost(torques, named, np.array(sides[0]), np.array(sides[1]))


def _margins(o: Outcome) -> dict[str, Any]:
    """The margins before and after."""
    rows, sides = [], [t.user_attrs["details"]["margins"] for t in (o.own, other(o)) if t is not None]
    for key in sides[0] if sides else ():
        if key.startswith(("phase_", "gain_", "column_")):
            kind, _, speed = key.rpartition("_")
            sign, which = ("deg", "phase margin") if "phase" in key else ("dB", "gain margin")
            where = "column, fixed hands" if kind.startswith("column") else "laden car, hands off"
            rows.append((f"{which}, {where}", speed, sign, *(number(m[key]) for m in sides)))
    if sides:
        rows.append(
            ("greatest boost over the limit of the motor", "all", "1", *(number(m["motor_limit"]) for m in sides))
        )
    return {
        "rows": rows,
        "columns": 3 + len(sides),
        "least": {} if o.best is None else constraints.least(sides[-1]),
        "points": len([c for c in o.cells if c.margins]),
    }


def _sets_before_best(o: Outcome) -> dict[str, Any]:
    """The sets that were read on the whole map before the best one, as they miss a margin there."""
    better = list(itertools.takewhile(lambda pair: o.best is not None and pair[0].params != o.best.params, o.tried))
    if not better:
        return {"count": 0}
    return {"count": len(better), "off": search.total(better[0][0]), "where": better[0][1][0].where}


def _objective(k: int, trial: FrozenTrial) -> float:
    return trial.values[k]


def importances(o: Outcome) -> dict[str, dict[str, float]]:
    """Share of each parameter in what makes the better sets better, by objective, from all sets [1]."""
    names = list(dict.fromkeys(o.problem.groups[name] for name in o.counted))
    spaces, found = search.distributions(o.ranges), {}
    with search.quiet(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "PedAnova.*low `target`", UserWarning)  # which is what is wanted
        study = optuna.create_study(directions=["minimize"] * len(names))
        for t in (t for trials in o.trials.values() for t in trials):
            values = t.user_attrs["objectives"]
            study.add_trial(optuna.trial.create_trial(values=values, params=t.params, distributions=spaces))
        for k, name in enumerate(names):
            if len({t.values[k] for t in study.trials}) > 1:
                value = functools.partial(_objective, k)
                found[name] = get_param_importances(study, evaluator=PedAnovaImportanceEvaluator(), target=value)
    return found


def at_end(r: Range, value: float) -> str:
    """Which end of a range a value lies on, if that is no end of what the assist accepts; in words."""
    low, high = search.on_limit(r, value)
    if low and r.low > r.limits[0]:
        return "best on the lower limit"
    return "best on the upper limit" if high and r.high < r.limits[1] else ""


def parameters(o: Outcome, shares: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    """The tuned parameters, with the shares of :func:`importances`."""
    rows, ends, off = [], [], problems.without_effect(o.problem.car.assist)
    for r in o.ranges:
        first = next(f for f in o.problem.ranges if f.name == r.name)
        best = math.nan if o.best is None else o.best.params[r.name]
        notes = [f"widened from {number(first.low)} to {number(first.high)}"] if r.name in o.widened else []
        if o.best is not None and (where := at_end(r, best)):
            notes.append(where)
            ends.append(r.name)
        own = "–" if r.name in off else number(r.own)
        wide = f"{number(r.low)} to {number(r.high)}"
        rows.append((in_words(r.name), unit(r.unit), own, number(best), wide, "; ".join(notes)))
    drawn = ""
    if shares:  # an objective without bands, or the same in every set, has none
        named = {group: {in_words(name): x for name, x in each.items()} for group, each in shares.items()}
        drawn = tuning_pictures.importances(named, [in_words(r.name) for r in o.ranges])
    return {"rows": rows, "ends": ends, "count": sum(map(len, o.trials.values())), "picture": drawn}


def build_page(o: Outcome) -> tuple[Page, dict[str, Any]]:
    """The page and its numbers as JSON."""
    sets = {label(key): len(trials) for key, trials in o.trials.items()}
    confirmed = " and ".join(f"{name} ({count})" for name, count in sets.items())
    found, shares = answer(o), importances(o)
    values = {
        "o": o,
        "answer": found,
        "before": _bands_of_set(o, o.own),
        "compared": _comparison(o, found),
        "constraints": constraints,
        "few": feasibility.FEW_SETS,
        "population": search.POPULATION,
        "moved": MOVED,
        "sets": sets,
        "short": {
            label(key): len(trials)
            for key, trials in o.trials.items()
            if key.endswith("nsga2") and len(trials) < feasibility.FEW_SETS
        },
        "feasible": feasibility.sentences(o.problem, o.feasibility, _units(o), confirmed),
        "left": [name for name in o.problem.bands if name not in o.counted],
        "missed": margin_map.cells_below_limits(o.cells),
        "passed": _sets_before_best(o),
        "own_angles": own_angles.sentences(o.checks),
        "pairs": [(*map(in_words, p.metrics), *map(number, p.distances)) for p in o.feasibility.pairs],
        "pareto": _pareto(o),
        "bands": _bands(o),
        "boost": _boost(o),
        "parameters": parameters(o, shares),
        "margins": _margins(o),
    }
    data = {
        "answer": found._asdict(),
        "feasibility": feasibility.as_json(o.feasibility),
        "counted": list(o.counted),
        "moved": o.moved,
        "units": _units(o),
        "start": _as_json(o.own),
        "best": _as_json(o.best),
        "own_angles": own_angles.as_json(o.checks),
        "ranges": [r._asdict() for r in o.ranges],
        "widened": {name: [list(r[2:4]) for r in pair] for name, pair in o.widened.items()},
        "importances": shares,
        "map_missed": [c.where for c in margin_map.cells_below_limits(o.cells)],
        "start_map_missed": [c.where for c in margin_map.cells_below_limits(o.start_cells)],
        "tried": [{"set": t.number, "parameters": t.params, "missed": [c.where for c in m]} for t, m in o.tried],
        "sets": {
            key: [
                {"parameters": t.params, "objectives": t.user_attrs["objectives"], "kept": search.keeps_constraints(t)}
                for t in trials
            ]
            for key, trials in o.trials.items()
        },
    }
    return Page(NAME, values), data


def _as_json(trial: FrozenTrial | None) -> dict[str, Any] | None:
    if trial is None:
        return None
    details = trial.user_attrs["details"]
    values = {
        "parameters": trial.params,
        "objectives": trial.user_attrs["objectives"],
        "constraints": trial.constraints,
    }
    return {"set": trial.number, **values, "metrics": details["metrics"], "margins": details["margins"]}
