"""The section of a tuning's page about the tuned parameters: values, ranges and importances."""

import functools
import math
import warnings
from collections.abc import Mapping

import optuna
from optuna.importance import PedAnovaImportanceEvaluator, get_param_importances
from optuna.trial import FrozenTrial

from steer_env.experiments.calibration import feasibility, search
from steer_env.experiments.calibration import problem as problems
from steer_env.experiments.calibration.problem import Range
from steer_env.experiments.calibration.tuning import Outcome
from steer_env.experiments.pages import tuning_pictures
from steer_env.experiments.pages.study_page import Picture, Section, Table
from steer_env.experiments.pages.words import label as in_words
from steer_env.experiments.pages.words import number, unit


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


def section(o: Outcome, shares: Mapping[str, Mapping[str, float]]) -> Section:
    """The section of the page, with the shares of :func:`importances`."""
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
    told = "No range was widened."
    if o.widened:
        told = f"Ranges were widened where an optimum lay on their limit: {', '.join(map(in_words, o.widened))}."
    if ends:
        told += f" The best set lies on a limit of {', '.join(map(in_words, ends))}: a larger --budget may widen these."
    count = sum(map(len, o.trials.values()))
    few = f", and {count} sets show little of them" if count < feasibility.FEW else ""
    pictures = []
    if shares:  # an objective without bands, or the same in every set, has none
        named = {group: {in_words(name): x for name, x in each.items()} for group, each in shares.items()}
        drawn = tuning_pictures.importances(named, [in_words(r.name) for r in o.ranges])
        pictures = [Picture(drawn, "Importances by objective")]
    return Section(
        "Parameters",
        "The parameters that matter, and their ranges.",
        "The importance is that of PED-ANOVA over all evaluated sets: how far the better sets of an objective differ "
        "from all sets in a parameter.",
        told,
        f"Importances hold for the ranges that were searched{few}. A range is widened only as far as the assist "
        "accepts.",
        pictures,
        [Table("Parameters", ("parameter", "unit", "before", "after", "range", ""), rows)],
    )
