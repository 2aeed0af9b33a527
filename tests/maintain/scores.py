"""Write the scores that the site shows, and the reward thresholds, from a folder of 'steer-env benchmark'."""

import argparse
from pathlib import Path

GROUP = "Maintain the package"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("folder", metavar="DIR", type=Path, help="in which the result files are")
    text = "JSON file for the scores without episodes; tests/tools/scores.json is that of the site"
    parser.add_argument("--out", metavar="FILE.json", type=Path, required=True, help=text)
    text = "JSON file for the reward_threshold of each id, in which the others are kept"
    parser.add_argument("--thresholds", metavar="FILE.json", type=Path, help=text)


def run(args: argparse.Namespace) -> None:
    """Write the scores, and the thresholds where they are asked for."""
    from steer_env.experiments.reports import benchmark_page
    from tests.tools import scores

    found = benchmark_page.read(args.folder)
    scores.write(args.out, found)
    if args.thresholds:
        scores.write_thresholds(args.thresholds, scores.thresholds(found))
