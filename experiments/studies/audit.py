"""Audit of the rewards by policy search: what scores more than the classical controllers must not behave worse."""

import argparse
from collections.abc import Sequence

from steer_env.registration import DRIVEN


def main(argv: Sequence[str] | None = None) -> int:
    """Search for policies that a reward pays for and nobody wants; the exit code is 1 if one is found."""
    parser = argparse.ArgumentParser(prog="steer-env study audit", description=main.__doc__)
    parser.add_argument("--env", metavar="ID", nargs="+", choices=tuple(DRIVEN), default=list(DRIVEN), help="ids (all)")
    parser.add_argument("--rounds", metavar="N", type=int, default=12, help="of the cross-entropy method (12)")
    parser.add_argument("--steps", metavar="N", type=int, default=100_000, help="of PPO, 0 leaves it out (100000)")
    parser.add_argument("--seed", metavar="N", type=int, default=0, help="of the searches (0)")
    args = parser.parse_args(argv)

    from rich.console import Console
    from rich.table import Table

    from steer_env.experiments.learning.audit import audit
    from steer_env.experiments.learning.policy_search import Budget
    from steer_env.experiments.output.options import progress

    table = Table("id", "policy", "reward", "failures", "ripple [N m]", "aim", "cones", "verdict", title="Audit")
    cheating = False
    with progress("searching") as notify:
        for k, env_id in enumerate(args.env):
            part = k / len(args.env)
            name = env_id.removeprefix("steer_env/")
            notify(part, name)
            verdicts = audit(env_id, Budget(rounds=args.rounds, steps=args.steps), args.seed)
            best = verdicts[0].best
            table.add_row(name, f"best: {verdicts[0].best_name}", *_cells(best), "")
            for verdict in verdicts:
                text = f"CHEATS in {', '.join(verdict.worse_in)}" if verdict.cheats else "honest"
                table.add_row("", verdict.policy, *_cells(verdict.found), text)
                cheating |= verdict.cheats
            table.add_section()
    Console().print(table)
    return int(cheating)


def _cells(found: Sequence[float]) -> list[str]:
    """Cells of a behaviour."""
    return [f"{value:.3f}" for value in found]
