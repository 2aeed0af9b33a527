"""Print a car with every key, write a new car file, or a page of derived quantities.

The keys are printed as JSON in SI units. The page derives understeer, yaw lag, natural frequencies, free control,
parking and kinematics, and compares them with published ranges.
"""

import argparse
import json
from pathlib import Path

from steer_env.experiments.cli.common import names, options
from steer_env.experiments.pages import car_options

GROUP = "car"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    text = f"{', '.join(names.cars())}, or a .toml or .json file of your own"
    parser.add_argument("name", metavar="NAME", nargs="?", help=text)
    text = "write a new car file in which a comment explains every key"
    parser.add_argument("--new", metavar="FILE.toml", help=text)
    text = "car that the new file begins with (default: compact)"
    parser.add_argument("--base", metavar="NAME", help=text)
    car_options.add_changes(parser)
    text = "write index.html and car.json with the derived quantities, and print them"
    parser.add_argument("--page", action="store_true", help=text)
    options.add_page(parser, "of the page, replaced as a whole", otherwise="car_NAME")
    options.add_live(parser, "the car with its own friction, and with LuGre and Masing")
    parser.set_defaults(vehicle=None)


def run(args: argparse.Namespace) -> None:
    """Print the car, or write its file or page."""
    if args.out and not args.page:
        raise ValueError("--out is the directory of the page: give --page with it")
    if args.live and not args.page:
        raise ValueError("--live is beside the page: give --page with it")
    if args.new:
        _new(args)
        return
    if args.base or args.name is None:
        raise ValueError("give the NAME of a car; --base belongs to --new")
    args.vehicle = args.name if args.vehicle is None else args.vehicle  # of a trace

    car = car_options.load(args)
    if not args.page:
        print(json.dumps(car.data(), indent=2))
        return
    out = Path(args.out or f"car_{car.name}")
    live = options.live_page_beside(args)

    from steer_env.experiments.cli.common.tables import print_quantities
    from steer_env.experiments.pages import files, provenance
    from steer_env.experiments.pages.options import progress
    from steer_env.experiments.reports import car_page
    from steer_env.friction import resolve

    files.usable(out, car_page.CONTENTS)
    with progress("compiling and driving", None) as notify:
        notify(0.0, "compiling and driving")
        trace = provenance.trace(command=args.argv, result=out.name, car=car)
        beside = live(car, {law: resolve(law) for law in (car.friction, "lugre", "masing")}) if live else None
        found = car_page.write_car_page(out, car, trace, beside)
    print_quantities(found, car.name)
    print(out / "index.html")


def _new(args: argparse.Namespace) -> None:
    """Write a commented car file; one that is there already stays."""
    from steer_env.vehicle import cars

    path = Path(args.new)
    if args.name is not None or args.page:
        raise ValueError(
            "--new FILE.toml takes neither NAME nor --page: give the car that it begins with as --base NAME"
        )
    if path.exists():
        raise ValueError(f"{path} is there already: give another name, or remove it")
    if not path.absolute().parent.is_dir():
        raise ValueError(f"--new {path}: there is no directory {path.parent}")
    args.vehicle = args.base
    cars.write(car_options.load(args)._replace(name=path.stem), path, comments=True)
    print(path)
