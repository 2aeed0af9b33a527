"""The search: processes that take sets from one study, evaluate them, and tell the study what they found.

A study begins with the starting point and a Latin hypercube; then a sampler of Optuna chooses. It goes in rounds: where
the best set of a round lies on a limit of a range, the next round has a wider one and takes all sets with it.

One of the samplers models response surfaces of every metric and constraint. A distance from a band has no slope inside
the band and jumps from one condition to another, but the metrics themselves are smooth in the parameters. So radial
basis functions are fitted to the place of every metric in its band in every condition and to every constraint, and the
next set is the best one of the model within a distance of the best set so far. The distances take turns, from coarse to
fine, as in the stochastic method of Regis and Shoemaker, A stochastic radial basis function method for the global
optimization of expensive functions, INFORMS Journal on Computing 19 (2007).
"""

import math
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import optuna
from numpy.typing import NDArray
from optuna.distributions import BaseDistribution, FloatDistribution
from optuna.samplers import BaseSampler, NSGAIIISampler, NSGAIISampler, RandomSampler, TPESampler
from optuna.search_space import IntersectionSearchSpace
from optuna.study import Study
from optuna.trial import FrozenTrial, Trial, TrialState
from scipy.interpolate import RBFInterpolator
from scipy.stats import qmc

from steer_env.experiments.calibration import storage
from steer_env.experiments.calibration.problem import Range

Array = NDArray[np.float64]

RADII = (1.0, 0.3, 0.15, 0.08, 0.04)  # of the region around the best set, in turns; assumed [widths of the ranges]
CANDIDATES, STAGES = 600, 4  # sets that are tried on the model in each stage; assumed
SMOOTHING = 1e-3  # of the surfaces, as a metric is not quite smooth; assumed
PENALTY = 20.0  # of a modelled violation over a distance of one width; assumed
GUARD = 0.02  # by which the model should keep a constraint, assumed [its limit]
LARGEST_MODELLED_VALUE = 4.0  # places and violations are modelled up to this, assumed [widths of the band, limits]
LEAST_SET_DISTANCE = 1e-3  # least distance between two sets, assumed [widths of the ranges]


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
        surfaces = _surfaces(X, np.clip(Y, -LARGEST_MODELLED_VALUE, LARGEST_MODELLED_VALUE + 1.0).reshape(len(X), -1))
        limits = np.array([list(t.constraints.values()) for t in done])
        walls = _surfaces(_unit(done, spaces), np.clip(limits, -LARGEST_MODELLED_VALUE, 1.0)) if limits.size else None

        def worth(sets: Array) -> Array:
            value = distances(surfaces(sets).reshape(len(sets), *shape))
            if walls is not None:
                value = value + PENALTY * np.maximum(walls(sets) + GUARD, 0.0).sum(axis=1)
            gap = np.abs(sets[:, None, :] - known[None]).max(axis=2).min(axis=1)
            return np.where(gap < LEAST_SET_DISTANCE, math.inf, value)

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


SAMPLERS = ("surface", "tpe", "nsga2", "nsga3", "random")
SEVERAL = ("nsga2", "nsga3")  # that take the objectives one by one, the others their sum
FIRST = 16  # sets at the beginning, the starting point among them; assumed
FIRST_SET_RANGE = 0.5  # part of the ranges, around the starting point, that the first sets cover; assumed
POPULATION = 24  # of NSGA-II and NSGA-III, assumed
CHECKS = (1.0 / 3.0, 2.0 / 3.0)  # parts of the budget at which ranges may be widened
ON_LIMIT = 0.03  # distance of the best set from the end of a range that counts as on it, over its width; assumed
WIDER = 0.5  # by which a range is widened at that end, over its width; assumed
WAIT = 0.2  # between looks whether another process has finished [s]


class SetResult(NamedTuple):
    """What a set is worth."""

    objectives: tuple[float, ...]  # distances, 0 where everything is in its band
    violations: dict[str, float]  # by constraint, 0 or less where it is kept
    places: list[list[float | None]]  # of each metric in each condition: 0 at the lower end of its band, 1 at the upper
    details: dict[str, Any]  # as JSON holds them


class Job(NamedTuple):
    """A study to be worked on; what workers take."""

    out: str  # folder
    address: str | None  # of a database
    name: str  # of the study
    sampler: str  # one of SAMPLERS
    seed: int
    budget: int  # sets in all
    subject: Any  # what ``evaluate`` takes beside the values
    evaluate: Callable[[Any, Mapping[str, float]], SetResult]  # of the subject and a set
    objectives: tuple[str, ...]
    ranges: tuple[Range, ...]  # of the first round
    widens: bool = True
    stops: bool = True  # once a set has all objectives at 0


class WorkerOf(NamedTuple):
    """One of the processes of a job."""

    job: Job
    number: int


def distributions(ranges: tuple[Range, ...]) -> dict[str, BaseDistribution]:
    """The ranges as Optuna has them."""
    return {r.name: FloatDistribution(r.low, r.high, log=r.logarithmic) for r in ranges}


def keeps_constraints(trial: FrozenTrial) -> bool:
    """Whether a finished set keeps all constraints."""
    return max(trial.constraints.values(), default=0.0) <= 0.0


def total(trial: FrozenTrial) -> float:
    """Sum of the objectives [1]."""
    return float(sum(trial.user_attrs["objectives"]))


def _sampler_values(job: Job, objectives: tuple[float, ...]) -> list[float]:
    """What the sampler is told."""
    return list(objectives) if job.sampler in SEVERAL else [sum(objectives)]


def finished_sets(study: Study) -> list[FrozenTrial]:
    """The evaluated sets in their order."""
    return study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))


def rank(trials: list[FrozenTrial]) -> list[FrozenTrial]:
    """The sets that keep the constraints by the sum of their objectives, the smallest first."""
    return sorted(filter(keeps_constraints, trials), key=lambda t: (total(t), t.number))


def best(trials: list[FrozenTrial]) -> FrozenTrial | None:
    """The set that keeps the constraints with the smallest sum of the objectives, the first of equals."""
    return next(iter(rank(trials)), None)


def count(job: Job, store: Any) -> int:
    """Number of the evaluated sets of a study, of which there may be none yet."""
    names = _names(job, store)
    return len(finished_sets(optuna.load_study(study_name=names[-1], storage=store))) if names else 0


def _sampler(job: Job, number: int = 0, known: int = 0) -> BaseSampler:
    """The sampler of a job for a process or round and so many sets; each has a sequence of its own."""
    seed = int(np.random.SeedSequence([job.seed, number, known]).generate_state(1)[0])
    if job.sampler == "surface":
        return ResponseSurfaces(seed)
    if job.sampler == "tpe":
        return TPESampler(n_startup_trials=FIRST, multivariate=True, constant_liar=True, seed=seed)
    if job.sampler == "nsga2":
        return NSGAIISampler(population_size=POPULATION, seed=seed)
    if job.sampler == "nsga3":
        return NSGAIIISampler(population_size=POPULATION, seed=seed)
    return RandomSampler(seed=seed)


@contextmanager
def quiet() -> Iterator[None]:
    """Optuna without its log and without its warnings of what is experimental."""
    before = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        try:
            yield
        finally:
            optuna.logging.set_verbosity(before)


def _first_sets(ranges: tuple[Range, ...], seed: int, count: int) -> list[dict[str, float]]:
    """The starting point, and a Latin hypercube around it."""
    sets = [{r.name: r.own for r in ranges}]
    for row in qmc.LatinHypercube(len(ranges), rng=seed).random(max(count - 1, 0)).tolist():
        values = {}
        for r, u in zip(ranges, row):
            low, high, own = _scale(r, r.low), _scale(r, r.high), _scale(r, r.own)
            x = min(max(own + FIRST_SET_RANGE * (u - 0.5) * (high - low), low), high)
            values[r.name] = min(max(math.exp(x) if r.logarithmic else x, r.low), r.high)
        sets.append(values)
    return sets


def _scale(r: Range, value: float) -> float:
    """A value on the scale on which its parameter is searched."""
    return math.log(value) if r.logarithmic else value


def _names(job: Job, store: Any) -> list[str]:
    """Names of the rounds of a study that are there, in their order."""
    there = [s.study_name for s in store.get_all_studies() if s.study_name.rpartition("-")[0] == job.name]
    return sorted(there, key=lambda name: int(name.rpartition("-")[2]))


def studies(store: Any) -> dict[str, Study]:
    """The latest whole round of every study by the study's name, in the order in which they were begun."""
    found = dict[str, Study]()
    for each in sorted(store.get_all_studies()):
        study = optuna.load_study(study_name=each.study_name, storage=store)
        if study.user_attrs.get("whole"):
            found[each.study_name.rpartition("-")[0]] = study
    return found


def current(job: Job, store: Any, number: int = 0) -> Study:
    """The latest round of a study, which is made if there is none; one process at a time."""
    for name in reversed(_names(job, store)):
        study = optuna.load_study(study_name=name, storage=store)
        if study.user_attrs.get("whole"):
            # Sets of killed processes do not count, as they are tried again: the seeds are those without the kill.
            known = [t for t in study.get_trials(deepcopy=False) if t.state is not TrialState.FAIL]
            study.sampler = _sampler(job, number, len(known))
            return study
        optuna.delete_study(study_name=name, storage=store)  # its maker was killed before it had all sets
    study = _create_round(job, store, 1, job.ranges)
    for values in _first_sets(job.ranges, job.seed, min(FIRST, 1 + job.budget // 3)):
        study.enqueue_trial(values)
    study.set_user_attr("whole", True)
    return study


def _create_round(job: Job, store: Any, number: int, ranges: tuple[Range, ...]) -> Study:
    """A new round of a study, with as many directions as numbers that its sampler is told of a set."""
    study = optuna.create_study(
        storage=store,
        study_name=f"{job.name}-{number}",
        directions=["minimize"] * len(_sampler_values(job, (0.0,) * len(job.objectives))),
        sampler=_sampler(job),
    )
    study.set_user_attr("ranges", [r._asdict() for r in ranges])
    return study


def ranges(study: Study) -> tuple[Range, ...]:
    """The ranges of a round."""
    return tuple(Range(**{**row, "limits": tuple(row["limits"])}) for row in study.user_attrs["ranges"])


def common_ranges(every: Iterable[tuple[Range, ...]]) -> tuple[Range, ...]:
    """The ranges that hold those of several studies."""
    columns = zip(*every)
    return tuple(rs[0]._replace(low=min(r.low for r in rs), high=max(r.high for r in rs)) for rs in columns)


def widen_ranges(given: tuple[Range, ...], values: Mapping[str, float]) -> tuple[Range, ...]:
    """The ranges, wider at the ends on which a set lies, as far as a parameter may go."""
    found = []
    for r in given:
        at_low, at_high = on_limit(r, values[r.name])
        low, high = _scale(r, r.low), _scale(r, r.high)
        more = WIDER * (high - low)
        if at_low:
            end = math.exp(low - more) if r.logarithmic else low - more
            r = r._replace(low=max(end, r.limits[0]))
        if at_high:
            end = math.exp(high + more) if r.logarithmic else high + more
            r = r._replace(high=min(end, r.limits[1]))
        found.append(r)
    return tuple(found)


def on_limit(r: Range, value: float) -> tuple[bool, bool]:
    """Whether a value lies on the lower and on the upper end of a range."""
    low, high, x = (_scale(r, each) for each in (r.low, r.high, value))
    near = ON_LIMIT * (high - low)
    return x - low < near, high - x < near


def _widening_due(budget: int, checked: int, done: int) -> bool:
    """Whether a part of the budget at which ranges may be widened lies between two numbers of sets."""
    return any(checked < part * budget <= done for part in CHECKS)


def _next_round(job: Job, study: Study, store: Any, done: list[FrozenTrial]) -> Study:
    """The next round where the best set lies on a limit; else the same one, whose ranges are checked now."""
    leader, given = best(done), ranges(study)
    if leader is None or (wider := widen_ranges(given, leader.params)) == given:
        study.set_user_attr("checked", len(done))
        return study
    number = int(study.study_name.rpartition("-")[2]) + 1
    following = _create_round(job, store, number, wider)
    for trial in done:
        following.add_trial(
            optuna.trial.create_trial(
                values=trial.values,
                params=trial.params,
                distributions=distributions(wider),
                user_attrs=trial.user_attrs,
                system_attrs=trial.system_attrs,
            )
        )
    for trial in study.get_trials(deepcopy=False, states=(TrialState.WAITING,)):
        following.enqueue_trial(trial.system_attrs["fixed_params"], trial.user_attrs)
    following.set_user_attr("checked", len(done))
    following.set_user_attr("whole", True)
    following.sampler = _sampler(job, number, len(done))
    return following


def _next(job: Job, store: Any, number: int, process: str) -> tuple[Study, Trial] | None:
    """A set to evaluate; None where the budget is spent or everything is reached."""
    out = Path(job.out)
    while True:
        with storage.exclusive_folder(out):
            study = current(job, store, number)
            storage.requeue_abandoned(study, out)
            done, open_sets = finished_sets(study), study.get_trials(deepcopy=False, states=(TrialState.RUNNING,))
            # Sets of machines that cannot be seen from here count as spent, and nothing waits for them.
            running, lost = len(open_sets), sum(storage.is_on_other_machine(out, trial) for trial in open_sets)
            spent, awaited = len(done) + lost, running > lost
            if spent >= job.budget or (job.stops and bands_reached(done)):
                return None
            due = job.widens and _widening_due(job.budget, study.user_attrs.get("checked", 0), len(done))
            if due and not awaited:
                study = _next_round(job, study, store, done)
            if len(done) + running < job.budget and not (due and awaited):
                trial = study.ask(distributions(ranges(study)))
                trial.set_user_attr("process", process)
                return study, trial
        time.sleep(WAIT)  # another process has the last sets, and may be killed


def bands_reached(trials: list[FrozenTrial]) -> bool:
    """Whether a set keeps the constraints with all objectives at 0."""
    leader = best(trials)
    return leader is not None and total(leader) <= 0.0


def work(case: WorkerOf) -> int:
    """Evaluate sets of a study until its budget is spent; returns how many this process evaluated."""
    job, number = case
    out, count = Path(job.out), 0
    with quiet(), storage.Process(out) as process:
        store = storage.open_storage(out, job.address)
        while (given := _next(job, store, number, process.name)) is not None:
            study, trial = given
            start = time.monotonic()
            try:
                found = job.evaluate(job.subject, trial.params)
            except Exception:
                study.tell(trial, state=TrialState.FAIL)
                raise
            for key, value in found.violations.items():
                trial.set_constraint(key, value)
            trial.set_user_attr("details", found.details)
            trial.set_user_attr("places", found.places)
            trial.set_user_attr("seconds", round(time.monotonic() - start, 3))
            trial.set_user_attr("objectives", list(found.objectives))
            study.tell(trial, _sampler_values(job, found.objectives))
            count += 1
    return count
