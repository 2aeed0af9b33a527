"""Which friction law is more accurate, which runs in real time, and what the choice changes in the car.

``common.friction_results`` computes everything as sweeps, ``common.friction_page`` writes the sentences and tables.
"""

from collections.abc import Sequence
from typing import Any

from steer_env.experiments.pages import car_options
from steer_env.experiments.pages import study_page as page
from steer_env.experiments.pages.options import progress
from steer_env.experiments.studies.common import friction_page as sections
from steer_env.experiments.studies.common import friction_page_loops as loops
from steer_env.experiments.studies.common.friction_json import as_json
from steer_env.experiments.studies.common.friction_results import QUICK, Results, collect, full
from steer_env.experiments.sweep import Runner, run
from steer_env.vehicle.cars import Car

NAME = "friction"


def build(r: Results) -> page.Page:
    """The page of the results."""
    accuracy, (cost, timed, steps) = sections.accuracy(r), sections.cost(r)
    others = [sections.of_laws(r), sections.of_factors(r)]
    others += [loops.apart(r), loops.speeds(r), loops.in_loop(r), loops.confusion(r)]
    lead = (
        "The literature on steering asks which friction law is more accurate and which runs in real time. The answer "
        f"for {len(r.laws)} laws, by a measured record, by the project's own integration, and by the car "
        f"'{r.car.name}' in "
        f"{len(r.scope.tests)} tests. Every sentence follows from the numbers of this run."
    )
    verdict = [accuracy.headline, steps, *(section.headline or section.verdict for section in others)]
    return page.Page(NAME, "Which friction law?", lead, verdict, [accuracy, cost, *others], [timed])


def main(argv: Sequence[str] | None = None, sweep: Runner = run, car: Car | None = None) -> None:
    """Answer which friction law is more accurate, which runs in real time, and what the choice changes."""
    parser = page.parser(NAME, main.__doc__)
    car_options.add(parser)
    text = "three tests, one noise and few repeats in place of the whole battery: for a first look"
    parser.add_argument("--quick", action="store_true", help=text)
    args = parser.parse_args(argv)
    page.check(args.out, NAME)
    car = car or car_options.load(args)
    with progress("computing") as notify:
        results = collect(car, QUICK if args.quick else full(), sweep=sweep, notify=notify)
    found = build(results)
    print("\n".join([*found.verdict, *found.timing]))
    made: dict[str, Any] = {"car": car, "friction": results.laws}
    print(page.write(args.out, found, as_json(results), page.trace_of(NAME, argv, args.out, **made)))
