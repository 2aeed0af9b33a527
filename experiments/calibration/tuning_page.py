"""The page of a tuning: the gain first, then what is feasible, the front, the bands, the parameters and the margins."""

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from optuna.trial import FrozenTrial

from steer_env import metrics
from steer_env.experiments.calibration import (
    constraints,
    feasibility,
    margin_map,
    own_angles,
    search,
    tuning_parameters,
)
from steer_env.experiments.calibration.problem import distance
from steer_env.experiments.calibration.tuning import MOVED, Outcome
from steer_env.experiments.pages import tuning_pictures
from steer_env.experiments.pages.study_page import Page, Picture, Section, Table
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
REACH = 1.5  # of the farthest marked set, up to which the axes of the front go; assumed [1]


def label(name: str) -> str:
    """An optimiser as people write it, from the name of its study; different for every study."""
    optimiser = LABELS[name.split()[-1]]
    return f"{optimiser}, confirming" if name.startswith("second ") else optimiser


def _objectives(trials: list[FrozenTrial]) -> Any:
    width = len(trials[0].user_attrs["objectives"]) if trials else 1
    return np.array([t.user_attrs["objectives"] for t in trials if search.kept(t)]).reshape(-1, width)


def _front(values: Any) -> Any:
    """The rows that no other row is at least as good as in everything and better in something."""
    better = [bool(np.any(np.all(values <= row, axis=1) & np.any(values < row, axis=1))) for row in values]
    return np.unique(values[~np.array(better, bool)], axis=0)


def ends(values: Any, marks: Sequence[Sequence[float]]) -> list[float]:
    """Ends (K,) of the axes of the front: all sets (N, K) where they are near, and the marked ones [1]."""
    farthest = np.max([*marks, *_front(values)], axis=0)
    most = np.maximum(np.max([*marks, *values], axis=0), 0.1)
    return [float(x) for x in np.minimum(1.05 * most, np.maximum(REACH * farthest, 0.1))]


def outside(values: Any, ends: Sequence[float]) -> int:
    """Number of sets (N, K) beyond the end of an axis."""
    return int(np.sum(np.any(np.asarray(values) > np.asarray(ends), axis=1)))


def _pareto_section(o: Outcome) -> Section:
    names = list(dict.fromkeys(o.problem.groups[name] for name in o.counted))
    sets = {label(key): _objectives(trials) for key, trials in o.trials.items()}
    every = np.concatenate(list(sets.values()))
    chosen = _front(every) if len(every) else every
    marks = {
        text: t.user_attrs["objectives"] for text, t in (("starting point", o.own), ("best", o.best)) if t is not None
    }
    told = "No set keeps the constraints."
    if o.best is not None:
        parts = " + ".join(number(x) for x in o.best.user_attrs["objectives"])
        told = f"The best set is {parts} = {number(search.total(o.best))} widths off."
        alone = ", ".join(f"{name} {number(float(every[:, k].min()))}" for k, name in enumerate(names))
        told += f" Each objective by itself comes down to: {alone}."
    pictures = []
    if len(every):
        limits = ends(every, list(marks.values()))
        beyond = outside(every, limits)
        caption = f"All {len(every)} sets that keep the constraints, by pairs of objectives"
        caption += f"; {beyond} of them lie beyond the end of an axis" if beyond else ""
        pictures.append(Picture(tuning_pictures.front(sets, chosen, marks, names, limits), caption))
    course = {}
    for key, trials in o.trials.items():
        best = np.minimum.accumulate([search.total(t) if search.kept(t) else math.inf for t in trials])
        course[label(key)] = np.where(np.isfinite(best), best, np.nan)
    own = search.total(o.own) if o.own is not None else math.nan
    return Section(
        "Pareto front",
        "What one group of bands costs another.",
        "An objective is the sum over its bands of the largest distance in any condition, in widths of the band: 0 "
        "where all are reached. Only sets that keep the constraints count.",
        told,
        "What the sets show that were tried; another set may be better.",
        [*pictures, Picture(tuning_pictures.course(course, own), "The best set so far")],
    )


def _units(o: Outcome) -> dict[str, str]:
    return {name: metrics.definition(name).unit for name in o.problem.bands}


def _span(trial: FrozenTrial | None, name: str) -> tuple[float, float]:
    """Smallest and largest value of a metric over the conditions [its unit]; NaN where a test refused it."""
    if trial is None:
        return math.nan, math.nan
    values = [values[name] for values in trial.user_attrs["details"]["metrics"].values()]
    known = [math.nan if value is None else value for value in values]
    return float(np.min(known)), float(np.max(known))


def _off(o: Outcome, trial: FrozenTrial | None, name: str) -> str:
    if trial is None:
        return "–"
    each = trial.user_attrs["details"]["metrics"]
    far = {text: distance(values[name], o.problem.bands[name]) for text, values in each.items()}
    worst = max(far, key=lambda text: far[text])
    return "in band" if far[worst] <= feasibility.IN_BAND else f"{number(far[worst])} off, {worst}"


def _reached(o: Outcome, trial: FrozenTrial | None) -> str:
    """Number of the counted bands that a set reaches in all conditions."""
    return "–" if trial is None else str(sum(_off(o, trial, name) == "in band" for name in o.counted))


def _gain_section(o: Outcome) -> Section:
    if o.own is None or o.best is None:
        missing = "no set keeps the constraints" if o.best is None else "the starting point was not evaluated"
        told, rows = f"There is no gain to tell: {missing}.", []
    else:
        both, count = (o.own, o.best), len(o.counted)
        rows = [
            ("bands reached in all conditions", f"of {count}", *(_reached(o, t) for t in both)),
            ("distance from all bands", "widths", *(number(search.total(t)) for t in both)),
        ]
        for k, name in enumerate(dict.fromkeys(o.problem.groups[name] for name in o.counted)):
            each = (number(t.user_attrs["objectives"][k]) for t in both)
            rows.append((f"of these, {name}", "widths", *each))
        for key, (text, sign) in {
            "phase_margin": ("least phase margin", "deg"),
            "gain_margin": ("least gain margin", "dB"),
        }.items():
            rows.append(
                (text, sign, *(number(constraints.least(t.user_attrs["details"]["margins"])[key]) for t in both))
            )
        told = (
            f"From the starting point to the best set: {rows[0][2]} → {rows[0][3]} of {count} bands reached in all "
            f"conditions, {rows[1][2]} → {rows[1][3]} widths off in all."
        )
    return Section(
        "Gain",
        "What the tuning improves.",
        "The distance is the sum over the bands of the largest distance of the metric in any condition, in widths of "
        "its band: 0 where all are reached.",
        told,
        "The best set is the one with the smallest distance that keeps the constraints and, if one of those nearest "
        "to the bands does, the margins on the whole map; it may reach fewer bands.",
        (),
        [Table("Before and after", ("", "unit", "before", "after"), rows)] if rows else (),
    )


def _band_section(o: Outcome) -> Section:
    units, rows = _units(o), []
    places = dict[str, dict[str, tuple[float, float]]]()
    for name in o.counted:
        low, high = o.problem.bands[name].good
        before, after = _span(o.own, name), _span(o.best, name)
        shown = [f"{number(a)} to {number(b)}" for a, b in (before, after)]
        off = [_off(o, o.own, name), _off(o, o.best, name)]
        rows.append((in_words(name), unit(units[name]), f"{low:g} to {high:g}", shown[0], off[0], shown[1], off[1]))
        if not any(map(math.isnan, (*before, *after))):
            of = {"before": before, "after": after}
            places[in_words(name)] = {
                text: ((a - low) / (high - low), (b - low) / (high - low)) for text, (a, b) in of.items()
            }
    left = [
        (in_words(name), unit(units[name]), f"{o.problem.bands[name].good[0]:g} to {o.problem.bands[name].good[1]:g}",
         *(f"{number(a)} to {number(b)}" for a, b in (_span(o.own, name), _span(o.best, name))), number(o.moved[name]))
        for name in o.problem.bands if name not in o.counted
    ]  # fmt: skip
    head = ["metric", "unit", "good band", "before", "worst before", "after", "worst after"]
    tables = [Table("Metrics over all conditions, before and after", head, rows)]
    if left:
        head = ["metric", "unit", "good band", "before", "after", "moved by at most [widths of the band]"]
        tables.append(Table("Bands that no parameter of the assist moves, left out of the search", head, left))
    levels = ", ".join(c.label for c in o.problem.conditions)
    most = max((check.difference for check in o.checks.values()), default=0.0)
    pictures = (
        [
            Picture(
                tuning_pictures.bands(places),
                "Spans over the conditions, before and after, cut one width outside the band",
            )
        ]
        if places
        else []
    )
    return Section(
        "Bands",
        "Every metric is in its good band, whatever friction and load.",
        "Each set is driven through weave, release, returnability, step steer and parking in the conditions: "
        f"{levels}, with the handwheel angles that the starting point needs; the two sets below once more with those "
        f"that each needs itself, which changes a metric by up to {most:.2g} widths of its band.",
        f"{_reached(o, o.best)} of {len(rows)} bands are reached in all conditions; before {_reached(o, o.own)}.",
        f"A band is left out where no parameter at an end of its range moves the metric by {MOVED:g} of its width.",
        pictures,
        tables,
    )


def _margin_section(o: Outcome) -> Section:
    rows, sides = [], [t.user_attrs["details"]["margins"] for t in (o.own, o.best) if t is not None]
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
    head = ("margin", "speed [km/h]", "unit", "before", "after")[: 3 + len(sides)]
    verdict = "No set keeps the margins."
    if o.best is not None:
        least, below = constraints.least(sides[-1]), margin_map.missed(o.cells)
        verdict = (
            f"The best set keeps {number(least['phase_margin'])} deg and {number(least['gain_margin'])} dB where the "
            f"search looks, and {constraints.PHASE:g} deg and {constraints.GAIN:g} dB at "
            f"{len([c for c in o.cells if c.margins]) - len(below)} of {len([c for c in o.cells if c.margins])} points "
            "of the whole map."
        )
        if below:
            verdict += " It misses: " + "; ".join(c.where for c in below[:4]) + "."
    return Section(
        "Margins",
        f"Phase and gain margin are at least {constraints.PHASE:g} deg and {constraints.GAIN:g} dB at all speeds.",
        "The search looks at the whole laden car with hands off, where its boost is steepest, with friction sliding or "
        "at rest; and at the column with fixed hands at all speeds of the boost table. The sets nearest to the "
        "bands are then read on the whole map of 'steer-env analyse', every torque, hands and friction, unladen and "
        "laden, until one keeps it.",
        verdict,
        "Small motions around a steady point, on a level and dry road.",
        (),
        [Table("Margins, before and after", head, rows)] if rows else (),
    )


def _of_the_map(o: Outcome) -> list[str]:
    """What the sets that were read on the whole map miss there."""
    if below := margin_map.missed(o.cells):
        where = "; ".join(c.where if c.margins and c.margins.stable else f"{c.where} (unstable)" for c in below[:4])
        return [
            f"None of the {len(o.tried)} sets nearest to the bands keeps the margins at every point of the whole map. "
            f"The one here misses {len(below)}: {where}."
        ]
    better = list(itertools.takewhile(lambda pair: o.best is not None and pair[0].params != o.best.params, o.tried))
    if not better:
        return []
    far, where = number(search.total(better[0][0])), better[0][1][0].where
    return [
        f"Sets nearer to the bands are passed over, as they miss a margin on the whole map: {len(better)}, the nearest "
        f"{far} widths off with the starting car's handwheel angles, at {where}."
    ]


def _limits(o: Outcome) -> str:
    """What the numbers of sets say of the verdict."""
    told = (
        f"That {'several optimisers find' if len(o.trials) > 1 else 'one optimiser finds'} nothing is evidence, not a "
        "proof, and the weaker the fewer sets there are. All optimisers begin with the starting point."
    )
    for key, trials in o.trials.items():
        if key.endswith("nsga2") and len(trials) < feasibility.FEW:
            told += (
                f" The {len(trials)} sets of {label(key)}, with {search.POPULATION} in a generation, are its first "
                f"generations only, and confirm little; give a --budget of {feasibility.FEW} or more."
            )
    return told


def build(o: Outcome) -> tuple[Page, dict[str, Any]]:
    """The page and its numbers as JSON."""
    optimisers = " and ".join(f"{label(key)} ({len(trials)})" for key, trials in o.trials.items())
    verdict = feasibility.sentences(o.problem, o.feasibility, _units(o), optimisers)
    alone = o.best is not None and o.own is not None and o.best.params == o.own.params == o.tried[0][0].params
    if alone and not o.feasibility.reached:
        found = "No set that keeps the constraints is better than the starting point, which best.toml has"
        verdict.insert(1, f"{found}: give a larger --budget.")
    if left := [name for name in o.problem.bands if name not in o.counted]:
        verdict.append(f"No parameter of the assist moves {', '.join(map(in_words, left))}: left out.")
    verdict += _of_the_map(o)
    verdict += own_angles.sentences(o.checks)
    shares, gain, limits = tuning_parameters.importances(o), _gain_section(o), _limits(o)
    first = Section(
        "Feasibility",
        "All bands can be reached together.",
        f"All {o.feasibility.sets} different sets of {optimisers}; {o.feasibility.constrained} miss a constraint.",
        verdict[0],
        limits,
        (),
        [
            Table(
                "Bands that are reached one by one but never together",
                ("band", "and band", "off [widths]", "off [widths]"),
                [(*map(in_words, p.metrics), *map(number, p.distances)) for p in o.feasibility.pairs],
                folded=True,
            )
        ]
        if o.feasibility.pairs
        else (),
    )
    others = _pareto_section(o), _band_section(o), tuning_parameters.section(o, shares), _margin_section(o)
    data = {
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
        "map_missed": [c.where for c in margin_map.missed(o.cells)],
        "tried": [{"set": t.number, "parameters": t.params, "missed": [c.where for c in m]} for t, m in o.tried],
        "sets": {
            key: [
                {"parameters": t.params, "objectives": t.user_attrs["objectives"], "kept": search.kept(t)}
                for t in trials
            ]
            for key, trials in o.trials.items()
        },
    }
    lead = f"The assist of '{o.problem.car.name}' tuned to target bands, for the worst of friction and load. "
    lead += gain.verdict
    return Page(NAME, "Tuning of the assist", lead, verdict, [gain, first, *others]), data


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
