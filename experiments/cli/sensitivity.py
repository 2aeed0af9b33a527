"""Tell what parameters do to metrics and to the margins of the assist, as heat maps.

The parameters are those of the assist, the friction, the load or the car, over their whole ranges. The page comes with
sensitivity.json.
"""

import argparse

from steer_env.experiments.cli.common import names, options
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.cli.common.sweeping import add_sweep, runner, unswept
from steer_env.experiments.pages import car_options

GROUP = "car"
SAMPLES = {"morris": 20, "sobol": 64}


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    car_options.add(parser)
    options.add(parser, "--targets", default="compact")
    options.add(parser, "--friction", otherwise=options.OF_CAR)
    text = (
        ": of the assist by name, load, friction_level, road_friction, speed, friction.KEY of the law or "
        "friction.SITE.KEY of sites, SECTION.KEY of a car file; with a range as column.K_tb=100:180"
    )
    options.add(parser, "--parameters", text, otherwise="those of the assist", nargs="+", action="extend")
    text = "parameters beside those of --parameters, e.g. load friction_level column.K_tb"
    parser.add_argument("--also", metavar="NAME", nargs="+", action="extend", default=[], help=text)
    text = "range of the assist's parameters as a part of their tuning range, above 0 to 1 (default: 0.5)"
    parser.add_argument("--span", metavar="SHARE", type=options.real, default=0.5, help=text)
    text = "morris tells most with fewest sets, sobol also shares of the variance (default: morris)"
    parser.add_argument("--method", choices=tuple(SAMPLES), default="morris", help=text)
    text = "trajectories of morris (default: 20) or base samples of sobol, a power of two (default: 64)"
    parser.add_argument("--samples", metavar="N", type=options.whole_number(1), help=text)
    options.add(parser, "--seed", "of the draws", 0)
    options.add(parser, "--chassis", ", for tests that do not need two tracks", "single_track", choices=names.chassis())
    add_sweep(parser)
    options.add_page(parser, "of the page, replaced as a whole", "sensitivity")


def run(args: argparse.Namespace) -> None:
    """Write the page, and print its verdict."""
    require("tune", "sensitivity", "SALib")

    from steer_env import targets
    from steer_env.experiments.calibration import problem, screening, sensitivity, sensitivity_page
    from steer_env.experiments.pages import pages as page
    from steer_env.experiments.pages import provenance
    from steer_env.experiments.pages.options import progress
    from steer_env.friction.sites import Sites

    page.check(args.out, sensitivity_page.NAME)
    sweep, wanted = runner(args), targets.load(args.targets)
    car = car_options.load(args)
    law = options.friction(args, car)
    given = law.text if isinstance(law.parameters, Sites) else law.parameters
    factors = sensitivity.factors_of(car, given, [*(args.parameters or problem.USED), *args.also], args.span)
    design = screening.design(len(factors), args.method, args.samples or SAMPLES[args.method], args.seed)
    study = sensitivity.Study(car, given, args.chassis, factors)
    with progress("driving") as notify:
        results = sensitivity.collect(study, wanted, law.label, design, sweep, notify)
    found, data = sensitivity_page.build(results)
    print("\n".join(found.verdict))
    words = unswept(args, "--out")
    trace = provenance.trace(command=words, result=args.out.name, car=car, friction={law.label: law.parameters})
    print(page.write(args.out, found, data, trace))
