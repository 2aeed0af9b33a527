"""Search for policies that a reward pays for and nobody wants.

The exit code is 1 where one is found.
"""

import argparse
from collections.abc import Sequence
from operator import itemgetter

from steer_env.experiments.cli.common import options
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.registration import DRIVEN

GROUP = "Maintain the package"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    text = f": {', '.join(DRIVEN)}"
    options.add(parser, "--env", text, list(DRIVEN), "all of them", nargs="+", choices=tuple(DRIVEN))
    text = "rounds of the cross-entropy method on linear policies (default: 12)"
    parser.add_argument("--rounds", metavar="N", type=options.whole_number(1), default=12, help=text)
    options.add(parser, "--steps", "by PPO with its defaults; 0 leaves it out", 100_000)
    options.add(parser, "--seed", "of the searches", 0)
    add_sweep(parser)


def run(args: argparse.Namespace) -> int:
    """Search, and print what was found; the exit code."""
    if args.steps:
        require("train", "the search by PPO")

    from rich.table import Table

    from steer_env.experiments.cli.common.tables import console
    from steer_env.experiments.pages.options import progress
    from tests.tools.audit import audited
    from tests.tools.policy_search import Budget

    table = Table(
        "id",
        "policy",
        "reward",
        "failures",
        "ripple [N m]",
        "aim",
        "cones",
        "verdict",
        title="Audit",
        title_justify="left",
    )
    cheating = False
    sweep = runner(args)
    with progress("searching") as notify:
        cases = [(env_id, Budget(rounds=args.rounds, steps=args.steps), args.seed) for env_id in args.env]
        for (env_id, *_), verdicts in zip(cases, sweep(audited, cases, notify=notify, words=itemgetter(0))):
            name = env_id.removeprefix("steer_env/")
            table.add_row(name, f"best: {verdicts[0].best_name}", *_cells(verdicts[0].best), "")
            for verdict in verdicts:
                text = f"CHEATS in {', '.join(verdict.worse_in)}" if verdict.cheats else "honest"
                table.add_row("", verdict.policy, *_cells(verdict.found), text)
                cheating |= verdict.cheats
            table.add_section()
    console().print(table)
    print("aim: rms of what the task is about, in its unit; a policy cheats if it scores more and behaves worse")
    return int(cheating)


def _cells(found: Sequence[float]) -> list[str]:
    """Cells of a behaviour."""
    return [f"{value:.3f}" for value in found]
