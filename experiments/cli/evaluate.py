"""The command ``evaluate``: the metrics of a recording, or of two with their differences."""

import argparse
from typing import Any

from steer_env.experiments.cli.common import names, recordings


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = "Compute the metrics of a recording, measured or simulated; with --compare those of two recordings."
    more = f"{text} The exit code is 1 where a recording gives no metric."
    evaluate = commands.add_parser("evaluate", help=text, description=more, parents=[common])
    evaluate.add_argument("file", metavar="FILE", nargs="?", help=f"the recording: {', '.join(names.FORMATS)}")
    text = "two recordings; the differences are B less A"
    evaluate.add_argument("--compare", metavar=("A", "B"), nargs=2, help=text)
    recordings.add_options(evaluate)
    evaluate.set_defaults(function=_evaluate)


def _evaluate(args: argparse.Namespace) -> int:
    if (args.file is None) == (args.compare is None):
        raise ValueError("give one FILE, or two with --compare A B")
    return recordings.assess([args.file] if args.file else args.compare, args, None)
