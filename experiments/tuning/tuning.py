"""The whole of a tuning: what the parameters move, the search, and where it fails a second optimiser."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import optuna
from optuna.trial import FrozenTrial

from steer_env.experiments.sweep import Runner
from steer_env.experiments.tuning import constraints, feasibility, search, storage
from steer_env.experiments.tuning import problem as problems
from steer_env.experiments.tuning.feasibility import Feasibility
from steer_env.experiments.tuning.problem import Problem, Range
from steer_env.experiments.tuning.search import Found, Job, WorkerOf

MOVED = 0.15  # part of its band's width by which a metric must move to count as tuned; assumed
SECOND = "nsga2"  # optimiser that confirms
ABOUT = "about"  # name of the study that holds what all share


class Subject(NamedTuple):
    """What a set of the assist is evaluated for."""

    problem: Problem
    counted: tuple[str, ...]  # metrics


class Outcome(NamedTuple):
    """All that a tuning has found."""

    problem: Problem
    counted: tuple[str, ...]
    moved: dict[str, float]  # metric -> largest change by one parameter over its band's width [1]
    own: FrozenTrial | None  # the starting point
    best: FrozenTrial | None  # None where no set keeps the constraints
    trials: dict[str, list[FrozenTrial]]  # optimiser -> its evaluated sets
    ranges: tuple[Range, ...]  # of the last round
    widened: dict[str, tuple[Range, Range]]  # first and last range of those that were widened
    feasibility: Feasibility


def found(subject: Subject, values: Mapping[str, float]) -> Found:
    """Evaluate a set: its objectives, its violations, and metrics and margins as details."""
    evaluation = problems.evaluate(subject.problem, values, every_metric=False)
    objectives = problems.objectives(subject.problem, evaluation, subject.counted)
    places = problems.places(subject.problem, evaluation, subject.counted)
    return Found(
        tuple(objectives.values()), constraints.violations(evaluation.margins), places, dict(evaluation._asdict())
    )


def movement(case: tuple[Problem, dict[str, float]]) -> dict[str, float | None]:
    """The metrics of a set in the first condition."""
    problem, values = case
    one = problem._replace(conditions=problem.conditions[:1])
    return next(iter(problems.evaluate(one, values, every_metric=False).metrics.values()))


def moved(problem: Problem, sweep: Runner) -> dict[str, float]:
    """By how much of its band's width each metric moves at most when one parameter goes to an end of its range [1]."""
    own = problems.own(problem)
    sets = [own, *({**own, r.name: end} for r in problem.ranges for end in (r.low, r.high) if end != r.own)]
    at, *others = sweep(movement, [(problem, values) for values in sets], words=lambda case: "effect of the parameters")
    found = {}
    for name, band in problem.bands.items():
        value = at[name]
        changes = [abs(x[name] - value) for x in others if x[name] is not None and value is not None]  # type: ignore[operator]
        found[name] = max(changes, default=0.0) / (band.good[1] - band.good[0])
    return found


def _about(store: Any) -> optuna.Study | None:
    """The study that holds what all share; one whose maker was killed is deleted."""
    if ABOUT not in [s.study_name for s in store.get_all_studies()]:
        return None
    study = optuna.load_study(study_name=ABOUT, storage=store)
    if "problem" in study.user_attrs:
        return study
    optuna.delete_study(study_name=ABOUT, storage=store)
    return None


def begun(problem: Problem, out: Path, address: str | None, sweep: Runner, resume: bool) -> dict[str, Any]:
    """What all processes of a tuning share, made by the first of them.

    Raises
    ------
    ValueError
        The folder has the study of another problem, or is to be resumed and has none.
    """
    with search.quiet(), storage.alone(out):
        store = storage.opened(out, address)
        if (study := _about(store)) is None:
            if resume:
                raise ValueError(f"{out} has no study that could be resumed: leave --resume out to begin one")
            shares = moved(problem, sweep)
            study = optuna.create_study(storage=store, study_name=ABOUT)
            study.set_user_attr("moved", shares)
            study.set_user_attr("problem", key(problem))  # the last, by which it counts as made
        if study.user_attrs.get("problem") != key(problem):
            raise ValueError(
                f"{out} has the study of another problem (car, targets, friction, parameters, load, or version): give "
                "a new --out, or the options with which it was begun"
            )
        return dict(study.user_attrs["moved"])


def key(problem: Problem) -> str:
    """A text that tells problems apart, ranges included."""
    return problems.digest(problem) + str([r[:6] for r in problem.ranges])


def job_of(
    problem: Problem,
    shares: Mapping[str, float],
    out: Path,
    budget: int,
    address: str | None = None,
    sampler: str = "surface",
    seed: int = 0,
) -> Job:
    """The search of a sampler in a folder, for the metrics whose bands the parameters move (see :func:`moved`)."""
    counted = tuple(name for name in problem.bands if shares[name] >= MOVED)
    objectives = tuple(dict.fromkeys(problem.groups[name] for name in counted))
    subject = Subject(problem, counted)
    return Job(str(out), address, sampler, sampler, seed, budget, subject, found, objectives, problem.ranges)


def tune(
    problem: Problem,
    out: Path,
    budget: int,
    sweep: Runner,
    workers: int = 1,
    address: str | None = None,
    sampler: str = "surface",
    seed: int = 0,
    resume: bool = False,
    second: bool = True,
    began: Callable[[Job], None] = lambda job: None,
) -> Outcome:
    """Tune the assist of a problem in a folder; what the folder holds of it is taken up.

    Parameters
    ----------
    problem : Problem
    out : Path
        Of the journal.
    budget : int
        Sets in all; the second optimiser has as many.
    sweep : Runner
        Where the processes run.
    workers : int
        Number of processes.
    address : str, optional
        Of a database in place of the journal.
    sampler : str
        Of ``search.SAMPLERS``.
    seed : int
    resume : bool
        Whether there must be a study.
    second : bool
        Whether a second optimiser confirms that not everything is reached.
    began : callable
        Is told each job that begins.

    Raises
    ------
    ValueError
        The car's own assist cannot be driven, or the folder holds another problem's study.
    """
    problems.prepared(problem)  # refuses an unstable starting point before anything is written
    out.mkdir(parents=True, exist_ok=True)
    shares = begun(problem, out, address, sweep, resume)
    job = job_of(problem, shares, out, budget, address, sampler, seed)
    counted = job.subject.counted
    trials: dict[str, list[FrozenTrial]] = {}
    last = problem.ranges
    for _ in range(2):
        began(job)
        sweep(search.work, [WorkerOf(job, i) for i in range(workers)], words=lambda case: f"process {case.number}")
        with search.quiet():
            study = search.current(job, storage.opened(out, address))
            trials[job.name] = search.finished(study)
            last = search.ranges(study) if job.widens else last
        if not second or job.name != sampler or search.reached(trials[sampler]):
            break
        other = SECOND if sampler != SECOND else "tpe"
        job = job._replace(name=f"second {other}", sampler=other, seed=seed + 1, ranges=last, widens=False)
    every = [t for each in trials.values() for t in each]
    pairs = {a.name: (a, b) for a, b in zip(problem.ranges, last) if a != b}
    own = next((t for t in every if t.params == problems.own(problem)), None)
    return Outcome(
        problem,
        counted,
        shares,
        own,
        search.best(every),
        trials,
        last,
        pairs,
        feasibility.judge(problem, every, counted),
    )
