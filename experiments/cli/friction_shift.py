"""The command ``friction-shift``, the former name of ``shift --over law``."""

import argparse
import sys
from typing import Any

from steer_env.experiments.cli import shift
from steer_env.friction.numerics.renamed import REMOVED_IN


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = f"Former name of 'steer-env shift --over law'; release {REMOVED_IN} removes it."
    parser = commands.add_parser("friction-shift", help=text, description=text, parents=[common])
    shift.add_options(parser)
    parser.set_defaults(function=_shift, over=["law"])


def _shift(args: argparse.Namespace) -> None:
    new = "steer-env shift --over law"
    print(f"steer-env friction-shift is now {new!r}; release {REMOVED_IN} removes the old name", file=sys.stderr)
    shift.shift(args)
