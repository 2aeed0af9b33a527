"""The command ``study``: one of the studies behind the report and the documentation."""

import argparse
import importlib
from typing import Any

from steer_env.experiments.cli.common.extras import require
from steer_env.friction.numerics.registry import dashed, listed

EXTRAS = {"commonroad": "test"}  # study -> the extra that it needs


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    studies = listed("steer_env.experiments.studies", dashed)
    text = "Run a study and print its table or write its picture."
    more = f"{text} Studies: {', '.join(studies)}. 'steer-env study NAME --help' tells the options of one."
    study = commands.add_parser("study", help=text, description=more, parents=[common])
    study.add_argument("name", metavar="NAME", choices=tuple(studies), help="name of the study")
    study.add_argument("options", metavar="...", nargs=argparse.REMAINDER, help="options of the study")
    study.set_defaults(function=lambda args: _study(args, studies[args.name]))


def _study(args: argparse.Namespace, module: str) -> int | None:
    if args.name in EXTRAS:
        require(EXTRAS[args.name], f"the study {args.name}")
    return importlib.import_module(module).main(args.options)
