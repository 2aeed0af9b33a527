"""The command ``car``: print a packaged car."""

import argparse
import json
from typing import Any

from steer_env.experiments.cli.common import names


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = "Print a packaged car as JSON, with every key that a car file may set, in SI units."
    car = commands.add_parser("car", help=text, description=text, parents=[common])
    car.add_argument("name", metavar="NAME", choices=names.cars(), help=", ".join(names.cars()))
    car.set_defaults(function=_car)


def _car(args: argparse.Namespace) -> None:
    from steer_env.vehicle import cars

    print(json.dumps(cars.every_key(args.name), indent=2))
