"""The command ``sensitivity``: what parameters do to the metrics of a car, as a heat map."""

import argparse
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common import names
from steer_env.experiments.cli.common.arguments import FRICTION, friction_law, whole_number
from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.cli.common.sweeping import add_sweep, runner, unswept
from steer_env.experiments.pages import car_options

SAMPLES = {"morris": 20, "sobol": 64}


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = (
        "Tell what parameters of the assist, the friction, the load or the car do to every metric and to the margins "
        "of the assist loop, over their whole ranges: a page with heat maps, and sensitivity.json."
    )
    parser = commands.add_parser("sensitivity", help=text, description=text, parents=[common])
    car_options.add(parser)
    text = "packaged target bands, or a .toml file (default compact)"
    parser.add_argument("--targets", metavar="NAME", default="compact", help=text)
    text = f"friction: {FRICTION} (default lugre)"
    parser.add_argument("--friction", metavar="LAW", type=friction_law, default="lugre", help=text)
    text = (
        "parameters in place of the assist's, or those and others with --also: of the assist by name, load, "
        "friction_level, road_friction, speed, friction.KEY of the law, SECTION.KEY of a car file; with a range as "
        "column.K_tb=100:180"
    )
    parser.add_argument("--parameters", metavar="NAME[=LOW:HIGH]", nargs="+", action="extend", help=text)
    text = "parameters beside them, e.g. load friction_level column.K_tb"
    parser.add_argument("--also", metavar="NAME[=LOW:HIGH]", nargs="+", action="extend", default=[], help=text)
    text = "range of the assist's parameters as a part of their tuning range, above 0 to 1 (default 0.5)"
    parser.add_argument("--span", metavar="SHARE", type=float, default=0.5, help=text)
    text = "morris tells most with fewest sets, sobol also shares of the variance (default morris)"
    parser.add_argument("--method", choices=tuple(SAMPLES), default="morris", help=text)
    text = "trajectories of morris (default 20) or base samples of sobol, a power of two (default 64)"
    parser.add_argument("--samples", metavar="N", type=whole_number(1), help=text)
    text = "seed of the draws (default 0)"
    parser.add_argument("--seed", metavar="N", type=whole_number(0), default=0, help=text)
    text = "chassis model of tests that do not need two tracks (default single_track)"
    parser.add_argument("--chassis", choices=names.chassis(), default="single_track", help=text)
    add_sweep(parser)
    text = "directory of the page, replaced as a whole (default sensitivity)"
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("sensitivity"), help=text)
    parser.set_defaults(function=_sensitivity)


def _sensitivity(args: argparse.Namespace) -> None:
    require("tune", "sensitivity", "SALib")

    from steer_env import friction, targets
    from steer_env.experiments.calibration import problem, screening, sensitivity, sensitivity_page
    from steer_env.experiments.pages import provenance
    from steer_env.experiments.pages import study_page as page
    from steer_env.experiments.pages.options import progress

    page.check(args.out, sensitivity_page.NAME)
    sweep, wanted = runner(args), targets.load(args.targets)
    car, law = car_options.load(args), friction.resolve(getattr(args.friction, "parameters", args.friction))
    factors = sensitivity.factors_of(car, law, [*(args.parameters or problem.USED), *args.also], args.span)
    design = screening.design(len(factors), args.method, args.samples or SAMPLES[args.method], args.seed)
    study = sensitivity.Study(car, law, args.chassis, factors)
    label = getattr(args.friction, "label", args.friction)
    with progress("driving") as notify:
        results = sensitivity.collect(study, wanted, label, design, sweep, notify)
    found, data = sensitivity_page.build(results)
    print("\n".join(found.verdict))
    words = unswept(args, "--out")
    trace = provenance.trace(command=words, result=args.out.name, car=car, friction={label: law})
    print(page.write(args.out, found, data, trace))
