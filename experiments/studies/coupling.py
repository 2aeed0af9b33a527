"""What it costs to split the car at the rack: steering and vehicle as two simulations that exchange values.

``common.coupling_runs`` drives the undivided car and the divided one, whose vehicle is the exported chassis.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from steer_env import friction
from steer_env.experiments.pages import car_options
from steer_env.experiments.pages import study_page as page
from steer_env.experiments.pages.options import progress
from steer_env.experiments.pages.words import label, number, percent
from steer_env.experiments.studies.common import coupling_runs as runs
from steer_env.experiments.studies.common.coupling_runs import COMPARED, FREQUENCY, KINDS, Cost, LawCost, Transport
from steer_env.experiments.sweep import Runner, run
from steer_env.vehicle.cars import Car

NAME = "coupling"
SERIAL, PARALLEL, HELD = KINDS
MEANINGS = (
    "Vehicle after the steering: in every communication step the steering advances first, and the vehicle follows with "
    "the rack travel that the steering has reached. Both at once: both advance with what the other had at the "
    "beginning of the step, a delay of one step, as where they run in parallel. Force held: the rack force holds over "
    "the step, and is not extrapolated from its last two values."
)
COUNTS = 1e-3  # share of a metric from which on a change counts, assumed [1]


class Results(NamedTuple):
    """All numbers of the study."""

    car: Car
    laws: dict[str, LawCost]
    transports: list[Transport]


def _case(job: tuple[Car, str, bytes]) -> LawCost:
    return runs.of_law(*job)


def collect(car: Car, laws: Sequence[str], sweep: Runner = run, notify: Any = lambda *_: None) -> Results:
    """All runs of a car as a sweep, with a case for each law; the transports follow, when no worker runs."""
    unit = runs.exported(car)
    found = sweep(_case, [(car, law, unit) for law in laws], notify=notify, words=lambda job: job[1])
    return Results(car, dict(zip(laws, found)), runs.transports(car, laws[0], unit))


def worst(cost: Cost) -> tuple[str, float]:
    """The metric of the weave that changes most, and its change as a share."""
    name = max(cost.metrics, key=lambda each: abs(cost.metrics[each]))
    return name, cost.metrics[name]


def largest(results: Results, kind: str, step: int, size: Callable[[Cost], float]) -> tuple[str, float]:
    """The law in which a quantity of a coupling is largest in size, and the quantity there."""
    found = {law: size(of.costs[kind][step]) for law, of in results.laws.items()}
    law = max(found, key=lambda each: abs(found[each]))
    return law, found[law]


def sentences(results: Results) -> list[str]:
    """The verdict in sentences."""
    law, error = largest(results, SERIAL, 1, lambda cost: worst(cost)[1])
    metric = worst(results.laws[law].costs[SERIAL][1])[0]
    serial = {name: largest(results, SERIAL, 1, size)[1] for name, size in _SIZES.items()}
    late = {name: largest(results, PARALLEL, 1, size)[1] for name, size in _SIZES.items()}
    slow = {name: largest(results, PARALLEL, 5, size)[1] for name, size in _SIZES.items()}
    late_law, late_error = largest(results, PARALLEL, 1, lambda cost: worst(cost)[1])
    slow_law, slow_error = largest(results, PARALLEL, 5, lambda cost: worst(cost)[1])
    cost = "costs nothing that counts" if abs(error) < COUNTS else "is not free"
    return [
        f"Where the vehicle steps after the steering every millisecond, the split at the rack {cost}: no metric of the "
        f"weave changes by more than {percent(abs(error))} ({label(metric)}, {law}), the energy residual at the rack "
        f"is {percent(abs(serial['energy']))} of what passes it, and the phase at {FREQUENCY:g} Hz is off by "
        f"{number(abs(np.degrees(serial['phase'])), 2)}°.",
        f"A delay of one step, as where both run at once, costs at 1 ms up to {percent(abs(late_error))} of a metric "
        f"({_metric_of(results, PARALLEL, 1, late_law)}), {percent(abs(late['energy']))} of the energy, "
        f"{number(abs(np.degrees(late['phase'])), 2)}° at {FREQUENCY:g} Hz, and {percent(late['swing'])} more motion "
        f"after a pulse of the free hands; at 5 ms {percent(abs(slow_error))} "
        f"({_metric_of(results, PARALLEL, 5, slow_law)}), {percent(abs(slow['energy']))}, "
        f"{number(abs(np.degrees(slow['phase'])), 2)}° and {percent(slow['swing'])}.",
        _stability(results),
        _spread(results),
        _same(results),
    ]


_SIZES: dict[str, Callable[[Cost], float]] = {
    "energy": lambda cost: cost.energy,
    "phase": lambda cost: cost.phase,
    "swing": lambda cost: cost.swing,
}


def _metric_of(results: Results, kind: str, step: int, law: str) -> str:
    return f"{label(worst(results.laws[law].costs[kind][step])[0])}, {law}"


def _stability(results: Results) -> str:
    """The longest steps at which the motion dies out with every law."""
    words = []
    for kind in KINDS:
        found = [of.longest[kind] for of in results.laws.values()]
        known = [step for step in found if step is not None]
        least = min(known) if len(known) == len(found) else None
        enough = "at least " if least == runs.STEPS[-1] else ""
        words.append(f"{kind}, {enough}{least} ms" if least else f"{kind}, less than {runs.STEPS[0]} ms")
    every = " with every law" if len(results.laws) > 1 else ""
    return f"Communication steps up to which the motion after a pulse dies out{every}: {'; '.join(words)}."


def _spread(results: Results) -> str:
    """Whether the laws differ in what the coupling costs them."""
    if len(results.laws) < 2:
        return f"Only {next(iter(results.laws))} was studied."
    swings = {law: of.costs[PARALLEL][5].swing for law, of in results.laws.items()}
    low, high = (pick(swings, key=lambda law: swings[law]) for pick in (min, max))
    return (
        f"What a delay costs depends on the law: at 5 ms the motion after a pulse grows by {percent(swings[low])} with "
        f"{low}, least of all, and by {percent(swings[high])} with {high}, most of all."
    )


def _same(results: Results) -> str:
    unequal = [way.name for way in results.transports if not way.equal]
    if unequal:
        return f"The way to the vehicle changes the numbers: {', '.join(unequal)}."
    return f"The way to the vehicle changes no bit: {', '.join(way.name for way in results.transports)}."


def _table(results: Results, caption: str, text: Callable[[Cost], str], note: str = "") -> page.Table:
    """A table of the laws over the couplings."""
    head = ("law", *(f"{kind}, {step} ms" for kind in KINDS for step in COMPARED))
    couplings = [(kind, step) for kind in KINDS for step in COMPARED]
    rows = [(law, *(text(of.costs[kind][step]) for kind, step in couplings)) for law, of in results.laws.items()]
    return page.Table(caption, head, rows, note)


def _worst_text(cost: Cost) -> str:
    name, share = worst(cost)
    return f"{percent(abs(share))} ({label(name)})"


def build(results: Results) -> tuple[page.Page, dict[str, Any]]:
    """The page and its numbers as JSON."""
    verdict = sentences(results)
    common = (
        f"The car '{results.car.name}' on a single track at 100 km/h; the vehicle is its chassis, exported as a unit "
        "(FMU). Every law runs undivided, and split at the rack with the same motion of the hands."
    )
    sections = [
        page.Section(
            "Accuracy",
            "A steering that is coupled to another program reports what the whole car would.",
            f"{common} Every metric of the weave is compared.",
            verdict[0],
            "Between two communication points the channels of the vehicle hold, which reads as a lag of nearly half a "
            "step; with a delay the vehicle is a whole step late besides. Metrics that are refused are left out.",
            (),
            [_table(results, "Largest change of a metric of the weave", _worst_text)],
        ),
        page.Section(
            "Energy and phase at the rack",
            "A delay between force and motion creates energy.",
            f"{common} The work that the steering does on the rack, less what the vehicle receives, over what passes "
            f"the rack in the weave; and the phase of the rack force that acts on the steering, over the rack travel, "
            f"in a sine of {runs.AMPLITUDE:g} rad at {FREQUENCY:g} Hz, less that of the undivided car.",
            verdict[1],
            f"A delay of one millisecond is {360e-3 * FREQUENCY:g}° at {FREQUENCY:g} Hz. A negative residual is energy "
            "that the steering received and the vehicle did not give.",
            (),
            [
                _table(results, "Energy residual", lambda cost: percent(cost.energy)),
                _table(results, f"Phase at {FREQUENCY:g} Hz [°]", lambda cost: number(np.degrees(cost.phase))),
            ],
        ),
        page.Section(
            "Stability",
            "Coupled simulations need short steps to stay stable.",
            f"{common} A pulse of {runs.PULSE:g} N m for {runs.LENGTH:g} s, then free hands; the motion of the column "
            f"in the second after it against the undivided car's, and the longest of the steps "
            f"{', '.join(map(str, runs.STEPS))} ms at which less than {percent(runs.DECAYED)} of it is left after "
            f"{runs.DURATION:g} s.",
            f"{verdict[2]} {verdict[3]}",
            "One car, one speed. A stiffer tyre, a higher speed or hands on the wheel give other limits, and a vehicle "
            "with a stiff rack of its own gives shorter ones.",
            (),
            [
                _table(
                    results, "Motion after a pulse, more than the undivided car's", lambda cost: percent(cost.swing)
                ),
                page.Table(
                    "Longest communication step at which the motion dies out [ms]",
                    ("law", *KINDS),
                    [(law, *(str(of.longest[kind] or "none") for kind in KINDS)) for law, of in results.laws.items()],
                ),
            ],
        ),
        page.Section(
            "The way to the vehicle",
            "A vehicle in another process gives other numbers.",
            "The weave with the unit in this process, in a process of its own, and with the same chassis served over "
            "UDP from another process, in lockstep.",
            verdict[4],
            "Lost packets are asked for again, so that they cost time and no accuracy; free running is another matter.",
            (),
            [_transport_table(results)],
            measured=True,
        ),
    ]
    lead = (
        "Full-vehicle programs take a steering as a unit of its own, or give their vehicle to one. What the split at "
        "the rack costs in accuracy, energy and stability, for each friction law. " + MEANINGS
    )
    times = "; ".join(f"{way.name} {number(1e6 * way.seconds, 2)} µs" for way in results.transports)
    timing = [f"A millisecond of the divided car takes, with everything: {times}."]
    return page.Page(NAME, "Steering and vehicle as two simulations", lead, verdict, sections, timing), as_json(results)


def _transport_table(results: Results) -> page.Table:
    rows = [(way.name, "yes" if way.equal else "no", number(1e6 * way.seconds, 2)) for way in results.transports]
    return page.Table("Transports", ("vehicle", "equal to the bit", "time of 1 ms [µs]"), rows)


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
    parser = page.parser(NAME, main.__doc__)
    car_options.add(parser)
    known = friction.available()
    text = f"laws to study (default: {' '.join(known)})"
    parser.add_argument("--friction", metavar="LAW", nargs="+", choices=known, default=list(known), help=text)
    args = parser.parse_args(argv)
    page.check(args.out, NAME)
    car = car or car_options.load(args)
    with progress("coupling") as notify:
        results = collect(car, args.friction, sweep, notify)
    found, data = build(results)
    print("\n".join([*found.verdict, *found.timing]))
    made: dict[str, Any] = {"car": car, "friction": {law: friction.make(law) for law in args.friction}}
    print(page.write(args.out, found, data, page.trace_of(NAME, argv, args.out, **made)))
