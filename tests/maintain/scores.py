"""Write the page of scores, and the reward thresholds, from a folder of 'steer-env benchmark'."""

import argparse
import sys
from pathlib import Path

from steer_env.experiments.cli.common import options

GROUP = "Maintain the package"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("folder", metavar="DIR", type=Path, help="in which the result files are")
    options.add_out(parser, "for the page, beside standard output", form="FILE.md", otherwise="none is written")
    text = "JSON file for the reward_threshold of each id, in which the others are kept"
    parser.add_argument("--thresholds", metavar="FILE.json", type=Path, help=text)


def run(args: argparse.Namespace) -> None:
    """Print the page, and write what is asked for."""
    from steer_env.experiments.pages.files import write_text
    from steer_env.experiments.reports import benchmark_page
    from tests.tools import scores

    found = benchmark_page.standings(benchmark_page.read(args.folder))
    page = scores.markdown(found)
    sys.stdout.write(page)
    if args.out:
        write_text(args.out, page)
    if args.thresholds:
        scores.write_thresholds(args.thresholds, scores.thresholds(found))
