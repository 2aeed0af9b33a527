"""Search for an assist: the default sampler beside random search, from the same first sets."""

import itertools
import math
import statistics
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from steer_env import targets
from steer_env.experiments.calibration import problem, search, storage, tuning
from steer_env.experiments.calibration.search import Job, WorkerOf
from steer_env.experiments.sweep import Where, run
from steer_env.vehicle import cars
from tests.verification.common.rows import Row, verdict

CAR = "compact"
SEEDS = 10
BUDGET = 60  # sets of each search; the default sampler must be ahead of random search with half of them
SAMPLERS = ("surface", "random")


def rows() -> Iterator[Row]:
    """Distance from the bands of the best set, the sum over objectives [band widths], median and range of the seeds."""
    sweep = partial(run, where=Where.parse())
    posed = problem.make(cars.load(CAR), targets.load(CAR))
    shares = tuning.largest_effects(posed, sweep)
    cases = [
        tuning.make_job(posed, shares, Path(), BUDGET, sampler=name, seed=i) for name in SAMPLERS for i in range(SEEDS)
    ]
    found = sweep(_course, cases)
    courses = dict(zip(SAMPLERS, (found[:SEEDS], found[SEEDS:])))
    aim = statistics.median(course[-1] for course in courses["random"])
    for name, each in courses.items():
        for sets in (BUDGET // 2, BUDGET):
            distances = [course[sets - 1] for course in each]
            middle = statistics.median(distances)
            judged = name == "surface" and sets < BUDGET
            yield Row(
                f"{name}, {sets} sets, {SEEDS} seeds",
                f"{middle:.2f} ({min(distances):.2f} to {max(distances):.2f})",
                f"< {aim:.2f}, of random after {BUDGET}" if judged else "no limit",
                verdict(middle < aim or not judged),
            )


def _course(case: Job) -> list[float]:
    """Distance of the best set that keeps the constraints, after each set of a search [band widths]."""
    with TemporaryDirectory() as out, search.quiet():
        job = case._replace(out=out, stops=False)
        search.work(WorkerOf(job, 0))
        trials = search.finished_sets(search.current(job, storage.open_storage(Path(out), None)))
    distances = (search.total(trial) if search.keeps_constraints(trial) else math.inf for trial in trials)
    return list(itertools.accumulate(distances, min))
