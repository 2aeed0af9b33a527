"""Write the car, its steering or its chassis as an FMU that needs no Python."""

import argparse

from steer_env.experiments.cli.common import options
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.cli.common.options import KPH
from steer_env.experiments.pages import car_options

GROUP = "couple"

# As in steer_env.connect.fmu, whose import takes long.
PLATFORMS = ("linux64", "win64", "aarch64", "macos", "source")
VERSIONS = (2, 3)
PROCESSORS = ("x86-64", "x86-64-v2", "x86-64-v3", "x86-64-v4", "native")


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    options.add_plant(
        parser,
        speed="that is held at first, which the FMU takes as a parameter",
        hands=", at first; the parameter robot of the FMU",
    )
    text = "platform to include a binary for, or the sources; may be repeated (default: linux64)"
    parser.add_argument("--platform", dest="platforms", choices=PLATFORMS, action="append", help=text)
    parser.add_argument("--fmi", type=int, choices=VERSIONS, default=2, help="version of FMI (default: 2)")
    text = "least processor of the machine that runs the FMU; native is that of this machine (default: x86-64-v3)"
    parser.add_argument("--cpu", choices=PROCESSORS, default="x86-64-v3", help=text)
    options.add_out(parser, "to write", form="FILE.fmu", required=True)


def run(args: argparse.Namespace) -> None:
    """Write the file."""
    require("fmu", "the export of an FMU")

    from steer_env.connect import fmu
    from steer_env.experiments.pages.options import progress

    car = car_options.load(args)
    with progress("compiling and linking", None) as notify:
        notify(0.0, "compiling and linking")
        path = fmu.export(
            args.out,
            subsystem=args.subsystem,
            friction=options.friction(args, car).parameters,
            vehicle=car.data(),
            chassis=args.chassis,
            speed=args.speed_kph * KPH,
            robot=args.hands == "angle",
            road_friction=args.road_friction,
            platforms=args.platforms or PLATFORMS[:1],
            fmi=args.fmi,
            cpu=args.cpu,
        )
    print(path)
