"""The command ``car``: print a car, or write the page of its derived quantities."""

import argparse
import json
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common import names


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = (
        "Print a car as JSON, with every key that a car file may set, in SI units; with --page derive its understeer, "
        "yaw lag, natural frequencies, free control, parking and kinematics, and compare them with published ranges."
    )
    car = commands.add_parser("car", help=text, description=text, parents=[common])
    car.add_argument("name", metavar="NAME", help=f"{', '.join(names.cars())}, or a .toml or .json file of your own")
    text = "write index.html and car.json with the derived quantities, and print them"
    car.add_argument("--page", action="store_true", help=text)
    text = "directory of the page, replaced as a whole (default car_NAME)"
    car.add_argument("--out", metavar="DIR", help=text)
    car.set_defaults(function=_car)


def _car(args: argparse.Namespace) -> None:
    if args.out and not args.page:
        raise ValueError("--out is the directory of the page: give --page with it")

    from steer_env.vehicle import cars

    if not args.page:
        print(json.dumps(cars.every_key(args.name), indent=2))
        return
    car = cars.load(args.name)
    out = Path(args.out or f"car_{Path(args.name).stem}")

    from steer_env.experiments.cli.common.tables import print_quantities
    from steer_env.experiments.output import files
    from steer_env.experiments.output.options import progress
    from steer_env.experiments.report import car_page

    files.usable(out, car_page.CONTENTS)
    with progress("compiling and driving", None) as notify:
        notify(0.0, "compiling and driving")
        found = car_page.build(out, car, cars.every_key(args.name))
    print_quantities(found, car.name)
    print(out / "index.html")
