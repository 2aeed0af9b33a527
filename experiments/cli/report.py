"""Drive every manoeuvre with every law, and write the evaluation report.

The report is index.html with metrics.json. It also holds the studies.
"""

import argparse
import gc

from steer_env.experiments.cli.common import inputs, names, options
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.experiments.pages import car_options

GROUP = "test"
COMPARED = ("lugre", "masing")  # the two laws that the literature compares, which come first


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    every = f"that of the car, and all laws at one site that differ by default, of {', '.join(names.laws())}"
    options.add(parser, "--friction", otherwise=every, nargs="+", action="extend")
    car_options.add(parser)
    text = f": {options.EXTERNAL}, which drives every test in place of those of this project"
    options.add(parser, "--chassis", text, otherwise="none", type=options.external_vehicle)
    options.add_noticed(parser)
    add_sweep(parser)
    options.add_page(parser, "of the report, replaced as a whole", "report", full=True)
    options.add_live(parser, "the car with these laws")


def run(args: argparse.Namespace) -> None:
    """Write the report."""
    from steer_env.experiments.pages.options import Friction, progress
    from steer_env.friction.law import LAWS

    own = [name for name, law in LAWS.all().items() if not law.extends]
    every_law = sorted(own, key=lambda name: name not in COMPARED)
    car = car_options.load(args)
    laws = args.friction or [Friction(name) for name in (car.friction, *every_law)]
    labels = [law.label for law in laws]
    for label in labels:
        if labels.count(label) > 1:
            raise ValueError(f"--friction names {label!r} twice")

    live = options.live_page_beside(args)
    if live and args.chassis:
        raise ValueError("--live shows the chassis of this project, not an external one: leave --chassis out")
    sweep = runner(args)
    look = {"full": args.full, "noticed": options.noticeable_share(args)}

    from steer_env.experiments.pages import provenance
    from steer_env.experiments.reports import report, report_findings
    from steer_env.experiments.reports.report_results import Scope

    gc.freeze()  # what is imported stays, and no collection of garbage looks through it again
    parameters = {law.label: law.parameters for law in laws}
    trace = provenance.trace(
        command=args.argv, result=args.out.name, car=car, friction=parameters, inputs=inputs.trace_inputs(args)
    )
    with progress("compiling and driving") as notify:
        scope = (
            Scope(car=car) if args.chassis is None else Scope(car=car, chassis=args.chassis, vehicle=False, widths=())
        )
        beside = live(car, {law.label: law.text for law in laws}) if live else None
        results = report.build_report(args.out, parameters, scope, notify, report.Look(**look), trace, sweep, beside)
    print(report_findings.verdict(results, report_findings.terms(results, look["noticed"])))
    print(args.out / "index.html")
