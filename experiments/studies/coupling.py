"""What it costs to split the car at the rack: steering and vehicle as two simulations that exchange values.

``common.coupling_runs`` drives the undivided car and the divided one, whose vehicle is the exported chassis.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from steer_env import friction
from steer_env.experiments.pages import car_options, friction_pictures, pages
from steer_env.experiments.pages.options import progress
from steer_env.experiments.pages.words import label, number, percent
from steer_env.experiments.studies.common import coupling_runs as runs
from steer_env.experiments.studies.common.computing_time import Measured
from steer_env.experiments.studies.common.coupling_runs import COMPARED, FREQUENCY, KINDS, Cost, LawCost, Transport
from steer_env.experiments.sweep import Runner, run
from steer_env.vehicle.cars import Car

NAME = "coupling"
SERIAL, PARALLEL, HELD = KINDS
COUNTS = 1e-3  # share of a metric from which on a change counts, assumed [1]


class Results(NamedTuple):
    """All numbers of the study."""

    car: Car
    laws: dict[str, LawCost]
    transports: list[Transport]
    times: Measured[str]  # of a communication step, by transport


def _case(job: tuple[Car, str, bytes]) -> LawCost:
    return runs.of_law(*job)


def collect(car: Car, laws: Sequence[str], sweep: Runner = run, notify: Any = lambda *_: None) -> Results:
    """All runs of a car as a sweep, with a case for each law; the transports follow, when no worker runs."""
    unit = runs.exported(car)
    found = sweep(_case, [(car, law, unit) for law in laws], notify=notify, words=lambda job: job[1])
    return Results(car, dict(zip(laws, found)), *runs.transports(car, laws[0], unit))


def worst(cost: Cost) -> tuple[str, float]:
    """The metric of the weave that changes most, and its change as a share."""
    name = max(cost.metrics, key=lambda each: abs(cost.metrics[each]))
    return name, cost.metrics[name]


def largest(results: Results, kind: str, step: int, size: Callable[[Cost], float]) -> tuple[str, float]:
    """The law in which a quantity of a coupling is largest in size, and the quantity there."""
    found = {law: size(of.costs[kind][step]) for law, of in results.laws.items()}
    law = max(found, key=lambda each: abs(found[each]))
    return law, found[law]


class Worst(NamedTuple):
    """What a coupling costs with the law for which each cost is largest."""

    law: str  # with the largest change of a metric
    metric: str
    share: float  # change of the metric [1]
    energy: float  # residual over what passes the rack [1]
    phase: float  # of the rack force [rad]
    swing: float  # more motion after a pulse [1]


def of_coupling(results: Results, kind: str, step: int) -> Worst:
    """The largest costs of a coupling over the laws."""
    law, share = largest(results, kind, step, lambda cost: worst(cost)[1])
    return Worst(
        law,
        worst(results.laws[law].costs[kind][step])[0],
        abs(share),
        largest(results, kind, step, lambda cost: cost.energy)[1],
        largest(results, kind, step, lambda cost: cost.phase)[1],
        largest(results, kind, step, lambda cost: cost.swing)[1],
    )


def longest_steps(results: Results) -> dict[str, int | None]:
    """Coupling -> longest step at which the motion dies out with every law [ms]; None where it does not with one."""
    found = {kind: [of.longest[kind] for of in results.laws.values()] for kind in KINDS}
    return {
        kind: None if None in steps else min(step for step in steps if step is not None)
        for kind, steps in found.items()
    }


def _rows(results: Results, text: Callable[[Cost], str]) -> list[tuple[str, ...]]:
    """Text of a cost, for each law a row over the couplings."""
    couplings = [(kind, step) for kind in KINDS for step in COMPARED]
    return [(law, *(text(of.costs[kind][step]) for kind, step in couplings)) for law, of in results.laws.items()]


def _worst_text(cost: Cost) -> str:
    name, share = worst(cost)
    return f"{percent(abs(share))} ({label(name)})"


def build(results: Results) -> tuple[pages.Page, dict[str, Any]]:
    """The page and its numbers as JSON."""
    swings = {law: of.costs[PARALLEL][5].swing for law, of in results.laws.items()}
    low, high = (pick(swings, key=lambda law: swings[law]) for pick in (min, max))
    laws = results.laws.values()
    values = {
        "r": results,
        "runs": runs,
        "counts": COUNTS,
        "serial": of_coupling(results, SERIAL, 1),
        "late": of_coupling(results, PARALLEL, 1),
        "slow": of_coupling(results, PARALLEL, 5),
        "swings": {"least_law": low, "least": swings[low], "most_law": high, "most": swings[high]},
        "longest": longest_steps(results),
        "changes": friction_pictures.strips(
            {
                kind: {
                    f"{step} ms": [share for of in laws for share in of.costs[kind][step].metrics.values()]
                    for step in COMPARED
                }
                for kind in KINDS
            },
            COUNTS,
            "change [% of the undivided car's]",
            5.6,
        ),
        "couplings": [f"{kind}, {step} ms" for kind in KINDS for step in COMPARED],
        "tables": {
            "Largest change of a metric of the weave": _rows(results, _worst_text),
            "Energy residual": _rows(results, lambda cost: percent(cost.energy)),
            f"Phase at {FREQUENCY:g} Hz [°]": _rows(results, lambda cost: number(np.degrees(cost.phase))),
            "Motion after a pulse, more than the undivided car's": _rows(results, lambda cost: percent(cost.swing)),
        },
        "kinds": list(KINDS),
        "longest_rows": [
            (law, *(str(of.longest[kind] or "none") for kind in KINDS)) for law, of in results.laws.items()
        ],
        "transport_rows": [(way.name, "yes" if way.equal else "no") for way in results.transports],
    }
    return pages.Page(NAME, values), as_json(results)


def as_json(results: Results) -> dict[str, Any]:
    """The numbers, without times, so that a rerun gives the same."""
    return {
        "laws": {
            law: {
                "costs": {
                    kind: {f"{step} ms": {**cost._asdict(), "worst": worst(cost)[0]} for step, cost in costs.items()}
                    for kind, costs in of.costs.items()
                },
                "longest_step_ms": of.longest,
            }
            for law, of in results.laws.items()
        },
        "transports": {way.name: {"equal": way.equal} for way in results.transports},
        "units": {"metrics": "1", "energy": "1", "phase": "rad", "swing": "1", "longest_step_ms": "ms"},
    }


def main(argv: Sequence[str] | None = None, sweep: Runner = run, car: Car | None = None) -> None:
    """Split the car at the rack, couple both halves in several ways with every law, and write a page."""
    parser = pages.parser(NAME, main.__doc__)
    car_options.add(parser)
    known = friction.available()
    text = f"laws to study (default: {' '.join(known)})"
    parser.add_argument("--friction", metavar="LAW", nargs="+", choices=known, default=list(known), help=text)
    args = parser.parse_args(argv)
    pages.check(args.out, NAME)
    car = car or car_options.load(args)
    with progress("coupling") as notify:
        results = collect(car, args.friction, sweep, notify)
    found, data = build(results)
    print("\n".join([*found.verdict, *found.timing]))
    made: dict[str, Any] = {"car": car, "friction": {law: friction.make(law) for law in args.friction}}
    print(pages.write(args.out, found, data, pages.trace_of(NAME, argv, args.out, **made)))
