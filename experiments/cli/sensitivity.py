"""Tell what parameters do to metrics and to the margins of the assist, as heat maps.

The parameters are those of the assist, the friction, the load or the car, over a range of each. With --method
production they are tolerances, and the page tells which share of cars that are built with them stays in the target
bands, and what drives failures. The page comes with sensitivity.json or production.json.
"""

import argparse
from typing import TYPE_CHECKING, Any

from steer_env.experiments.cli.common import names, options
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.cli.common.sweeping import add_sweep, runner, unswept
from steer_env.experiments.pages import car_options

if TYPE_CHECKING:
    from steer_env.experiments.calibration.production import Results as Production
    from steer_env.experiments.calibration.sensitivity import Results
    from steer_env.experiments.pages.options import Friction
    from steer_env.experiments.sweep import Runner
    from steer_env.targets import Targets
    from steer_env.vehicle.cars import Car

GROUP = "car"
PRODUCTION = "production"
SAMPLES = {"morris": 20, "sobol": 64, PRODUCTION: 200}
SPAN = 0.5
# What parts and assembly are said to hold; assumed.
TOLERANCES = (
    *("column.K_tb=5%", "friction_level=0.7:1.3", "boost_level=5%", "damping_level=10%", "steering.compliance=10%"),
    *("chassis.front_cornering_stiffness_factor=5%", "chassis.rear_cornering_stiffness_factor=5%"),
)


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    car_options.add(parser)
    options.add(parser, "--targets", default="compact")
    options.add(parser, "--friction", otherwise=options.OF_CAR)
    text = (
        ": of the assist by name, load, friction_level, road_friction, speed, friction.KEY of the law or "
        "friction.SITE.KEY of sites, SECTION.KEY of a car file; with a range as column.K_tb=100:180, of production "
        "also with a tolerance as column.K_tb=5%%"
    )
    usual = "those of the assist, of production seven tolerances"
    options.add(parser, "--parameters", text, otherwise=usual, nargs="+", action="extend")
    text = "parameters beside those of --parameters, e.g. load friction_level column.K_tb"
    parser.add_argument("--also", metavar="NAME", nargs="+", action="extend", default=[], help=text)
    text = f"range of the assist's parameters as a part of their tuning range, above 0 to 1 (default: {SPAN:g})"
    parser.add_argument("--span", metavar="SHARE", type=options.real, help=text)
    text = (
        "morris tells most with fewest sets, sobol also shares of the variance; production draws cars from tolerances "
        "(default: morris)"
    )
    parser.add_argument("--method", choices=tuple(SAMPLES), default="morris", help=text)
    text = (
        "trajectories of morris (default: 20), base samples of sobol, a power of two (default: 64), or cars of "
        "production (default: 200)"
    )
    parser.add_argument("--samples", metavar="N", type=options.whole_number(1), help=text)
    text = "of production, over a tolerance; normal: three standard deviations to its ends (default: uniform)"
    parser.add_argument("--distribution", choices=("uniform", "normal"), help=text)
    text = ", or several, of production"
    options.add(parser, "--manoeuvre", text, otherwise="those of the targets", nargs="+", action="extend")
    options.add(parser, "--seed", "of the draws", 0)
    options.add(parser, "--chassis", ", for tests that do not need two tracks", "single_track", choices=names.chassis())
    add_sweep(parser)
    options.add_page(parser, "of the page, replaced as a whole", "sensitivity")


def run(args: argparse.Namespace) -> None:
    """Write the page, and print its verdict."""
    others = ("span",) if args.method == PRODUCTION else ("distribution", "manoeuvre")
    for name in others:
        if getattr(args, name) is not None:
            raise ValueError(f"--{name} has no effect with --method {args.method}: leave it out")
    if args.method != PRODUCTION:
        require("tune", "sensitivity", "SALib")

    from steer_env import targets
    from steer_env.experiments.calibration import production_page, sensitivity_page
    from steer_env.experiments.pages import pages as page
    from steer_env.experiments.pages import provenance

    produced = args.method == PRODUCTION
    page.check(args.out, production_page.NAME if produced else sensitivity_page.NAME)
    sweep, wanted = runner(args), targets.load(args.targets)
    car = car_options.load(args)
    law = options.friction(args, car)
    if produced:
        found, data = production_page.build(_production(args, car, law, wanted, sweep))
    else:
        found, data = sensitivity_page.build(_effects(args, car, law, wanted, sweep))
    print("\n".join(found.verdict))
    words = unswept(args, "--out")
    trace = provenance.trace(command=words, result=args.out.name, car=car, friction={law.label: law.parameters})
    print(page.write(args.out, found, data, trace))


def _law_with_sites(law: "Friction") -> Any:
    """A law in a form that names its sites, of which parameters are varied."""
    from steer_env.friction.sites import Sites

    return law.text if isinstance(law.parameters, Sites) else law.parameters


def _effects(args: argparse.Namespace, car: "Car", law: "Friction", wanted: "Targets", sweep: "Runner") -> "Results":
    from steer_env.experiments.calibration import problem, screening, sensitivity
    from steer_env.experiments.pages.options import progress

    span, given = SPAN if args.span is None else args.span, _law_with_sites(law)
    factors = sensitivity.factors_of(car, given, [*(args.parameters or problem.USED), *args.also], span)
    design = screening.design(len(factors), args.method, args.samples or SAMPLES[args.method], args.seed)
    study = sensitivity.Study(car, given, args.chassis, factors)
    with progress("driving") as notify:
        return sensitivity.collect(study, wanted, law.label, design, sweep, notify)


def _production(
    args: argparse.Namespace, car: "Car", law: "Friction", wanted: "Targets", sweep: "Runner"
) -> "Production":
    from steer_env.experiments.calibration import population, production
    from steer_env.experiments.pages.options import progress

    tests = args.manoeuvre or [test for test, bands in wanted.bands.items() if bands]
    tolerances = population.tolerances([*(args.parameters or TOLERANCES), *args.also])
    study = population.study_of(car, _law_with_sites(law), args.chassis, tolerances, tests, "--parameters")
    n, kind = args.samples or SAMPLES[PRODUCTION], args.distribution or "uniform"
    with progress("driving") as notify:
        return production.collect(study, wanted, law.label, n, args.seed, kind, sweep, notify)
