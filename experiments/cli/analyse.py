"""The command ``analyse``: the linearised car and the margins of its assist loop as a page."""

import argparse
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common import names
from steer_env.experiments.cli.common.arguments import FRICTION, friction_law
from steer_env.experiments.pages import car_options


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = (
        "Linearise a car with its assist and write a page: the margins of the assist loop over speed, torque, hands "
        "and friction, its Nyquist curves, the frequency responses of the car, and the modes over speed and boost."
    )
    analyse = commands.add_parser("analyse", help=text, description=text, parents=[common])
    car_options.add(analyse)
    text = f"friction at rest: {FRICTION} (default lugre)"
    analyse.add_argument("--friction", metavar="LAW", type=friction_law, default="lugre", help=text)
    text = "chassis model (default single_track)"
    analyse.add_argument("--chassis", choices=names.chassis(), default="single_track", help=text)
    text = "directory of the page, replaced as a whole (default analyse)"
    analyse.add_argument("--out", metavar="DIR", type=Path, default=Path("analyse"), help=text)
    analyse.set_defaults(function=_analyse)


def _analyse(args: argparse.Namespace) -> None:
    from steer_env import friction
    from steer_env.experiments.pages import provenance
    from steer_env.experiments.pages import study_page as page
    from steer_env.experiments.pages.options import progress
    from steer_env.experiments.reports import analysis, analysis_page

    page.check(args.out, analysis.NAME)
    car = car_options.load(args)
    with progress("linearising") as notify:
        results = analysis.collect(car, args.friction, args.chassis, notify)
    found, data = analysis_page.build(results)
    print("\n".join(found.verdict))
    law = friction.resolve(getattr(args.friction, "parameters", args.friction))
    words = _without_out(args.argv)
    trace = provenance.trace(command=words, result=args.out.name, car=car, friction={results.law: law})
    print(page.write(args.out, found, data, trace))


def _without_out(argv: list[str]) -> list[str]:
    """The words of the command without the place of the page, which does not depend on it."""
    placed = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    placed.add_argument("--out")
    return placed.parse_known_args(argv)[1]
