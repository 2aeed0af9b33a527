"""How sweeps scale: time of 200 drives and overhead per task, serial, in processes and on a local Dask cluster.

``python tests/tools/sweep_scaling.py`` prints the figures of docs/many_machines.md. The machine should be quiet: at
least as many idle processors as workers. Required is that a Dask cluster of two workers is at least 1.7 times as fast
as one worker on 200 drives, and that all results are equal to the bit; the exit code is 1 otherwise.
"""

import argparse
import hashlib
import sys
import time
from typing import Any

from steer_env import friction, manoeuvres
from steer_env.experiments import sweep
from steer_env.experiments.sweep.where import processors
from steer_env.vehicle import cars

REQUIRED = 1.7


def drive(level: float) -> bytes:
    """A weave at a level of friction, as a digest of its recording."""
    law = friction.make("lugre", F_c=level)
    recording = manoeuvres.drive(cars.load(), manoeuvres.make("weave", cycles=2), law)
    return hashlib.sha256(b"".join(recording[name].tobytes() for name in recording.channels)).digest()


def nothing(number: int) -> int:
    """A task that costs nothing, to measure what a task costs by itself."""
    return number


def timed(function: Any, cases: list[Any], where: sweep.Where) -> tuple[float, float, list[Any]]:
    """Time to the first result and from there to the last [s], and the results."""
    ends: list[float] = []
    start = time.perf_counter()
    results = sweep.run(function, cases, where=where, notify=lambda *_: ends.append(time.perf_counter()))
    return ends[0] - start, ends[-1] - ends[0], results


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200, help="drives (default 200)")
    parser.add_argument("--tasks", type=int, default=2000, help="empty tasks (default 2000)")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2], help="numbers of workers (default 1 2)")
    parser.add_argument("--cluster", help="address of a Dask cluster to measure besides")
    args = parser.parse_args()
    import sweep_scaling as importable  # workers import the functions by name, not from __main__

    importable.drive(1.0)  # compiles
    places = {"serial": sweep.SERIAL}
    places |= {f"processes, {n}": sweep.Where(n) for n in args.workers if n > 1}
    places |= {f"Dask, {n}": sweep.Where(n, "local") for n in args.workers}
    if args.cluster:
        places[args.cluster] = sweep.Where.parse(None, args.cluster)
    levels = [0.5 + k / args.runs for k in range(args.runs)]
    print(f"{processors()} processors\n")
    print(f"| where | start [s] | {args.runs} drives [s] | drives/s | overhead per task [ms] |\n|---|---|---|---|---|")
    rates, digests = {}, set()
    for name, where in places.items():
        start, duration, results = timed(importable.drive, levels, where)
        _, empty, _ = timed(importable.nothing, list(range(args.tasks)), where)
        rates[name] = (args.runs - 1) / duration
        digests.add(tuple(results))
        overhead = 1e3 * empty / (args.tasks - 1)
        print(f"| {name} | {start:.1f} | {duration:.1f} | {rates[name]:.2f} | {overhead:.2f} |", flush=True)
    print(f"\nresults equal to the bit everywhere: {len(digests) == 1}")
    if not {"Dask, 1", "Dask, 2"} <= set(rates):
        return int(len(digests) > 1)
    ratio = rates["Dask, 2"] / rates["Dask, 1"]
    print(f"Dask, two workers over one: {ratio:.2f} (required {REQUIRED} on a quiet machine)")
    return int(len(digests) > 1 or ratio < REQUIRED)


if __name__ == "__main__":
    sys.exit(main())
