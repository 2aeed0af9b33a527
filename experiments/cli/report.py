"""The command ``report``: the evaluation report of several friction laws."""

import argparse
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common import inputs, names, noticed
from steer_env.experiments.cli.common.arguments import EXTERNAL, FRICTION, external_vehicle, friction_law
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.experiments.pages import car_options

COMPARED = ("lugre", "masing")  # the two laws that the literature compares, which come first


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = "Drive every manoeuvre with every law, run the studies, and write index.html and metrics.json."
    report = commands.add_parser("report", help=text, description=text, parents=[common])
    text = f"{FRICTION}; default: all laws ({', '.join(names.laws())})"
    report.add_argument("--friction", metavar="LAW", type=friction_law, nargs="+", action="extend", help=text)
    car_options.add(report)
    text = f"{EXTERNAL}; it drives every test in place of the chassis of this project (default: none)"
    report.add_argument("--chassis", metavar="FILE", type=external_vehicle, help=text)
    text = "pictures in place of interactive plots: a page of less than 1 MB, to mail or to print"
    report.add_argument("--light", action="store_true", help=text)
    noticed.add(report)
    add_sweep(report)
    text = "directory, replaced as a whole (default report)"
    report.add_argument("--out", metavar="DIR", default="report", help=text)
    report.set_defaults(function=_report)


def _report(args: argparse.Namespace) -> None:
    from steer_env import friction
    from steer_env.experiments.pages.options import Friction, progress

    every_law = sorted(friction.available(), key=lambda name: name not in COMPARED)
    laws = args.friction or [Friction(name) for name in every_law]
    labels = [law.label for law in laws]
    for label in labels:
        if labels.count(label) > 1:
            raise ValueError(f"--friction names {label!r} twice")

    sweep = runner(args)
    look = {"light": args.light, "noticed": noticed.share(args)}
    car = car_options.load(args)

    from steer_env.experiments.pages import provenance
    from steer_env.experiments.reports import build
    from steer_env.experiments.reports.results import Scope

    parameters = {law.label: law.parameters for law in laws}
    result = Path(args.out).name
    trace = provenance.trace(command=args.argv, result=result, car=car, friction=parameters, inputs=inputs.of(args))
    with progress("compiling and driving") as notify:
        scope = (
            Scope(car=car) if args.chassis is None else Scope(car=car, chassis=args.chassis, vehicle=False, widths=())
        )
        build.build(args.out, parameters, scope, notify, build.Look(**look), trace, sweep)
    print(Path(args.out) / "index.html")
