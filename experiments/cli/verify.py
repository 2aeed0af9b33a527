"""The command ``verify``: every requirement with its measured value."""

import argparse
from typing import Any

from steer_env.friction.numerics.registry import listed

NEEDS = {"policies": "train", "tuning": "tune"}  # group -> extra


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    groups = tuple(listed("steer_env.experiments.verification.requirements"))
    text = "Measure the requirements on accuracy, feel and cost, and print each with its measured value."
    more = f"{text} The exit code is 1 where one is missed. Groups: {', '.join(groups)}."
    verify = commands.add_parser("verify", help=text, description=more, parents=[common])
    text = "a group of requirements; default: all of them, which takes an hour or more"
    verify.add_argument("groups", metavar="GROUP", nargs="*", help=text)
    verify.set_defaults(function=lambda args: _verify(args, groups))


def _verify(args: argparse.Namespace, groups: tuple[str, ...]) -> int:
    from steer_env.experiments.cli.common.extras import require

    chosen = args.groups or groups
    for name in chosen:
        if name not in groups:
            raise ValueError(f"unknown group {name!r}; there are {', '.join(groups)}")
        if name in NEEDS:
            require(NEEDS[name], f"the group {name}")

    from steer_env.experiments.verification import requirements

    return requirements.print_tables(chosen)
