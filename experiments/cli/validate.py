"""The command ``validate``: a simulation against a measurement of the same test."""

import argparse
from typing import Any

from steer_env.experiments.cli.common import names, recordings


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = "Compare a simulation with a measurement of the same test: cross plots with tolerance boundaries."
    more = f"{text} The exit code is 1 where they do not agree within the tolerances, or one gives no metric."
    validate = commands.add_parser("validate", help=text, description=more, parents=[common])
    validate.add_argument("measured", metavar="MEASURED", help=f"the measured recording: {names.RECORDED}")
    validate.add_argument("simulated", metavar="SIMULATED", help=f"the simulated recording: {names.RECORDED}")
    text = (
        "tolerances by channel: default, for a model that is to show a measured friction; wide, for one made from a "
        "data sheet; or a .toml file"
    )
    validate.add_argument("--tolerances", metavar="NAME", default="default", help=text)
    recordings.add_options(validate)
    validate.set_defaults(
        function=lambda args: recordings.assess([args.measured, args.simulated], args, args.tolerances)
    )
