"""Write the steering as object file and header for the firmware of a Cortex-M7."""

import argparse

from steer_env.experiments.cli.common import options
from steer_env.experiments.cli.common.options import KPH
from steer_env.experiments.pages import car_options

GROUP = "couple"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    options.add(parser, "--friction", otherwise=options.OF_CAR)
    car_options.add(parser)
    options.add(parser, "--speed-kph", "of the vehicle at first, which is an input", 100.0)
    options.add(parser, "--hands", ", at first; the parameter robot", "torque", choices=("torque", "angle"))
    options.add_out(parser, "to write the object file, steering.h, steering.c and an example into", required=True)


def run(args: argparse.Namespace) -> None:
    """Write the files."""
    from steer_env.connect import fmu
    from steer_env.experiments.pages import files

    files.usable(args.out)
    car = car_options.load(args)
    folder = fmu.export_object(
        args.out,
        friction=options.friction(args, car).parameters,
        vehicle=car,
        speed=args.speed_kph * KPH,
        robot=args.hands == "angle",
    )
    print(folder)
