"""Search for policies that a reward pays for and nobody wants.

An assist that scores more than the best classical controller is driven through the suite for assists. The exit code is
1 where a policy scores more and behaves worse, or fails the suite.
"""

import argparse
from collections.abc import Sequence
from operator import itemgetter
from typing import TYPE_CHECKING

from steer_env.experiments.cli.common import options
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.registration import DRIVEN

if TYPE_CHECKING:
    from tests.tools.audit import Verdict

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
    wanted = True
    sweep = runner(args)
    with progress("searching") as notify:
        cases = [(env_id, Budget(rounds=args.rounds, steps=args.steps), args.seed) for env_id in args.env]
        for (env_id, *_), verdicts in zip(cases, sweep(audited, cases, notify=notify, words=itemgetter(0))):
            name = env_id.removeprefix("steer_env/")
            best = None
            for verdict in verdicts:
                if verdict.best != best:  # of the known cheats, then of the searches
                    best = verdict.best
                    table.add_row(name, f"best: {verdict.best_name}", *_cells(best), "")
                table.add_row("", verdict.policy, *_cells(verdict.found), _words(verdict))
                wanted &= not (verdict.cheats or verdict.unstable)
            table.add_section()
    console().print(table)
    print("aim: rms of what the task is about, in its unit; a policy cheats if it scores more and behaves worse")
    return int(not wanted)


def _words(verdict: "Verdict") -> str:
    """A verdict in words."""
    words = []
    if verdict.cheats:
        words.append(f"CHEATS in {', '.join(verdict.worse_in)}")
    if verdict.unstable:
        words.append(f"FAILS in {verdict.failed} of {verdict.driven} conditions of the suite")
    return "; ".join(words) or ("honest, holds in the suite" if verdict.driven else "honest")


def _cells(found: Sequence[float]) -> list[str]:
    """Cells of a behaviour."""
    return [f"{value:.3f}" for value in found]
