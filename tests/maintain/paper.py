"""Make the tables and pictures of docs/paper.md, and the paper as a page to print.

Short measurements run here; the answer of the friction study, the scores and longer checks are taken from their pages.
"""

import argparse

from steer_env.experiments.cli.common import options
from steer_env.experiments.cli.common.extras import require

GROUP = "Maintain the package"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    options.add_out(parser, "of the page to print, replaced as a whole", "build/paper")
    text = "measure nothing: only what is taken from other pages is written anew"
    parser.add_argument("--taken", action="store_true", help=text)


def run(args: argparse.Namespace) -> int:
    """Make them; the exit code of Sphinx."""
    require("docs", "the page to print")

    from steer_env.experiments.pages.options import progress
    from tests.tools import paper, site

    with progress("measuring") as notify:
        paper.write({} if args.taken else paper.measured(notify))
    code = site.single(paper.PAGE, args.out)
    print(paper.PAGE, args.out / "index.html", sep="\n")
    return code
