"""Score controllers in a suite of the benchmark, and repeat result files.

Writes a result file for each controller, with every episode, and a page with the table of all results in --out.
docs/benchmark.md tells what a score is and how to enter a controller of one's own. The exit code is 1 where --verify
finds an episode that is another.
"""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from steer_env.experiments.cli.common import options
from steer_env.experiments.cli.common.options import SHIPPED
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.experiments.learning.constants import SUITES

if TYPE_CHECKING:
    from steer_env.experiments.learning.benchmark import Entry, Suite

GROUP = "learn"
EPISODES = 40


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    text = (
        "FILE.py:CLASS or MODULE:CLASS with the methods reset and act, a policy.zip of 'steer-env train' or a folder "
        f"with several, {SHIPPED!r}, zero, random or a baseline (default: zero, random and every baseline)"
    )
    parser.add_argument("controllers", metavar="CONTROLLER", nargs="*", help=text)
    text = f"which controllers are scored in: {', '.join(SUITES)}"
    parser.add_argument("--suite", metavar="NAME", choices=tuple(SUITES), help=text)
    text = "an id in place of a suite; it also takes a policy that a script saved by Stable-Baselines3's model.save"
    parser.add_argument("--env", metavar="ID", help=text)
    most = options.whole_number(2, options.MOST_EPISODES)
    options.add(parser, "--episodes", "of every controller in every id, held out", otherwise=str(EPISODES), type=most)
    text = (
        "drive the controller of a result once more on the seeds of the file, and say which episodes are others; a "
        "baseline or shipped policies by their name in it, what else is to be given as CONTROLLER"
    )
    parser.add_argument("--verify", metavar="FILE.json", type=Path, help=text)
    options.add_page(parser, "of result files and their table, which are added to those there", "benchmark")
    add_sweep(parser)


def run(args: argparse.Namespace) -> int:
    """Enter controllers or repeat a result; the exit code."""
    from steer_env.experiments.learning import benchmark
    from steer_env.experiments.pages.files import usable, write_text
    from steer_env.experiments.pages.options import progress

    if sum(map(bool, (args.suite, args.env, args.verify))) != 1:
        raise ValueError(f"give one of --suite ({', '.join(SUITES)}), --env and --verify")
    if args.verify:
        return _verify(args)

    from steer_env.experiments.reports import benchmark_page

    usable(args.out)
    benchmark_page.read(args.out)  # a file that the table cannot take is told before the work
    of = benchmark.suite(args.suite) if args.suite else benchmark.of_id(args.env)
    seeds = benchmark.held_out_seeds(args.episodes or EPISODES)
    entries = [_entry(text, of) for text in args.controllers or of.baselines()]
    with progress("driving") as notify:
        results = benchmark.enter(entries, of, seeds, notify, runner(args))
    args.out.mkdir(parents=True, exist_ok=True)
    for result in results:
        path = args.out / benchmark.result_file_name(result)
        write_text(path, benchmark.result_text(benchmark.document(result)))
        print(f"{path}: score {benchmark_page.spread(benchmark.score(result))}")
    print(benchmark_page.write(args.out))
    return 0


def _entry(text: str, of: "Suite") -> "Entry":
    """A controller by its text, with what is to be said before it is driven."""
    from steer_env.experiments.cli.common.extras import require
    from steer_env.experiments.learning import benchmark

    found = benchmark.entry(text, of)
    if found.kind == benchmark.POLICY:
        require("train", "evaluating a policy")
    for caution in found.cautions:
        print(f"steer-env: caution: {caution}", file=sys.stderr)
    return found


def _verify(args: argparse.Namespace) -> int:
    """Repeat a result; the exit code. No code runs that only the file names."""
    from steer_env.experiments.learning import benchmark
    from steer_env.experiments.pages import traces
    from steer_env.experiments.pages.options import progress

    if len(args.controllers) > 1:
        raise ValueError(f"--verify repeats one result: give one CONTROLLER, not {' '.join(args.controllers)}")
    if args.episodes:
        raise ValueError("--episodes has no effect here, as the result has its seeds: leave it out")
    file = args.verify
    said = benchmark.read(file)
    of, name = benchmark.suite(said["suite"]), said["controller"]["name"]
    if not args.controllers and name not in (*of.baselines(), SHIPPED):
        raise ValueError(f"{file} is of {name!r}: give this controller beside --verify, too")
    who = _entry((args.controllers or [name])[0], of)
    if others := traces.other_program(traces.read(file)):
        print(f"steer-env: caution: {file} was made by another program: {others}", file=sys.stderr)
    with progress("driving") as notify:
        same = benchmark.rerun_result(said, who, notify, runner(args))
    changed = [f"{drive}, {whose}, seed {seed}" for (drive, whose, seed), equal in same.items() if not equal]
    if not changed:
        print(f"{file}: driven again, all {len(same)} episodes are the same")
        return 0
    shown = "; ".join(changed[:5]) + (f"; and {len(changed) - 5} more" if len(changed) > 5 else "")
    print(f"{file}: driven again, {len(changed)} of {len(same)} episodes are others: {shown}")
    return 1
