"""What the architecture of the steering changes: which metrics still see the friction law.

Column EPS, rack EPS and steer-by-wire with each of its feels drive the same tests with each law at the sites of their
steering. A metric sees a law where it differs from that with LuGre by more than its interval and more than 5 % of it.
"""

import argparse
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from steer_env import friction
from steer_env.experiments.pages import pictures
from steer_env.experiments.pages.options import progress
from steer_env.experiments.pages.style import smaller
from steer_env.experiments.pages.words import label
from steer_env.experiments.studies.common import battery
from steer_env.experiments.sweep import Runner, run
from steer_env.vehicle import cars

BASE = "lugre"
TESTS = ("weave", "slow-ramp", "release", "returnability", "parking")
WITHOUT_SLIDING = {"viscous": ",efficiency=1"}  # laws without a torque that a gear could let grow
SECTION, BY_WIRE = "steer_by_wire", "compact_steer_by_wire"
ARCHITECTURES = {
    "column EPS": ("compact", ""),
    "rack EPS": ("compact_rack_eps", ""),
    "by wire, map": (BY_WIRE, "torque_map"),
    "by wire, rack force": (BY_WIRE, "rack_force"),
    "by wire, blended": (BY_WIRE, "blended"),
}


class Seen(NamedTuple):
    """How a metric of an architecture sees the laws."""

    laws: int  # how many of them it sees
    law: str  # the one in which it differs most from the base
    share: float  # by which it does [1]
    reach: float  # half of its 95 % interval [1]


Found = dict[str, dict[str, Seen | None]]  # "TEST: metric" -> architecture; None where the metric is refused


def architecture(name: str) -> cars.Car:
    """The car of an architecture."""
    car, feel = ARCHITECTURES[name]
    return cars.load(car, {f"{SECTION}.feel_law": feel} if feel else None)


def _drive(job: tuple[str, str, str]) -> battery.Drive:
    name, law, test = job
    car = architecture(name)
    return battery.drive(car, f"{law}{WITHOUT_SLIDING.get(law, '')}@{car.kind}", test)


def _seen(row: dict[str, battery.Difference]) -> Seen | None:
    """What a metric sees; None where a law's value is refused."""
    if not all(np.isfinite(each.share) for each in row.values()):
        return None
    law = max(row, key=lambda name: abs(row[name].share))
    return Seen(sum(each.matters for each in row.values()), law, row[law].share, row[law].reach)


def collect(
    architectures: Sequence[str] = tuple(ARCHITECTURES),
    laws: Sequence[str] | None = None,
    tests: Sequence[str] = TESTS,
    sweep: Runner = run,
    notify: Callable[[float, str], None] = lambda *_: None,
) -> Found:
    """What each metric of the tests sees of the laws, by default all, in each architecture."""
    chosen = list(dict.fromkeys((BASE, *(laws or friction.available()))))
    jobs = list(product(architectures, chosen, tests))
    drives = dict(zip(jobs, sweep(_drive, jobs, notify=notify, words=", ".join)))
    found: Found = {}
    for name, test in product(architectures, tests):
        of_test = {law: drives[name, law, test] for law in chosen}
        for metric, row in battery.differences(of_test, BASE).items():
            found.setdefault(f"{test}: {label(metric)}", {})[name] = _seen(row)
    return found


def table(found: Found) -> str:
    """The number of laws that each metric sees, and the largest difference with its interval."""
    names = list(next(iter(found.values())))
    lines = [f"{'':46s}" + "".join(f"{name:>26s}" for name in names)]
    for metric, row in found.items():
        cells = [
            f"{each.laws:3d} {100.0 * each.share:+8.1f} % ± {100.0 * each.reach:.1f} %" if each else "refused"
            for each in row.values()
        ]
        lines.append(f"{metric:46s}" + "".join(f"{cell:>26s}" for cell in cells))
    return "\n".join(lines)


def verdict(found: Found) -> str:
    """How many metrics see any law at all, by architecture, of those that every architecture has."""
    whole = [row for row in found.values() if all(row.values())]
    seeing = {name: sum(bool(row[name] and row[name].laws) for row in whole) for name in whole[0]}  # type: ignore[union-attr]
    told = "; ".join(f"{name} {count}" for name, count in seeing.items())
    return f"Of {len(whole)} metrics that every architecture has, so many see at least one law: {told}."


def main(argv: Sequence[str] | None = None, sweep: Runner = run) -> None:
    """Print which metrics see the friction law in each architecture; with --figure also draw it."""
    parser = argparse.ArgumentParser(prog="steer-env study architecture", description=main.__doc__)
    parser.add_argument("--laws", metavar="LAW", nargs="+", help="default: all")
    parser.add_argument("--tests", metavar="TEST", nargs="+", choices=battery.SCRIPTED, default=list(TESTS))
    parser.add_argument("--figure", metavar="FILE.svg", type=Path, help="file for the picture")
    options = parser.parse_args(argv)
    for law in options.laws or ():
        friction.resolve(law)  # refuses an unknown one before anything is driven
    with progress("driving") as notify:
        found = collect(laws=options.laws, tests=options.tests, sweep=sweep, notify=notify)
    print(table(found))
    print("\n" + verdict(found))
    if options.figure:
        options.figure.write_text(smaller(pictures.architecture(found)), encoding="utf-8")
