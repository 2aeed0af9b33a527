"""Write a page with sliders for friction law and car: manoeuvres redrawn, and a drive.

index.html opens from disk, and from any static host; it asks the network for nothing. Each law on each chassis is
compiled once, which takes some ten to thirty seconds.
"""

import argparse

from steer_env.experiments.cli.common import names, options
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.pages import car_options

GROUP = "car"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    text = "; here by name alone, or sites as LAW[,key=value...]@SITE, joined by +; the page begins with the first"
    usual = "that of the car, and five laws at one site"
    options.add(parser, "--friction", text, otherwise=usual, nargs="+", action="extend")
    options.add(
        parser,
        "--chassis",
        "; the page begins with the first",
        otherwise="both",
        choices=names.chassis(),
        nargs="+",
        action="extend",
    )
    car_options.add(parser)
    options.add_out(parser, "to write the page into", required=True)


def run(args: argparse.Namespace) -> None:
    """Write the folder."""
    require("explore", "the page")

    from steer_env.experiments import explore
    from steer_env.experiments.pages.options import progress

    laws = [each.text for each in args.friction] if args.friction else None
    car = car_options.load(args)
    with progress("compiling") as notify:
        page = explore.explore(
            args.out, vehicle=car, friction=laws, chassis=args.chassis or names.chassis(), notify=notify
        )
    print(page)
