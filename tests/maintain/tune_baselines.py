"""Search for the options with which baseline assists earn most and pass 'steer-env policy suite'."""

import argparse
import math
from collections.abc import Mapping
from pathlib import Path

from rich.table import Table

from steer_env.assists.common.definition import TUNED
from steer_env.experiments.cli.common import names, options
from steer_env.experiments.cli.common.options import SHIPPED
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.experiments.cli.common.tables import console
from steer_env.experiments.pages import car_options
from tests.tools import assist_tuning
from tests.tools.assist_tuning import Tuned

GROUP = "Maintain the package"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    options.add(parser, "--env", "of an assist", required=True, nargs="+", action="extend")
    text = f"baselines by name (default: {', '.join(names.assists())})"
    parser.add_argument("--baseline", metavar="NAME", nargs="+", action="extend", choices=names.assists(), help=text)
    options.add(parser, "--budget", "for each baseline, its defaults among them", 30)
    options.add(parser, "--episodes", "for each candidate", 16)
    options.add(parser, "--seed", "of the search's draws", 0)
    text = f"that keeps what is found; with {SHIPPED!r} the one that assists.make reads"
    options.add_out(parser, text, form="FILE.json", otherwise="none is written")
    car_options.add(parser, default=None, usual="those of the environment and of the suite")
    add_sweep(parser)


def run(args: argparse.Namespace) -> None:
    """Search, print and keep what was found."""
    from steer_env.experiments.learning import assist_suite, policy_report, training
    from steer_env.experiments.pages.options import progress

    for env_id in args.env:
        assist_suite.task_named(env_id)
    car = car_options.load(args) if car_options.any_given(args) else None
    if car is not None and str(args.out) == SHIPPED:
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
            path = TUNED if str(args.out) == SHIPPED else Path(args.out)
            entries = {name: assist_tuning.as_json(result, args.episodes) for name, result in found.items()}
            assist_tuning.keep(env_id, entries, path)
        drawn = policy_report.conditions(training.conditions(env_id))
        words = ", ".join(f"{name} {value}" for name, value in drawn.items()) or "nothing"
        _print_tuned(found, f"{env_id}: {args.episodes} episodes for each candidate, drawn as in the training: {words}")


def _print_tuned(found: Mapping[str, Tuned], title: str) -> None:
    """Print what searches for the options of baselines have found."""
    table = Table(title=title, box=None, title_justify="left")
    for heading in ("baseline", "reward by default", "reward", "options", "candidates", "refused"):
        table.add_column(heading, justify="left" if heading in ("baseline", "options") else "right")
    for name, one in found.items():
        options = ", ".join(f"{key}={value:g}" for key, value in one.options.items()) or "the defaults"
        if math.isnan(one.reward):
            options = "none passes the suite"
        table.add_row(name, f"{one.usual:.4g}", f"{one.reward:.4g}", options, str(one.candidates), str(one.refused))
    console().print(table)
