"""Tell which share of cars built with tolerances stays in the target bands.

Parameters are drawn from their tolerances, each car is driven through the tests, and the page tells the share in the
bands, by metric and in total, each with its interval, and which parameter drives failures. The page comes with
production.json, which holds the table of all cars.
"""

import argparse

from steer_env.experiments.cli.common import names, options
from steer_env.experiments.cli.common.sweeping import add_sweep, runner, unswept
from steer_env.experiments.pages import car_options

GROUP = "car"
# What parts and assembly are said to hold; assumed.
TOLERANCES = (
    *("column.K_tb=5%", "friction_level=0.7:1.3", "boost_level=5%", "damping_level=10%", "steering.compliance=10%"),
    *("chassis.front_cornering_stiffness_factor=5%", "chassis.rear_cornering_stiffness_factor=5%"),
)
CARS = 200


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    car_options.add(parser)
    options.add(parser, "--targets", default="compact")
    options.add(parser, "--friction", default="lugre")
    text = (
        "tolerances, each NAME=P%% of the car's own value or NAME=LOW:HIGH: parameters of the assist by name, load, "
        f"friction_level, road_friction, friction.KEY of the law, SECTION.KEY of a car file (default: "
        f"{' '.join(TOLERANCES).replace('%', '%%')}, assumed)"
    )
    parser.add_argument("--tolerances", metavar="NAME=TOLERANCE", nargs="+", action="extend", help=text)
    options.add(
        parser,
        "--manoeuvre",
        ", or several; each with bands in the targets",
        otherwise="those of the targets",
        nargs="+",
        action="extend",
    )
    text = "of a parameter over its tolerance; normal: three standard deviations to its ends (default: uniform)"
    parser.add_argument("--distribution", choices=("uniform", "normal"), default="uniform", help=text)
    text = f"number of cars (default: {CARS})"
    parser.add_argument("--cars", metavar="N", type=options.whole_number(1), default=CARS, help=text)
    options.add(parser, "--seed", "of the draws", 0)
    options.add(parser, "--chassis", ", for tests that do not need two tracks", "single_track", choices=names.chassis())
    add_sweep(parser)
    options.add_page(parser, "of the page, replaced as a whole", "production")


def run(args: argparse.Namespace) -> None:
    """Write the page, and print its verdict."""
    from steer_env import friction, targets
    from steer_env.experiments.calibration import population, production, production_page
    from steer_env.experiments.pages import pages as page
    from steer_env.experiments.pages import provenance
    from steer_env.experiments.pages.options import progress
    from steer_env.friction.sites import Sites

    page.check(args.out, production_page.NAME)
    sweep, wanted = runner(args), targets.load(args.targets)
    given = getattr(args.friction, "text", args.friction)
    car, law = car_options.load(args), friction.resolve(given)
    label = getattr(args.friction, "label", args.friction)
    tests = args.manoeuvre or [test for test, bands in wanted.bands.items() if bands]
    tolerances = population.tolerances(args.tolerances or TOLERANCES)
    study = population.study_of(
        car, given if isinstance(law, Sites) else law, args.chassis, tolerances, tests, "--tolerances"
    )
    with progress("driving") as notify:
        results = production.collect(study, wanted, label, args.cars, args.seed, args.distribution, sweep, notify)
    found, data = production_page.build(results)
    print("\n".join(found.verdict))
    words = unswept(args, "--out")
    trace = provenance.trace(command=words, result=args.out.name, car=car, friction={label: law}, seed=args.seed)
    print(page.write(args.out, found, data, trace))
