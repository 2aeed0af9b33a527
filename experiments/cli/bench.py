"""Time the steps of the environments side by side with other packages.

CartPole-v1 and Pendulum-v1 of Gymnasium, EnvPool's Pendulum, highway-env's parking and racetrack and CommonRoad's
right-hand sides run in turns with this project's environments, single and vector; ratios are medians over the rounds of
one run. What is not installed is left out with a note: pip install '.[bench]'.
"""

import argparse
import tempfile

from steer_env.experiments.cli.common import options

GROUP = "learn"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    options.add(parser, "--seconds", "of the measurement of steps; at least ten rounds are measured", 60.0)
    options.add_out(parser, "for all numbers", form="FILE.json", otherwise="none")


def run(args: argparse.Namespace) -> None:
    """Measure, print the tables, and write the numbers where ``--out`` says."""
    from steer_env.experiments.cli.common.tables import print_times
    from steer_env.experiments.pages import provenance
    from steer_env.experiments.pages.files import write_json
    from steer_env.experiments.pages.options import progress
    from steer_env.experiments.studies.common import step_time
    from steer_env.friction.numerics.check import positive

    seconds = positive("--seconds", args.seconds)
    if args.out is not None and not args.out.resolve().parent.is_dir():
        raise ValueError(f"--out {args.out}: there is no directory {args.out.parent}")
    cases, notes = step_time.cases()
    with progress("timing") as notify:
        found = step_time.measure(cases, 0.9 * seconds, lambda part: notify(0.7 * part, "steps"))
        of_plant = step_time.measure_plants(0.1 * seconds)
        notify(0.75, "first steps")
        with tempfile.TemporaryDirectory() as cache:
            starts = step_time.starts(cases, cache)
    print_times(found, of_plant, starts, notes)
    if args.out is not None:
        numbers = step_time.as_json(found, of_plant, starts, notes)
        write_json(args.out, {**numbers, "versions": provenance.versions()})
        print(args.out)
