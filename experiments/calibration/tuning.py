"""The whole of a tuning: what the parameters move, the search, and if asked a second optimiser where it fails.

A folder or database has one problem and any number of studies of it, one for each optimiser. What is found is found
of all their sets.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import optuna
from optuna.trial import FrozenTrial

from steer_env.experiments.calibration import constraints, feasibility, margin_map, own_angles, search, storage
from steer_env.experiments.calibration import problem as problems
from steer_env.experiments.calibration.feasibility import Feasibility
from steer_env.experiments.calibration.margin_map import Cell
from steer_env.experiments.calibration.own_angles import OwnAngles
from steer_env.experiments.calibration.pace import Pace
from steer_env.experiments.calibration.problem import Evaluation, Problem, Range
from steer_env.experiments.calibration.search import Job, SetResult, WorkerOf
from steer_env.experiments.sweep import Runner
from steer_env.friction.numerics import cache
from steer_env.tuning.reward import MAX_DISTANCE
from steer_env.vehicle import cars
from steer_env.vehicle.cars import Car

MAPS = 8  # sets at most that are read on the whole map, until one keeps all of it; assumed
MOVED = 0.15  # part of its band's width by which a metric must move to count as tuned; assumed
EVALUATION = 2  # raised where the evaluation of a set changes, so that a folder's sets are all of one kind
MAP_MISSED = 0.1  # violation of a set that misses a margin on the map; its negative where it is kept or unread; assumed
DIGITS = 4  # significant ones of what is tuned, in the file of the best car [1]
SECOND = "nsga2"  # optimiser that confirms
SHARED_STUDY = "about"  # name of the study that holds what all share
OWN_ANGLES = "check with own handwheel angles"
LAST = {"map": 1, "check": 1}  # pieces of work that follow a search


class Subject(NamedTuple):
    """What a set of the assist is evaluated for."""

    problem: Problem
    counted: tuple[str, ...]  # metrics


class Start(NamedTuple):
    """What is known of the starting point before the search."""

    driven: Evaluation  # with its own handwheel angles
    cells: list[Cell]  # margins at every point of the map, with every load


class Outcome(NamedTuple):
    """All that a tuning has found."""

    problem: Problem
    counted: tuple[str, ...]
    moved: dict[str, float]  # metric -> largest change by one parameter over its band's width [1]
    own: FrozenTrial | None  # the starting point, driven with its own handwheel angles
    best: FrozenTrial | None  # with its own handwheel angles, too; None where no set keeps the constraints
    checks: dict[str, OwnAngles]  # what their own handwheel angles change, of "start" and "best"
    trials: dict[str, list[FrozenTrial]]  # study -> its evaluated sets, of all studies in the folder
    ranges: tuple[Range, ...]  # that hold the sets of all studies
    widened: dict[str, tuple[Range, Range]]  # first and last range of those that were widened
    feasibility: Feasibility
    cells: list[Cell]  # margins of the best at every point of the map, with every load
    start_cells: list[Cell]  # of the starting point
    tried: list[tuple[FrozenTrial, list[Cell]]]  # sets nearest to the bands, and where on the map each misses a margin


def evaluate_set(subject: Subject, values: Mapping[str, float]) -> SetResult:
    """Evaluate a set: its objectives, its violations, and metrics and margins as details."""
    evaluation = problems.evaluate(subject.problem, values, every_metric=False)
    objectives = problems.objectives(subject.problem, evaluation, subject.counted)
    places = problems.places(subject.problem, evaluation, subject.counted)
    violations = constraints.violations(evaluation.margins)
    # Only a set that would end the search is read on the whole map here: that takes as long as several sets.
    ends = max(*objectives.values(), *violations.values()) <= 0.0
    misses = ends and margin_map.cells_below_limits(map_margins((subject.problem, values)))
    violations["whole_map"] = MAP_MISSED if misses else -MAP_MISSED
    return SetResult(tuple(objectives.values()), violations, places, dict(evaluation._asdict()))


def set_metrics(case: tuple[Problem, dict[str, float]]) -> dict[str, float | None]:
    """The metrics of a set in the first condition."""
    problem, values = case
    one = problem._replace(conditions=problem.conditions[:1])
    return next(iter(problems.evaluate(one, values, every_metric=False).metrics.values()))


def largest_effects(problem: Problem, sweep: Runner) -> dict[str, float]:
    """By how much of its band's width each metric moves at most when one parameter goes to an end of its range [1]."""
    own = problems.own_values(problem)
    sets = [own, *({**own, r.name: end} for r in problem.ranges for end in (r.low, r.high) if end != r.own)]
    at, *others = sweep(
        set_metrics, [(problem, values) for values in sets], words=lambda case: "effect of the parameters"
    )
    found = {}
    for name, band in problem.bands.items():
        value = at[name]
        changes = [abs(x[name] - value) for x in others if x[name] is not None and value is not None]  # type: ignore[operator]
        found[name] = max(changes, default=0.0) / (band.good[1] - band.good[0])
        if value is None and any(x[name] is not None for x in others):
            found[name] = MAX_DISTANCE  # a parameter decides whether the test can be driven at all
    return found


def _finished_shared_study(store: Any) -> optuna.Study | None:
    """The study that holds what all share, if its maker has finished it."""
    if SHARED_STUDY not in [s.study_name for s in store.get_all_studies()]:
        return None
    study = optuna.load_study(study_name=SHARED_STUDY, storage=store)
    return study if "problem" in study.user_attrs else None


def _require_begun(out: Path, address: str | None) -> None:
    """Refuse to resume where there is nothing, before anything is written."""
    with search.quiet():
        if not storage.study_exists(out, address) or _finished_shared_study(storage.open_storage(out, address)) is None:
            place = out if address is None else address
            raise ValueError(f"{place} has no study that could be resumed: leave --resume out to begin one")


def begin_studies(problem: Problem, out: Path, address: str | None, sweep: Runner) -> dict[str, Any]:
    """What all processes of a tuning share, made by the first of them.

    Raises
    ------
    ValueError
        The folder has the study of another problem.
    """
    with search.quiet(), storage.exclusive_folder(out):
        store = storage.open_storage(out, address)
        if (study := _finished_shared_study(store)) is None:
            with suppress(KeyError):  # one whose maker was killed
                optuna.delete_study(study_name=SHARED_STUDY, storage=store)
            shares = largest_effects(problem, sweep)
            study = optuna.create_study(storage=store, study_name=SHARED_STUDY)
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
    return f"{EVALUATION} {problems.digest(problem)}" + str([r[:6] for r in problem.ranges])


def make_job(
    problem: Problem,
    shares: Mapping[str, float],
    out: Path,
    budget: int,
    address: str | None = None,
    sampler: str = "surface",
    seed: int = 0,
) -> Job:
    """The search of a sampler in a folder, for the metrics that the parameters move (:func:`largest_effects`)."""
    counted = tuple(name for name in problem.bands if shares[name] >= MOVED)
    objectives = tuple(dict.fromkeys(problem.groups[name] for name in counted))
    subject = Subject(problem, counted)
    return Job(str(out), address, sampler, sampler, seed, budget, subject, evaluate_set, objectives, problem.ranges)


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
    confirm: bool = False,
    began: Callable[[Job], None] = lambda job: None,
    pace: Pace | None = None,
) -> Outcome:
    """Tune the assist of a problem in a folder; the outcome is that of all studies that the folder has of it.

    Parameters
    ----------
    problem : Problem
    out : Path
        Of the journal.
    budget : int
        Finished sets of this sampler's study, those before included; sets of other samplers do not count. The second
        optimiser has as many.
    sweep : Runner
        Where the processes run.
    workers : int
        Number of processes.
    address : str, optional
        Of a database in place of the journal.
    sampler : str
        Of ``search.SAMPLERS``.
    seed : int
        Of the sets that are new; a study that has begun keeps its sets.
    resume : bool
        Whether there must be a study.
    confirm : bool
        Whether a second optimiser searches, too, where not everything is reached.
    began : callable
        Is told each job that begins.
    pace : Pace, optional
        Is told each phase that begins.

    Raises
    ------
    ValueError
        The car's own assist cannot be driven, the folder holds another problem's study, or is to be resumed and has
        none.
    """
    if resume:
        _require_begun(out, address)
    pace = pace or Pace()
    pace.begin("effect", "effect of the parameters", {})
    problems.prepare_problem(problem)  # refuses an unstable starting point before anything is written
    out.mkdir(parents=True, exist_ok=True)
    shares = begin_studies(problem, out, address, sweep)
    if max(shares.values()) < MOVED:
        raise ValueError(
            f"no parameter of {', '.join(r.name for r in problem.ranges)} moves a metric by {MOVED:g} of its band's "
            "width: name others with --parameters, or other targets, with a new --out"
        )
    job = make_job(problem, shares, out, budget, address, sampler, seed)
    start = _start(problem, sweep, pace)
    for again in (confirm, False):
        pace.begin("set", job.name, LAST | ({"set": budget} if again else {}), budget)
        began(job)
        sweep(search.work, [WorkerOf(job, i) for i in range(workers)], words=lambda case: f"process {case.number}")
        with search.quiet():
            studies = search.studies(storage.open_storage(out, address))
            every = {name: search.finished_sets(study) for name, study in studies.items()}
            trials = {name: sets for name, sets in every.items() if sets}  # one that has just begun has none
            given = {name: search.ranges(study) for name, study in studies.items()}
        if not again or search.bands_reached([t for each in trials.values() for t in each]):
            break
        other = SECOND if sampler != SECOND else "tpe"
        job = job._replace(name=f"second {other}", sampler=other, seed=seed + 1, ranges=given[sampler], widens=False)
    return _outcome(job.subject, shares, trials, search.common_ranges(given.values()), start, sweep, pace)


def _start(problem: Problem, sweep: Runner, pace: Pace) -> Start:
    """The starting point, read on the whole map and driven with its own handwheel angles before the search."""
    case = (problem, problems.own_values(problem))
    pace.begin("check", OWN_ANGLES, {})
    ((driven, compiled),) = sweep(
        _time_compiling, [(own_angles.evaluate_with_own_angles, case)], words=lambda job: OWN_ANGLES
    )
    pace.end(compiled)
    pace.begin("map", "margin map of the starting point", {})
    ((cells, compiled),) = sweep(
        _time_compiling, [(map_margins, case)], words=lambda job: "margin map of the starting point"
    )
    pace.end(compiled)
    # A set of the search has all functions, and the more of them the longer its map takes.
    middle = problems.tuned_car_quietly(problem, {r.name: 0.5 * (r.low + r.high) for r in problem.ranges})
    each = [margin_map.seconds(car, problem.law, problem.chassis) for car in (problem.car, middle)]
    pace.scale("map", each[1] / each[0])
    return Start(driven, cells)


def _time_compiling(job: tuple[Callable[[Any], Any], Any]) -> tuple[Any, float]:
    """What a worker's function gives for a case, and the time that it spent on compiling [s]."""
    work, case = job
    before = cache.compile_seconds()
    return work(case), cache.compile_seconds() - before


def map_margins(case: tuple[Problem, Mapping[str, float]], points: Sequence[Cell] | None = None) -> list[Cell]:
    """The margins of a set at every point of the map, with every load, or at the points of other cells."""
    problem, values = case
    car = _rounded_quietly(problem, values)
    if points is not None:
        return margin_map.map_points(points, car, problem.law, problem.chassis)
    loads = tuple(dict.fromkeys(c.load for c in problem.conditions))
    return margin_map.of_car(car, problem.law, loads, problem.chassis)


def rounded(problem: Problem, values: Mapping[str, float]) -> Car:
    """The car of a set as its file has it: what differs from the starting car has ``DIGITS`` digits."""
    car = problems.tuned_car(problem, values)
    if values == problems.own_values(problem):
        return car
    start, own = problem.car.data()["assist"], car.data()["assist"]
    return cars.load(car, changes={f"assist.{k}": _rounded(x) for k, x in own.items() if x != start.get(k)})


def _rounded(value: Any) -> Any:
    """A number, or those of a table, with ``DIGITS`` significant digits."""
    if isinstance(value, list):
        return [_rounded(each) for each in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def _rounded_quietly(problem: Problem, values: Mapping[str, float]) -> Car:
    """:func:`rounded` without its warnings, which are told where its file is written."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cars.UnusualCar)
        return rounded(problem, values)


def _driven(case: tuple[Problem, Mapping[str, float]]) -> Evaluation:
    """The rounded car of a set with its own handwheel angles."""
    problem, values = case
    return own_angles.evaluate_with_own_angles((problem._replace(car=_rounded_quietly(problem, values)), {}))


def _misses(cells: list[Cell]) -> tuple[int, int]:
    """Number of the unstable points of a map, and of all that miss a margin."""
    missed = margin_map.cells_below_limits(cells)
    return sum(not c.margins.stable for c in missed if c.margins), len(missed)


def _safest(
    problem: Problem, ranked: Sequence[FrozenTrial], sweep: Runner, pace: Pace
) -> tuple[FrozenTrial | None, list[Cell], list[tuple[FrozenTrial, list[Cell]]]]:
    """The first set that keeps the whole map, its map, and what each set misses that was tried.

    Near the best set others are like it: a set is first read where those before it missed a margin, which takes little.
    If none keeps the map, it is the one of ``MAPS`` whole maps with the fewest unstable points, then misses.
    """
    tried, whole = list[tuple[FrozenTrial, list[Cell]]](), list[tuple[FrozenTrial, list[Cell]]]()
    known = list[Cell]()
    for trial in ranked:
        case = (problem, trial.params)
        misses = margin_map.cells_below_limits(map_margins(case, known))
        if not misses:
            pace.begin("map", f"margin map {len(whole) + 1}", {"check": 1})
            (cells,) = sweep(map_margins, [case], words=lambda case: "margin map")
            misses = margin_map.cells_below_limits(cells)
            whole.append((trial, cells))
            known += misses
        tried.append((trial, misses))
        if not misses or len(whole) == MAPS:
            break
    if not whole:
        return None, [], []
    return *min(whole, key=lambda pair: _misses(pair[1])), tried


def _outcome(
    subject: Subject,
    shares: dict[str, float],
    trials: dict[str, list[FrozenTrial]],
    ranges: tuple[Range, ...],
    start: Start,
    sweep: Runner,
    pace: Pace,
) -> Outcome:
    """What the sets of all studies show; the best of them is driven once more."""
    problem, counted = subject
    distinct = dict[tuple[tuple[str, float], ...], FrozenTrial]()  # studies may have sets in common
    for t in chain(*trials.values()):
        distinct.setdefault(tuple(sorted(t.params.items())), t)
    every = list(distinct.values())
    own = next((t for t in every if t.params == problems.own_values(problem)), None)
    leader, cells, tried = _safest(problem, search.rank(every), sweep, pace)
    named = {key: t for key, t in (("start", own), ("best", leader)) if t is not None}
    driven = {"start": start.driven}
    if leader is not None:
        pace.begin("check", OWN_ANGLES, {})
        (driven["best"],) = sweep(_driven, [(problem, leader.params)], words=lambda case: OWN_ANGLES)
    checked = {key: own_angles.replace_metrics(problem, counted, t, driven[key]) for key, t in named.items()}
    checks = {key: own_angles.compare_angles(problem, counted, t, checked[key]) for key, t in named.items()}
    if leader is not None:  # its margins are those of the rounded car, too
        checked["best"].user_attrs["details"]["margins"] = driven["best"].margins
    best = checked.get("best")
    judged = feasibility.judge(problem, [best if best and t is named["best"] else t for t in every], counted)
    if best is not None:  # by its own angles it may no longer be first
        far = feasibility.distances(problem, best, counted)
        missed = tuple(name for name in counted if far[name] > feasibility.IN_BAND)
        judged = judged._replace(missed=missed, reached=not missed and not margin_map.cells_below_limits(cells))
    widened = {a.name: (a, b) for a, b in zip(problem.ranges, ranges) if a != b}
    own, seen = checked.get("start"), (trials, ranges, widened, judged)
    return Outcome(problem, counted, shares, own, best, checks, *seen, cells, start.cells, tried)
