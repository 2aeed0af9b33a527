"""Write what is made of the program: docs/metrics.md, docs/environments.md and the tables of docs/car_files.md.

The pages of a checkout are replaced; an installed package has none.
"""

import argparse

GROUP = "Maintain the package"


def add(parser: argparse.ArgumentParser) -> None:
    """Add no option."""


def run(args: argparse.Namespace) -> None:
    """Write the pages."""
    from tests.tools import glossary

    for path in glossary.write():
        print(path)
