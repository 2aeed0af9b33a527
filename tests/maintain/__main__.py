"""The command line of the maintainers' commands."""

import sys
from collections.abc import Sequence

from steer_env.experiments.cli import main


def run(argv: Sequence[str] | None = None) -> int:
    """Run a command of this folder; its exit code, as :func:`steer_env.experiments.cli.main.main` has it."""
    return main.main(argv, package="tests.maintain", prog="python -m tests.maintain")


if __name__ == "__main__":
    sys.exit(run())
