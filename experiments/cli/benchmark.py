"""Score controllers in a suite of the benchmark, and check result files.

Writes a result file for each controller, with every episode, and a page with the table of all results in --out.
docs/benchmark.md tells what a score is and how to enter a controller of one's own. The exit code is 1 where --verify
finds a field that is another.
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
    most = options.whole_number(2, options.MOST_EPISODES)
    options.add(parser, "--episodes", "of every controller in every id, held out", otherwise=str(EPISODES), type=most)
    text = "file with salt and seeds of a round, in place of the held-out seeds that everybody knows"
    parser.add_argument("--round", metavar="FILE.json", type=Path, help=text)
    text = "draw --episodes secret seeds and a salt into this file, print its hash to be published, and do no more"
    parser.add_argument("--new-round", metavar="FILE.json", type=Path, help=text)
    text = "the hash that was published for the round, which its salt and seeds must have"
    parser.add_argument("--published", metavar="SHA256", help=text)
    text = (
        "check a result: that it follows from its episodes, and that these are the same, to the bit, when they are "
        "driven again; those of a policy or a class where CONTROLLER gives it"
    )
    parser.add_argument("--verify", metavar="FILE.json", type=Path, help=text)
    options.add_page(parser, "of result files and their table, which are added to those there", "benchmark")
    add_sweep(parser)


def run(args: argparse.Namespace) -> int:
    """Enter controllers, draw a round, or check a result; the exit code."""
    from steer_env.experiments.learning import benchmark
    from steer_env.experiments.pages.files import usable, write_text
    from steer_env.experiments.pages.options import progress

    if sum(map(bool, (args.suite, args.verify, args.new_round))) != 1:
        raise ValueError(f"give one of --suite ({', '.join(SUITES)}), --verify and --new-round")
    if args.episodes and (args.round or args.verify):
        raise ValueError("--episodes has no effect here, as the round or the result has its seeds: leave it out")
    episodes = args.episodes or EPISODES
    if args.new_round:
        if args.new_round.exists():
            raise ValueError(f"--new-round {args.new_round} is there already: give a new file")
        drawn = benchmark.drawn_round(episodes)
        write_text(args.new_round, benchmark.text_of_round(drawn))
        print(drawn.sha256)
        return 0
    if args.verify:
        return _verify(args)

    from steer_env.experiments.reports import benchmark_page

    usable(args.out)
    benchmark_page.read(args.out)  # a file that the table cannot take is told before the work
    of = benchmark.suite(args.suite)
    seeds = benchmark.read_round(args.round) if args.round else benchmark.held_out_round(episodes)
    if args.published not in (None, seeds.sha256):
        raise ValueError(f"salt and seeds have the SHA-256 {seeds.sha256}, not the one published, {args.published}")
    entries = [_entry(text, of) for text in args.controllers or of.baselines()]
    with progress("driving") as notify:
        results = benchmark.enter(entries, of, seeds, notify, runner(args))
    args.out.mkdir(parents=True, exist_ok=True)
    for result in results:
        path = args.out / benchmark.name_of(result)
        write_text(path, benchmark.text_of(benchmark.document(result)))
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
    """Check a result; the exit code."""
    from steer_env.experiments.learning import benchmark
    from steer_env.experiments.pages import traces
    from steer_env.experiments.pages.options import progress

    if len(args.controllers) > 1:
        raise ValueError(f"--verify checks one result: give one CONTROLLER, not {' '.join(args.controllers)}")
    file = args.verify
    found, result = benchmark.read(file)
    fields = benchmark.derived(found, result)
    if args.round and benchmark.read_round(args.round) != result.round:
        fields.append(f"round, which is not that of {args.round}")
    if args.published not in (None, result.round.sha256):
        fields.append("round.sha256, which is not the one published")
    if fields:
        return _told(file, fields, "do not follow from its episodes, or are not as given")
    print(f"{file}: all that it says follows from its episodes; SHA-256 of its seeds {result.round.sha256}")
    if others := traces.other_program(found["trace"]):
        raise ValueError(f"{file} was made by another program, whose episodes are others: {others}")
    kind, name = result.controller["kind"], result.controller["name"]
    known = kind == benchmark.BASELINE or (kind == benchmark.POLICY and name == SHIPPED)
    given = args.controllers or [name] * known
    who = _entry(given[0], result.suite) if given else None
    with progress("driving") as notify:
        fields = benchmark.again(result, who, notify, runner(args))
    if fields:
        return _told(file, fields, "are others when its episodes are driven again")
    what = "all episodes are" if who else "the episodes of zero action and the references, without CONTROLLER, are"
    print(f"{file}: driven again, {what} equal to the bit")
    return 0


def _told(file: Path, fields: list[str], what: str) -> int:
    """Print which fields differ; the exit code."""
    derived = "score", "parts", "sha256"  # follow from others, which are named first
    ordered = sorted(fields, key=lambda field: field.startswith(derived))
    shown = ", ".join(ordered[:5]) + (f" and {len(fields) - 5} more" if len(fields) > 5 else "")
    print(f"{file}: {len(fields)} fields {what}: {shown}")
    return 1
