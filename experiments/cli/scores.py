"""The command ``scores``: every kind of controller on the held-out episodes of every id."""

import argparse
import sys
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common.arguments import MOST_EPISODES, whole_number
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.registration import REGISTERED


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = (
        "Print, in Markdown, the scores of zero action, random actions, every baseline and the trained policies on the "
        "same held-out episodes of every id at its default settings, with the terms on which each of them acts."
    )
    scores = commands.add_parser("scores", help=text, description=text, parents=[common])
    scores.add_argument(
        "--env", metavar="ID", nargs="+", action="extend", help=f"ids (default: all): {', '.join(REGISTERED)}"
    )
    text = "number of held-out episodes (default 100)"
    scores.add_argument("--episodes", metavar="N", type=whole_number(2, MOST_EPISODES), default=100, help=text)
    text = "directories of 'steer-env train', or above several, whose policies are evaluated too"
    scores.add_argument("--policies", metavar="DIR", nargs="+", action="extend", default=[], help=text)
    scores.add_argument("--out", metavar="FILE", help="file for the page, beside standard output")
    text = "JSON file for the reward_threshold of each id, in which the others are kept"
    scores.add_argument("--thresholds", metavar="FILE", help=text)
    add_sweep(scores)
    scores.set_defaults(function=_scores)


def _scores(args: argparse.Namespace) -> None:
    require("train", "evaluating a policy")

    from steer_env.experiments.cli.common.policies import caution
    from steer_env.experiments.learning import policy, scores
    from steer_env.experiments.pages.files import usable, write_text
    from steer_env.experiments.pages.options import progress

    sweep = runner(args)
    chosen = args.env or list(REGISTERED)
    for env_id in chosen:
        policy.check_id(env_id)
    for file in filter(None, (args.out, args.thresholds)):
        usable(Path(file).resolve().parent)
    policies = scores.trained(map(Path, args.policies))
    for path in (path for env_id in chosen for path in policies.get(env_id, [])):
        caution(path, policy.about(path))
    with progress("evaluating") as notify:
        found = scores.collect(chosen, args.episodes, policies, notify, sweep)
    page = scores.markdown(found, args.episodes)
    sys.stdout.write(page)
    if args.out:
        write_text(Path(args.out), page)
    if args.thresholds:
        scores.write_thresholds(Path(args.thresholds), found)
