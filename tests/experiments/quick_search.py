"""A search that is quick: two bands of which one parameter reaches one each; run as a program, it is a process of it.

python -m tests.experiments.quick_search OUT BUDGET SECONDS [SAMPLER HANGS]

where it hangs at its set of number HANGS, to be killed there.
"""

import itertools
import sys
import time

from steer_env.experiments.calibration import search
from steer_env.experiments.calibration.problem import Range
from steer_env.experiments.calibration.search import Job, SetResult, WorkerOf

RANGES = (
    Range("x", "1", 0.0, 1.0, 0.9, False, (0.0, 8.0)),
    Range("y", "1", 0.1, 10.0, 1.0, True, (0.01, 10.0)),
)


def evaluate(seconds, values):
    """Distances from x = 2, beyond its range, and from y = 3, where x + y must be at most 20."""
    time.sleep(seconds)
    x, y = values["x"], values["y"]
    return SetResult((abs(x - 2.0), abs(y - 3.0)), {"sum": x + y - 20.0}, [[x - 2.0], [y - 3.0]], {"metrics": {}})


def job(out, budget, seconds=0.0, **options):
    """The job in a folder."""
    given = {"address": None, "name": "surface", "sampler": "surface", "seed": 0, **options}
    return Job(
        str(out), budget=budget, subject=seconds, evaluate=evaluate, objectives=("a", "b"), ranges=RANGES, **given
    )


def hanging(number):
    """An evaluation that hangs at the set of a number, counted from 1."""
    numbers = itertools.count(1)
    return lambda seconds, values: evaluate(60.0 if next(numbers) == number else seconds, values)


if __name__ == "__main__":
    out, budget, seconds, sampler, hangs = [*sys.argv[1:], "surface", "0"][:5]
    one = job(out, int(budget), float(seconds), name=sampler, sampler=sampler)
    print(search.work(WorkerOf(one._replace(evaluate=hanging(int(hangs))), 1)))
