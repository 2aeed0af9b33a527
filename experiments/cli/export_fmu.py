"""The command ``export-fmu``: a subsystem of the plant as a co-simulation unit without Python."""

import argparse
from typing import Any

from steer_env.experiments.cli.common import plant_options
from steer_env.experiments.cli.common.arguments import KPH
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.pages import car_options

# As in steer_env.connect.fmu, whose import takes long.
PLATFORMS = ("linux64", "win64")
VERSIONS = (2, 3)
PROCESSORS = ("x86-64", "x86-64-v2", "x86-64-v3", "x86-64-v4", "native")


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = "Write a co-simulation unit (FMU) that needs no Python where it runs."
    export = commands.add_parser("export-fmu", help=text, description=text, parents=[common])
    plant_options.add(
        export,
        subsystem="what the unit contains",
        speed="held speed that the unit is made for",
        hands="what the hands give at first, the parameter robot of the unit",
    )
    text = "platform to include a binary for; may be repeated (default linux64)"
    export.add_argument("--platform", dest="platforms", choices=PLATFORMS, action="append", help=text)
    export.add_argument("--fmi", type=int, choices=VERSIONS, default=2, help="version of FMI (default 2)")
    text = "least processor of the machine that runs the unit; native is that of this machine (default x86-64-v3)"
    export.add_argument("--cpu", choices=PROCESSORS, default="x86-64-v3", help=text)
    export.add_argument("--out", metavar="FILE.fmu", required=True, help="file to write")
    export.set_defaults(function=_export)


def _export(args: argparse.Namespace) -> None:
    require("fmu", "the export of an FMU")

    from steer_env.connect import fmu
    from steer_env.experiments.pages.options import progress

    car = car_options.load(args)
    with progress("compiling and linking", None) as notify:
        notify(0.0, "compiling and linking")
        path = fmu.export(
            args.out,
            subsystem=args.subsystem,
            friction=args.friction.parameters,
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
