"""The command ``tune-baselines``: a search for the options of the baseline assists, for each task."""

import argparse
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common import names
from steer_env.experiments.cli.common.arguments import SHIPPED, whole_number
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.experiments.pages import car_options


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = "Search for the options with which baseline assists earn most and pass the suite of 'assist-suite'."
    tune = commands.add_parser("tune-baselines", help=text, description=text, parents=[common])
    text = "environments, assists' ids"
    tune.add_argument("--env", metavar="ID", nargs="+", action="extend", required=True, help=text)
    text = f"baselines by name (default: {', '.join(names.assists())})"
    tune.add_argument("--baseline", metavar="NAME", nargs="+", action="extend", choices=names.assists(), help=text)
    text = "candidates for each baseline, its defaults among them (default 30)"
    tune.add_argument("--budget", metavar="N", type=whole_number(1), default=30, help=text)
    text = "episodes for each candidate (default 16)"
    tune.add_argument("--episodes", metavar="N", type=whole_number(1), default=16, help=text)
    text = "seed of the search's draws (default 0)"
    tune.add_argument("--seed", metavar="N", type=whole_number(0), default=0, help=text)
    text = (
        f"file that keeps what is found; with {SHIPPED!r} the one that the evaluations read (default: none is written)"
    )
    tune.add_argument("--out", metavar="FILE.json", help=text)
    car_options.add(tune, default=None, usual="those of the environment and of the suite")
    add_sweep(tune)
    tune.set_defaults(function=_tune)


def _tune(args: argparse.Namespace) -> None:
    from steer_env.experiments.cli.common.tables import print_tuned
    from steer_env.experiments.learning import assist_suite, assist_tuning, policy_report, training, tuned_assists
    from steer_env.experiments.pages.options import progress

    for env_id in args.env:
        assist_suite.task_named(env_id)
    car = car_options.load(args) if car_options.given(args) else None
    if car is not None and args.out == SHIPPED:
        raise ValueError(
            f"--out {SHIPPED} keeps what is found for the default car: leave out --vehicle, --tyre and --set"
        )
    sweep = runner(args)
    searches = [
        assist_tuning.Search(name, env_id, args.budget, args.episodes, args.seed, car)
        for env_id in args.env
        for name in args.baseline or names.assists()
    ]
    with progress("tuning") as notify:
        results = sweep(assist_tuning.searched, searches, notify=notify, words=lambda of: f"{of.env_id} {of.name}")
    for env_id in args.env:
        found = {search.name: result for search, result in zip(searches, results) if search.env_id == env_id}
        if args.out:
            path = tuned_assists.FILE if args.out == SHIPPED else Path(args.out)
            entries = {name: assist_tuning.as_json(result, args.episodes) for name, result in found.items()}
            tuned_assists.keep(env_id, entries, path)
        drawn = policy_report.conditions(training.conditions(env_id))
        words = ", ".join(f"{name} {value}" for name, value in drawn.items()) or "nothing"
        print_tuned(found, f"{env_id}: {args.episodes} episodes for each candidate, drawn as in the training: {words}")
