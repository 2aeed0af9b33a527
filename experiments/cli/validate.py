"""Compare a simulation with a measurement of the same test, within tolerances.

Cross plots show the tolerance boundaries. Where the two do not agree, the smallest change of named parameters of the
car is found that would explain it. The exit code is 1 where they do not agree within the tolerances, or one gives no
metric.
"""

import argparse
from pathlib import Path

from steer_env.experiments.cli.common import names, options, recordings

GROUP = "test"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("measured", metavar="MEASURED", help=f"the measured recording: {names.RECORDED}")
    text = (
        f"the simulated recording ({names.FORMATS[0]}, ...), or a car (.toml, .json), which is driven as MEASURED was"
    )
    parser.add_argument("simulated", metavar="SIMULATED", help=text)
    options.add(parser, "--friction", "; of a car as SIMULATED", otherwise=options.OF_CAR)
    text = (
        "tolerances by channel: default, for a model that is to show a measured friction; wide, for one made from a "
        "data sheet; or a .toml file"
    )
    parser.add_argument("--tolerances", metavar="NAME", default="default", help=text)
    text = "a car file for the nearest explanation, written where the two do not agree; a friction goes beside it"
    parser.add_argument("--suggest", metavar="FILE.toml", type=Path, help=text)
    recordings.add_options(parser)


def run(args: argparse.Namespace) -> int:
    """Print how far they agree, and write it where --out says; the exit code."""
    if args.suggest and args.suggest.suffix != ".toml":
        raise ValueError(f"--suggest {args.suggest}: a car file ends in .toml")
    return recordings.assess([args.measured, args.simulated], args, args.tolerances, compare=True)
