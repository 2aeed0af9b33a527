"""Measure the requirements on accuracy, feel and cost, and print each with its measured value.

The exit code is 1 where one is missed.
"""

import argparse

from steer_env.experiments.cli.common.extras import require
from steer_env.friction.numerics.registry import modules_by_name

GROUPS = tuple(modules_by_name("tests.verification"))
NEEDS = {"policies": "train", "tuning": "tune"}  # group -> extra


GROUP = "Maintain the package"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    text = f"of {', '.join(GROUPS)} (default: all of them, which takes an hour or more)"
    parser.add_argument("groups", metavar="GROUP", nargs="*", help=f"a group of requirements, {text}")


def run(args: argparse.Namespace) -> int:
    """Measure and print; the exit code."""
    chosen = args.groups or GROUPS
    for name in chosen:
        if name not in GROUPS:
            raise ValueError(f"unknown group {name!r}; there are {', '.join(GROUPS)}")
        if name in NEEDS:
            require(NEEDS[name], f"the group {name}")

    from tests import verification as requirements

    return requirements.print_tables(chosen)
