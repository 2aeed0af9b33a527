"""The command ``audit``: what scores more than the classical controllers must not behave worse."""

import argparse
from collections.abc import Sequence
from operator import itemgetter
from typing import Any

from steer_env.experiments.cli.common.arguments import whole_number
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.registration import DRIVEN


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = "Search for policies that a reward pays for and nobody wants; the exit code is 1 if one is found."
    audit = commands.add_parser("audit", help=text, description=text, parents=[common])
    text = f"environments (default: all): {', '.join(DRIVEN)}"
    audit.add_argument("--env", metavar="ID", nargs="+", choices=tuple(DRIVEN), default=list(DRIVEN), help=text)
    text = "rounds of the cross-entropy method on linear policies (default 12)"
    audit.add_argument("--rounds", metavar="N", type=whole_number(1), default=12, help=text)
    text = "steps of PPO with its defaults, 0 leaves it out (default 100000)"
    audit.add_argument("--steps", metavar="N", type=whole_number(0), default=100_000, help=text)
    audit.add_argument("--seed", metavar="N", type=whole_number(0), default=0, help="of the searches (default 0)")
    add_sweep(audit)
    audit.set_defaults(function=_audit)


def _audit(args: argparse.Namespace) -> int:
    if args.steps:
        require("train", "the search by PPO")

    from rich.table import Table

    from steer_env.experiments.cli.common.tables import console
    from steer_env.experiments.learning.audit import audited
    from steer_env.experiments.learning.policy_search import Budget
    from steer_env.experiments.pages.options import progress

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
