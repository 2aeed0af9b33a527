"""Write the reference pages that are made of the program: docs/metrics.md and docs/environments.md.

The pages of a checkout are replaced; an installed package has none.
"""

import argparse

GROUP = "Maintain the package"


def add(parser: argparse.ArgumentParser) -> None:
    """Add no option."""


def run(args: argparse.Namespace) -> None:
    """Write both pages."""
    from tests.tools import glossary

    for path in glossary.write():
        print(path)
