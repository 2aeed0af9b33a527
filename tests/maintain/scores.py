"""Print the page of scores: every kind of controller on the held-out episodes of every id.

The page is in Markdown. It has zero action, random actions, every baseline and the trained policies on the same
episodes at the default settings of each id, with the terms on which each of them acts.
"""

import argparse
import sys
from pathlib import Path

from steer_env.experiments.cli.common import options
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.registration import REGISTERED

GROUP = "Maintain the package"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    options.add(parser, "--env", f": {', '.join(REGISTERED)}", otherwise="all", nargs="+", action="extend")
    most = options.whole_number(2, options.MOST_EPISODES)
    options.add(parser, "--episodes", "held out from every training", 100, type=most)
    text = "directories of 'steer-env train', or above several, whose policies are evaluated too"
    parser.add_argument("--policies", metavar="DIR", nargs="+", action="extend", default=[], help=text)
    options.add_out(parser, "for the page, beside standard output", form="FILE.md", otherwise="none is written")
    text = "JSON file for the reward_threshold of each id, in which the others are kept"
    parser.add_argument("--thresholds", metavar="FILE.json", help=text)
    add_sweep(parser)


def run(args: argparse.Namespace) -> None:
    """Evaluate, and print the page."""
    require("train", "evaluating a policy")

    from steer_env.experiments.cli.common.policies import caution
    from steer_env.experiments.learning import policy
    from steer_env.experiments.pages.files import usable, write_text
    from steer_env.experiments.pages.options import progress
    from tests.tools import scores

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
        write_text(args.out, page)
    if args.thresholds:
        scores.write_thresholds(Path(args.thresholds), found)
