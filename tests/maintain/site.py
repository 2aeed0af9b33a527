"""Build the site of the documentation, without a network.

``make docs`` runs it in an environment with the extra ``docs``. A warning of Sphinx, as of a link that leads nowhere,
ends in exit code 1.
"""

import argparse

from steer_env.experiments.cli.common import options
from steer_env.experiments.cli.common.extras import require

GROUP = "Maintain the package"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the option."""
    options.add_out(parser, "of the site, replaced as a whole", "build/docs")


def run(args: argparse.Namespace) -> int:
    """Build the site."""
    require("docs", "building the site")

    from tests.tools import site

    code = site.build(args.out)
    print(args.out / "index.html")
    return code
