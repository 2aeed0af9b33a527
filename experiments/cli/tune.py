"""Tune the assist of a car to target bands, for the worst of friction and load.

The margins of the assist loop, stability with free hands and the limit of the motor are constraints. Writes a page,
tune.json and the car file best.toml. The same command on the same --out goes on, or shares the work; with another
--sampler it begins a study beside those that are there, and page and best.toml are of the candidates of all.
"""

import argparse
import functools
import shlex
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common import names, options
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.cli.common.sweeping import add_sweep
from steer_env.experiments.pages import car_options

GROUP = "car"
SAMPLERS = ("surface", "tpe", "nsga2", "nsga3", "random")
FILES = ("index.html", "tune.json", "best.toml", "start.toml", "before", "after", "live")
MOST_WORKERS = 64  # at the address of a cluster, which has a number of its own
PROGRESS_INTERVAL = 10.0  # between lines without a terminal [s]
POLL = 1.0  # between looks at how far the search is [s]


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    car_options.add(parser)
    options.add(parser, "--targets", default="compact")
    options.add(parser, "--friction", "; at friction scale 1", otherwise=options.OF_CAR)
    text = "added mass of the laden car [kg] (default: 300)"
    parser.add_argument("--load", metavar="KG", type=options.real, default=300.0, help=text)
    text = "boost, damping, lead, active return, handwheel damping, friction compensation"
    options.add(parser, "--parameters", "by name", otherwise=text, nargs="+", action="extend")
    options.add(parser, "--chassis", default="single_track", choices=names.chassis())
    text = (
        "of this sampler's study, those before included, whatever other samplers have in --out; the second optimiser "
        "of --confirm has as many"
    )
    options.add(parser, "--budget", text, 300)
    text = f"optimiser: {', '.join(SAMPLERS)} (default: surface)"
    parser.add_argument("--sampler", metavar="NAME", choices=SAMPLERS, default="surface", help=text)
    options.add(parser, "--seed", "of new candidates; a study that has begun keeps those it has", 0)
    text = "database in place of the journal in --out, as sqlite:///study.db or postgresql://USER@HOST/NAME"
    parser.add_argument("--storage", metavar="URL", help=text)
    text = "search with a second optimiser, too, where not every band is reached; takes as long again"
    parser.add_argument("--confirm", action="store_true", help=text)
    text = "write the evaluation reports of the car before and after, too"
    parser.add_argument("--report", action="store_true", help=text)
    add_sweep(parser, "that share the search")
    options.add_page(parser, "of journal, page and car file", "tune")
    options.add_live(parser, "the tuned car")


def run(args: argparse.Namespace) -> None:
    """Search, and write what was found."""
    require("tune", "tune")

    from steer_env.experiments.pages.options import progress

    with (
        _going_on(args),
        progress("tuning", every=PROGRESS_INTERVAL) as notify,
    ):  # importing takes some of the first ten seconds
        car, outcome = _tuned(args, notify)
    if args.report and outcome.best is not None:
        for name, file in (("before", "start.toml"), ("after", "best.toml")):
            _report(args, car, file, name)


def _tuned(args: argparse.Namespace, notify: Callable[[float, str], None]) -> tuple[Any, Any]:
    """The car before, and the outcome, which is written."""
    live = options.live_page_beside(args)

    from steer_env import targets
    from steer_env.experiments import sweep
    from steer_env.experiments.calibration import problem, storage, tuning
    from steer_env.experiments.calibration.pace import Pace
    from steer_env.experiments.pages import files

    if args.cluster is not None:
        require("cluster", f"--cluster {args.cluster}")
    where = sweep.Where.parse(args.workers, args.cluster)
    known = (*FILES, storage.JOURNAL, f"{storage.JOURNAL}.lock", storage.PROCESSES)
    database = Path((args.storage or "").removeprefix("sqlite:///"))
    files.usable(args.out, frozenset({*known, database.name} if database.parent == args.out else known))
    car = car_options.load(args)
    chosen = args.parameters or problem.TUNED
    law = options.friction(args, car).parameters
    posed = problem.make(car, targets.load(args.targets), law, chosen, args.load, args.chassis)
    storage.require_whole(args.out / storage.JOURNAL, lambda text: print(f"steer-env tune: {text}", file=sys.stderr))
    run = functools.partial(sweep.run, where=where, modules=args.modules)
    remote = where.cluster not in ("", sweep.where.LOCAL)
    workers = MOST_WORKERS if remote else where.workers
    pace = Pace()
    with _watch(notify, args, pace) as began:
        outcome = tuning.tune(
            posed, args.out, args.budget, run, workers, began=began, pace=pace,
            address=args.storage, sampler=args.sampler, seed=args.seed, resume=args.resume, confirm=args.confirm,
        )  # fmt: skip
        _write(args, posed, outcome, live)
    return car, outcome


@contextmanager
def _going_on(args: argparse.Namespace) -> Iterator[None]:
    """An interruption says how the tuning goes on."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"go on with the same command: {shlex.join(['steer-env', *args.argv])}", file=sys.stderr)
        raise


@contextmanager
def _watch(
    notify: Callable[[float, str], None], args: argparse.Namespace, pace: Any
) -> Iterator[Callable[[Any], None]]:
    """Tells how far the tuning is, by the time that its phases take; yields what takes a job that begins."""
    from steer_env.experiments.calibration import search, storage

    ended, jobs = threading.Event(), list[Any]()

    def watch() -> None:
        while not ended.wait(POLL):
            text = pace.text
            if jobs and text == (job := jobs[-1]).name:
                done = search.count(job, storage.open_storage(args.out, args.storage))
                pace.count(done)
                text = f"{text}: {done} of {job.budget} sets"
            notify(pace.part, text)

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield jobs.append
    finally:
        ended.set()
        thread.join()


def _write(args: argparse.Namespace, posed: Any, outcome: Any, live: Any) -> None:
    """Write the page, its numbers and the car files, and print what was found."""
    from steer_env.experiments.calibration import tuning, tuning_page
    from steer_env.experiments.cli.common.sweeping import unswept
    from steer_env.experiments.pages import pages as page
    from steer_env.experiments.pages import provenance
    from steer_env.friction.sites import friction_name
    from steer_env.vehicle import cars

    cars.write(posed.car, args.out / "start.toml")
    beside = None
    if outcome.best is not None:
        tuned = tuning.rounded(posed, outcome.best.params)
        cars.write(tuned, args.out / "best.toml")
        beside = live(tuned, {friction_name(posed.law): posed.law}) if live else None
    else:
        (args.out / "best.toml").unlink(missing_ok=True)
    found, data = tuning_page.build_page(outcome)
    trace = provenance.trace(
        command=unswept(args, "--out", "--storage"),
        result=args.out.name,
        car=posed.car,
        friction={friction_name(posed.law): posed.law},
        seed=args.seed,
    )
    page.write_page(args.out, found, page.numbers(found, data), trace, beside)
    print(found.verdict[0])
    print(args.out / "index.html")
    if outcome.best is not None and not args.report:
        for name, file in (("before", "start.toml"), ("after", "best.toml")):
            print(shlex.join(["steer-env", *_words(args, posed.car, file, name)]))


def _words(args: argparse.Namespace, car: Any, file: str, name: str) -> list[str]:
    """The command of the evaluation report of a car file; without ``--friction``, the friction is that of ``car``."""
    law = options.friction(args, car).text
    modules = [word for module in args.modules for word in ("--import", module)]
    words = ["--friction", law, "--vehicle", str(args.out / file), "--out", str(args.out / name)]
    return ["report", *modules, *words]


def _report(args: argparse.Namespace, car: Any, file: str, name: str) -> None:
    from steer_env.experiments.cli.main import parsed

    report = parsed(_words(args, car, file, name))
    report.function(report)
