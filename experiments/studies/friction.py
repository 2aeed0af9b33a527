"""Which friction law is more accurate, which runs in real time, and what the choice changes in the car.

``common.friction_results`` computes everything as sweeps, ``common.friction_page`` says what the page shows.
"""

from collections.abc import Sequence
from typing import Any

from steer_env.experiments.pages import car_options, pages
from steer_env.experiments.pages.options import progress
from steer_env.experiments.studies.common.friction_page import as_json, page_of
from steer_env.experiments.studies.common.friction_results import QUICK, collect, full
from steer_env.experiments.sweep import Runner, run
from steer_env.vehicle.cars import Car

NAME = "friction"


def main(argv: Sequence[str] | None = None, sweep: Runner = run, car: Car | None = None) -> None:
    """Answer which friction law is more accurate, which runs in real time, and what the choice changes."""
    parser = pages.parser(NAME, main.__doc__)
    car_options.add(parser)
    text = "three tests, one noise and few repeats in place of the whole battery: for a first look"
    parser.add_argument("--quick", action="store_true", help=text)
    args = parser.parse_args(argv)
    pages.check(args.out, NAME)
    car = car or car_options.load(args)
    with progress("computing") as notify:
        results = collect(car, QUICK if args.quick else full(), sweep=sweep, notify=notify)
    found = page_of(results)
    print("\n".join([*found.verdict, *found.timing]))
    made: dict[str, Any] = {"car": car, "friction": results.laws}
    print(pages.write(args.out, found, as_json(results), pages.trace_of(NAME, argv, args.out, **made)))
