"""Compare a simulation with a measurement of the same test, within tolerances.

Cross plots show the tolerance boundaries. The exit code is 1 where the two do not agree within the tolerances, or one
gives no metric.
"""

import argparse

from steer_env.experiments.cli.common import names, recordings

GROUP = "test"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("measured", metavar="MEASURED", help=f"the measured recording: {names.RECORDED}")
    parser.add_argument("simulated", metavar="SIMULATED", help=f"the simulated recording: {names.RECORDED}")
    text = (
        "tolerances by channel: default, for a model that is to show a measured friction; wide, for one made from a "
        "data sheet; or a .toml file"
    )
    parser.add_argument("--tolerances", metavar="NAME", default="default", help=text)
    recordings.add_options(parser)


def run(args: argparse.Namespace) -> int:
    """Print how far they agree, and write it where --out says; the exit code."""
    return recordings.assess([args.measured, args.simulated], args, args.tolerances, compare=True)
