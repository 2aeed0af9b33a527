"""Search for an assist: the default sampler beside random search, from the same first sets."""

import itertools
import math
import statistics
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from steer_env import targets
from steer_env.experiments.sweep import Where, run
from steer_env.experiments.tuning import problem, search, storage, tuning
from steer_env.experiments.tuning.search import Job, WorkerOf
from steer_env.experiments.verification.requirements.common.rows import Row, verdict
from steer_env.vehicle import cars

CAR = "compact"
SEEDS = 10
BUDGET = 60  # sets of each search
SHARE = 0.5  # largest part of random search's sets that the default sampler may need
SAMPLERS = ("surface", "random")


def rows(seeds: int = SEEDS, budget: int = BUDGET) -> Iterator[Row]:
    """Sets until the default sampler comes as near to the bands as random search ends in the median."""
    sweep = partial(run, where=Where.parse())
    posed = problem.make(cars.load(CAR), targets.load(CAR))
    shares = tuning.moved(posed, sweep)
    cases = [
        tuning.job_of(posed, shares, Path(), budget, sampler=name, seed=i) for i in range(seeds) for name in SAMPLERS
    ]
    courses = dict(zip([(case.seed, case.sampler) for case in cases], sweep(_course, cases)))
    ends = {name: [courses[i, name][-1] for i in range(seeds)] for name in SAMPLERS}
    level = statistics.median(ends["random"])
    for name in SAMPLERS:
        middle, low, high = statistics.median(ends[name]), min(ends[name]), max(ends[name])
        found = f"{middle:.2f} band widths ({low:.2f} to {high:.2f})"
        yield Row(f"distance from the bands after {budget} sets, {name}, {seeds} seeds", found, "no limit", "pass")
    sets = {name: [until(courses[i, name], level) for i in range(seeds)] for name in SAMPLERS}
    surface, random = (statistics.median(sets[name]) for name in SAMPLERS)
    what = f"sets until {level:.2f} band widths, surface, median"
    aim = f"<= {SHARE:g} x {random:g} of random search"
    yield Row(
        what, f"{surface:g} ({min(sets['surface'])} to {max(sets['surface'])})", aim, verdict(surface <= SHARE * random)
    )


def until(course: list[float], level: float) -> int:
    """Number of sets until the distance of the best one is at most a level; all of them where it never is."""
    return next((i for i, distance in enumerate(course, 1) if distance <= level), len(course))


def _course(case: Job) -> list[float]:
    """Distance of the best set that keeps the constraints, after each set of a search [band widths]."""
    with TemporaryDirectory() as out, search.quiet():
        job = case._replace(out=out)
        search.work(WorkerOf(job, 0))
        trials = search.finished(search.current(job, storage.opened(Path(out), None)))
    distances = (search.total(trial) if search.kept(trial) else math.inf for trial in trials)
    return list(itertools.accumulate(distances, min))
