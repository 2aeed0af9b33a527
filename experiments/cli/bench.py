"""Time the steps of the environments side by side with other packages.

CartPole-v1 and Pendulum-v1 of Gymnasium, EnvPool's Pendulum, highway-env's parking and racetrack and CommonRoad's
right-hand sides run in turns with this project's environments, single and vector; ratios are medians over the rounds of
one run. What is not installed is left out with a note. The page comes with bench.json.
"""

import argparse
import tempfile

from steer_env.experiments.cli.common import options

GROUP = "learn"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    options.add(parser, "--seconds", "of the measurement of steps; at least ten rounds are measured", 60.0)
    text = "1 and 4,096 rows, with the friction of the car alone, and no first steps"
    parser.add_argument("--quick", action="store_true", help=text)
    options.add_page(parser, "of the page, replaced as a whole", "bench")


def run(args: argparse.Namespace) -> None:
    """Measure, write the page, and print its verdict."""
    from steer_env.experiments.pages import pages as page
    from steer_env.experiments.pages import provenance
    from steer_env.experiments.pages.options import progress
    from steer_env.experiments.reports import bench
    from steer_env.experiments.studies.common import step_time
    from steer_env.friction.numerics.check import positive

    seconds = positive("--seconds", args.seconds)
    page.check(args.out, bench.PAGE_NAME)
    cases, notes = step_time.cases(args.quick)
    with progress("timing") as notify:
        measured = step_time.measure(cases, seconds, lambda part: notify(0.7 * part, "steps"))
        starts = []
        if not args.quick:
            notify(0.7, "first steps")
            with tempfile.TemporaryDirectory() as cache:
                starts = step_time.starts(cases, cache)
    found, data = bench.build_page(step_time.Results(*measured, starts, notes))
    print("\n".join(found.timing))
    print(page.write(args.out, found, data, provenance.trace(command=None, result=args.out.name)))
