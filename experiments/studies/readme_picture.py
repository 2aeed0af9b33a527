"""Draw docs/feel.svg, the picture of the README."""

import argparse
from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> None:
    """Write the picture."""
    argparse.ArgumentParser(prog="steer-env study readme-picture", description=main.__doc__).parse_args(argv)
