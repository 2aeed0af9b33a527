"""Write a page in which sliders change friction law and car and a weave is redrawn at once; it needs no server.

index.html opens from disk, and from any static host; it asks the network for nothing. Each law on each chassis is
compiled once, which takes a minute or more.
"""

import argparse

from steer_env.experiments.cli.common import names, options
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.pages import car_options

GROUP = "car"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    laws = names.laws()
    text = f"friction law of the page, which begins with the first; may be repeated: {', '.join(laws)} (default: five)"
    parser.add_argument("--law", dest="laws", metavar="LAW", choices=laws, action="append", help=text)
    text = "chassis of the page, which begins with the first; may be repeated (default: both)"
    parser.add_argument("--chassis", dest="bodies", choices=names.chassis(), action="append", help=text)
    car_options.add(parser)
    options.add_out(parser, "to write the page into", required=True)


def run(args: argparse.Namespace) -> None:
    """Write the folder."""
    require("explore", "the page")

    from steer_env.experiments import explore
    from steer_env.experiments.explore.writing import LAWS_SHOWN
    from steer_env.experiments.pages.options import progress

    car = car_options.load(args)
    with progress("compiling") as notify:
        page = explore.explore(
            args.out,
            vehicle=car,
            friction=args.laws or LAWS_SHOWN,
            chassis=args.bodies or names.chassis(),
            notify=notify,
        )
    print(page)
