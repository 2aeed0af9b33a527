"""Linearise a car: margins of its assist, frequency responses and modes, as a page.

The page shows the margins of the assist loop over speed, torque, hands and friction, its Nyquist curves, the frequency
responses of the car, and the modes over speed and boost.
"""

import argparse

from steer_env.experiments.cli.common import names, options
from steer_env.experiments.pages import car_options

GROUP = "car"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    car_options.add(parser)
    options.add(parser, "--friction", ", at rest", otherwise=options.OF_CAR)
    options.add(parser, "--chassis", default="single_track", choices=names.chassis())
    options.add_page(parser, "of the page, replaced as a whole", "analyse")


def run(args: argparse.Namespace) -> None:
    """Write the page, and print its verdict."""
    from steer_env.experiments.pages import pages as page
    from steer_env.experiments.pages import provenance
    from steer_env.experiments.pages.options import progress
    from steer_env.experiments.reports import analysis, analysis_page

    page.check(args.out, analysis.PAGE_NAME)
    car = car_options.load(args)
    law = options.friction(args, car)
    with progress("linearising") as notify:
        results = analysis.collect(car, law, args.chassis, notify)
    found, data = analysis_page.build_page(results)
    print("\n".join(found.verdict))
    words = _without_out(args.argv)
    trace = provenance.trace(command=words, result=args.out.name, car=car, friction={law.label: law.parameters})
    print(page.write(args.out, found, data, trace))


def _without_out(argv: list[str]) -> list[str]:
    """The words of the command without the place of the page, which does not depend on it."""
    placed = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    placed.add_argument("--out")
    return placed.parse_known_args(argv)[1]
