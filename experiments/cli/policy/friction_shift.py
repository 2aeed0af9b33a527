"""The benchmark of friction shift: train policies on one friction law, or on a set, and drive them on every law.

What is finished stays in the folder of --out, where --resume takes it. docs/friction_shift.md tells the cases.
"""

import argparse

from steer_env.experiments.cli.common import options
from steer_env.experiments.cli.common.extras import OF_ALGORITHM, require
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.experiments.learning.constants import HELD_OUT
from steer_env.experiments.learning.friction_shift_cases import (
    CANDIDATES,
    CASES,
    DROPPED,
    ENTRIES,
    EPISODES,
    LAWS,
    SEARCHED,
    SEEDS,
)


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    text = f"cases: {', '.join(CASES)} (default: all); beside them what the search left out: {', '.join(DROPPED)}"
    parser.add_argument("--case", metavar="NAME", choices=tuple(CANDIDATES), nargs="+", default=list(CASES), help=text)
    first = list(ENTRIES)[:2]
    text = f"kinds of policies that are trained: {', '.join(ENTRIES)} (default: {' '.join(first)})"
    parser.add_argument("--entry", metavar="NAME", choices=tuple(ENTRIES), nargs="+", default=first, help=text)
    text = f"trainings of each entry, from seed 0 on (default: {SEEDS})"
    parser.add_argument("--seeds", metavar="N", type=options.whole_number(1), default=SEEDS, help=text)
    most = options.whole_number(1, options.MOST_EPISODES)
    options.add(parser, "--episodes", "of every controller on every law, held out", EPISODES, type=most)
    text = f"{len(LAWS) - 2} laws, two of them with two values of micro-damping"
    options.add(parser, "--friction", "on which all are driven", otherwise=text, nargs="+", action="extend")
    text = f"drive in the episodes of the search that chose the cases, seeds from {SEARCHED} on in place of {HELD_OUT}"
    parser.add_argument("--search", action="store_true", help=text)
    text = "train nothing: the report of the trainings that the folder of --out holds"
    parser.add_argument("--finished", action="store_true", help=text)
    options.add_page(parser, "of the report, of policies and rewards", "friction_shift")
    add_sweep(parser)


def run(args: argparse.Namespace) -> None:
    """Train and drive what is missing, print the table and write the report."""
    more = [OF_ALGORITHM[ENTRIES[name].algorithm] for name in args.entry if ENTRIES[name].algorithm in OF_ALGORITHM]
    require("train", "training", *more)

    from steer_env.experiments.cli.common.policies import trace
    from steer_env.experiments.cli.common.tables import print_friction_shift
    from steer_env.experiments.learning import friction_shift
    from steer_env.experiments.pages.files import usable
    from steer_env.experiments.pages.options import progress

    usable(args.out)
    if not (args.resume or args.finished) and args.out.exists() and any(args.out.iterdir()):
        raise ValueError(f"{args.out} is not empty: give a new directory, or go on in it with --resume")
    # What is finished lies in --out, where another version finds it too; a store of the sweep would refuse that.
    sweep = runner(argparse.Namespace(**{**vars(args), "resume": False}))
    laws = [law.text for law in args.friction] if args.friction else LAWS
    with progress("training") as notify:
        found = friction_shift.collect(
            args.out,
            args.case,
            args.entry,
            args.seeds,
            laws,
            args.episodes,
            SEARCHED if args.search else HELD_OUT,
            not args.finished,
            notify,
            sweep,
        )
    print_friction_shift(found)
    friction_shift.write(args.out, found, trace(args, {}))
    print(args.out / "index.html")
