"""The last check of a set: driven with the handwheel angles that it needs itself.

A search drives every set with the handwheel angles that the starting car needs, so that a set costs one run. A set
turns in a little more or less with them than a test asks for. Driven with its own angles, it has the metrics that its
car file has in ``steer-env report``.
"""

import copy
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from optuna.trial import FrozenTrial

from steer_env.experiments.calibration import problem as problems
from steer_env.experiments.calibration.feasibility import IN_BAND
from steer_env.experiments.calibration.problem import Evaluation, Problem, distance
from steer_env.experiments.pages.words import label
from steer_env.targets import Band
from steer_env.tuning.reward import MAX_DISTANCE

TITLES = {"start": "the starting point", "best": "the best set"}


class OwnAngles(NamedTuple):
    """What a set's own handwheel angles change."""

    searched: FrozenTrial  # the set with the metrics of the search, which are those with the starting car's angles
    difference: float  # largest change of a metric that counts, in any condition [widths of its band]
    metric: str  # that has it; empty where none changes
    condition: str
    changed: tuple[tuple[str, str, bool], ...]  # metric, condition, and whether it is now in its band


def evaluate_with_own_angles(case: tuple[Problem, Mapping[str, float]]) -> Evaluation:
    """Evaluate a set with its own handwheel angles, where :func:`problem.evaluate` takes those of the starting car.

    Where the car does not reach the lateral acceleration of a test, all metrics are None.
    """
    problem, values = case
    try:
        return problems.evaluate(problem._replace(car=problems.tuned_car_quietly(problem, values)), {})
    except ValueError as error:
        nothing = dict[str, float | None].fromkeys(problem.bands)
        return Evaluation({c.label: nothing for c in problem.conditions}, {}, dict.fromkeys(nothing, str(error)))


def replace_metrics(problem: Problem, counted: Sequence[str], trial: FrozenTrial, found: Evaluation) -> FrozenTrial:
    """A copy of a set with the metrics of an evaluation; its margins and constraints stay."""
    other = copy.copy(trial)
    details = {**trial.user_attrs["details"], "metrics": found.metrics, "refused": found.refused}
    other.user_attrs = {
        **trial.user_attrs,
        "details": details,
        "objectives": list(problems.objectives(problem, found, counted).values()),
        "places": problems.places(problem, found, counted),
    }
    return other


def _change(before: float | None, after: float | None, band: Band) -> float:
    """Change of a metric [widths of its band]; ``MAX_DISTANCE`` where only one of both is refused."""
    known = [x is not None and math.isfinite(x) for x in (before, after)]
    if before is None or after is None or not all(known):
        return MAX_DISTANCE if any(known) else 0.0
    return abs(after - before) / (band.good[1] - band.good[0])


def compare_angles(problem: Problem, counted: Sequence[str], searched: FrozenTrial, checked: FrozenTrial) -> OwnAngles:
    """What differs between a set as the search saw it and the same with its own handwheel angles."""
    before, after = (t.user_attrs["details"]["metrics"] for t in (searched, checked))
    most, changed = (0.0, "", ""), []
    for where in before:
        for name in counted:
            band, values = problem.bands[name], (before[where][name], after[where][name])
            most = max(most, (_change(*values, band), name, where), key=lambda found: found[0])
            was, now = (distance(value, band) <= IN_BAND for value in values)
            if was != now:
                changed.append((name, where, now))
    return OwnAngles(searched, *most, tuple(changed))


def sentences(checks: Mapping[str, OwnAngles]) -> list[str]:
    """One sentence for each set of which a band changes side."""
    told = []
    for key, check in checks.items():
        if check.changed:
            each = (
                f"{label(n)} at {where} {'comes into' if now else 'leaves'} its band" for n, where, now in check.changed
            )
            told.append(
                f"Driven with its own handwheel angles in place of the starting car's, {TITLES[key]} changes by up to "
                f"{check.difference:.2g} widths of a band: {'; '.join(each)}."
            )
    return told


def as_json(checks: Mapping[str, OwnAngles]) -> dict[str, Any]:
    """The changes as JSON, with the metrics of the search."""
    return {
        key: {
            **{name: value for name, value in check._asdict().items() if name != "searched"},
            "searched_metrics": check.searched.user_attrs["details"]["metrics"],
        }
        for key, check in checks.items()
    }
