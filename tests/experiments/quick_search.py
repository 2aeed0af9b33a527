"""A search that is quick: two bands of which one parameter reaches one each; run as a program, it is a process of it.

python -m tests.experiments.quick_search OUT BUDGET SECONDS
"""

import sys
import time

from steer_env.experiments.tuning import search
from steer_env.experiments.tuning.problem import Range
from steer_env.experiments.tuning.search import Found, Job, WorkerOf

RANGES = (
    Range("x", "1", 0.0, 1.0, 0.9, False, (0.0, 8.0)),
    Range("y", "1", 0.1, 10.0, 1.0, True, (0.01, 10.0)),
)


def evaluate(seconds, values):
    """Distances from x = 2, beyond its range, and from y = 3, where x + y must be at most 20."""
    time.sleep(seconds)
    x, y = values["x"], values["y"]
    return Found((abs(x - 2.0), abs(y - 3.0)), {"sum": x + y - 20.0}, [[x - 2.0], [y - 3.0]], {"metrics": {}})


def job(out, budget, seconds=0.0, **options):
    """The job in a folder."""
    given = {"address": None, "name": "surface", "sampler": "surface", "seed": 0, **options}
    return Job(
        str(out), budget=budget, subject=seconds, evaluate=evaluate, objectives=("a", "b"), ranges=RANGES, **given
    )


if __name__ == "__main__":
    print(search.work(WorkerOf(job(sys.argv[1], int(sys.argv[2]), float(sys.argv[3])), 1)))
