"""What it changes where the friction of a steering sits: above the torsion bar, below it, or in the worm gear.

The same law sits at each site, once with the same sliding torque and once with the one that loses the same energy in a
cycle of the weave. Sites that turn together below the bar are one site as long as their friction does not grow with
different loads: the lower column stands for rack and motor. The car's own growth with the rack force is left out.

Source of the claims: Pfeffer, Harrer, Johnston, Vehicle System Dynamics 46 (2008), simulation.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from steer_env import friction, manoeuvres, metrics
from steer_env.experiments.pages import car_options, friction_pictures, pages
from steer_env.experiments.pages.options import progress
from steer_env.experiments.pages.words import label
from steer_env.experiments.studies.common import battery
from steer_env.experiments.studies.common.battery import Difference
from steer_env.experiments.sweep import Runner, run
from steer_env.friction import defaults
from steer_env.metrics.common.confidence import difference as gap_between
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.eps import SAMPLE_TIME

PAGE_NAME = "friction-sites"
LAW, EFFICIENCY = "masing", 0.88  # of the gear in both directions; assumed
BASE, ABOVE, GEAR = "lower column", "upper column", "worm gear"
EQUAL_TORQUE, EQUAL_LOSS = "the same sliding torque", "the same energy lost on centre"
TESTS = ("weave", "transition", "slow-ramp", "step-steer", "release", "returnability", "pulse", "catch-up", "parking")
SMALL_ACCELERATION = 0.5  # lateral acceleration of the weave in which the response is read [m/s2]
NO_FRICTION = {"law": "viscous", "sigma_2": 0.0}
RETURN = "return of the handwheel"
RETURN_SPEEDS = (0.0, 10.0, 35.0)  # from a standing car to that of the test [km/h]
WORMS = (0.9, 0.85)  # efficiencies of the gears whose return is told; assumed
MOST_METRICS = 10  # metrics that tell the sites apart best


def sites(site: str, F_c: float, efficiency: float = EFFICIENCY) -> dict[str, Any]:
    """The friction of a site with a sliding torque [N m], and with an efficiency if it is the gear."""
    own = {"law": LAW, "F_c": F_c}
    return {
        BASE: {"lower_column": own},
        ABOVE: {"upper_column": own},
        GEAR: {"gear": {**own, "efficiency": efficiency}},
    }[site]


class Site(NamedTuple):
    """A site on a term."""

    F_c: float  # sliding torque [N m]
    drives: dict[str, battery.Drive]  # by test


class Claim(NamedTuple):
    """A quantity without friction, and what friction at two places changes of it."""

    without: float  # [unit of the quantity]
    below: tuple[float, float, float]  # with friction below the bar less without: mean, 95 % interval [unit of it]
    above: tuple[float, float, float]  # with friction above the bar [unit of it]


class Results(NamedTuple):
    """All numbers of the study."""

    car: Car
    terms: dict[str, dict[str, Site]]  # term -> site
    response: Claim  # yaw rate over hand torque in a small weave [deg/s/(N m)]
    over_angle: Claim  # yaw rate over handwheel angle in it [1/s]
    deadband: Claim  # torque dead band of the weave [N m]
    returns: dict[str, tuple[float, ...]]  # site -> handwheel angle 3 s after it was let go, at RETURN_SPEEDS [deg]


def loop_area(car: Car, site: str, F_c: float) -> float:
    """Energy that the hands lose in a cycle of the weave [J]."""
    return battery.drive(car, sites(site, F_c), "weave").values["loop_area"].value


def _of_site(job: tuple[Car, str, float | None]) -> Site:
    """A site with a sliding torque, or with the one whose loss is that of the base."""
    car, site, F_c = job
    if F_c is None:
        wanted = loop_area(car, BASE, defaults.F_C)
        F_c = float(brentq(lambda F: loop_area(car, site, F) - wanted, 0.1, 2.0, xtol=1e-4))
    return Site(F_c, {test: battery.drive(car, sites(site, F_c), test) for test in TESTS})


def _responses(car: Car, law: Any) -> tuple[np.ndarray, np.ndarray]:
    """Span of the yaw rate over those of hand torque [deg/s/(N m)] and handwheel angle [1/s], of each settled cycle."""
    found = manoeuvres.drive(car, replace(manoeuvres.make("weave"), lateral_acceleration=SMALL_ACCELERATION), law)
    samples = round(1.0 / (found.meta["frequency_hz"] * SAMPLE_TIME))
    whole = slice(samples, samples * (found.time.size // samples))
    yaw, torque, angle = (
        np.ptp(found[name][whole].reshape(-1, samples), axis=1)
        for name in ("yaw_rate", "handwheel_torque", "handwheel_angle")
    )
    return np.degrees(yaw) / torque, yaw / angle


def _claims(car: Car) -> tuple[Claim, Claim, Claim]:
    laws = NO_FRICTION, sites(BASE, defaults.F_C), sites(ABOVE, defaults.F_C)
    bands = [np.array(battery.drive(car, law, "weave").values["torque_deadband"].repeats) for law in laws]
    over_torque, over_angle = zip(*(_responses(car, law) for law in laws))
    return _claim(over_torque), _claim(over_angle), _claim(bands)


def _claim(found: Sequence[np.ndarray]) -> Claim:
    without, below, above = found
    return Claim(float(without.mean()), gap_between(without, below), gap_between(without, above))


def _returns(car: Car) -> dict[str, tuple[float, ...]]:
    """Of the lower column and of worm gears, each with the same sliding torque."""
    laws = {BASE: sites(BASE, defaults.F_C)}
    laws |= {f"{GEAR}, efficiency {worm:g}": sites(GEAR, defaults.F_C, worm) for worm in WORMS}
    tests = [replace(manoeuvres.make("returnability"), speed=kph / 3.6, chassis="two_track") for kph in RETURN_SPEEDS]
    return {
        site: tuple(
            metrics.evaluate(manoeuvres.drive(car, test, law))["handwheel_angle_after_3s"].value for test in tests
        )
        for site, law in laws.items()
    }


def _case(job: tuple[Car, str | None, float | None]) -> Any:
    car, site, F_c = job
    if site == RETURN:
        return _returns(car)
    return _claims(car) if site is None else _of_site((car, site, F_c))


def collect(car: Car, sweep: Runner = run, notify: Callable[[float, str], None] = lambda *_: None) -> Results:
    """Every site on both terms, as cases of a sweep; the growth of the car's friction with the rack force is left out.

    Raises
    ------
    ValueError
        A car in which no friction loses as much above the bar as below it.
    """
    car = car._replace(steering={**car.steering, "friction_load": 0.0})
    names = [(EQUAL_TORQUE, BASE), (EQUAL_TORQUE, ABOVE), (EQUAL_TORQUE, GEAR), (EQUAL_LOSS, ABOVE), (EQUAL_LOSS, GEAR)]
    jobs: list[tuple[Car, str | None, float | None]] = [
        (car, site, defaults.F_C if term == EQUAL_TORQUE else None) for term, site in names
    ]
    jobs += [(car, None, None), (car, RETURN, None)]
    *found, (response, over_angle, deadband), returns = sweep(
        _case, jobs, notify=notify, words=lambda job: job[1] or "published claims"
    )
    terms: dict[str, dict[str, Site]] = {EQUAL_TORQUE: {}, EQUAL_LOSS: {BASE: found[0]}}
    for (term, site), result in zip(names, found):
        terms[term][site] = result
    return Results(car, terms, response, over_angle, deadband, returns)


def differences(term: dict[str, Site]) -> dict[str, dict[str, Difference]]:
    """``TEST: metric`` -> site -> difference to the base, of metrics that no site refuses."""
    found = {}
    for test in TESTS:
        rows = battery.differences({site: of.drives[test] for site, of in term.items()}, BASE)
        for name, row in rows.items():
            if all(np.isfinite(each.share) for each in row.values()):
                found[f"{test}: {label(name)}"] = row
    return found


def differing_metrics(rows: dict[str, dict[str, Difference]], site: str) -> list[str]:
    """The metrics in which a site differs from the base, the largest share first; only what is real and matters."""
    return sorted((name for name in rows if rows[name][site].matters), key=lambda name: -abs(rows[name][site].share))


def _row(name: str, of: dict[str, Difference]) -> tuple[str, ...]:
    return (name, *(f"{100.0 * each.share:+.1f} % ± {100.0 * each.reach:.1f}" for each in of.values()))


def build_page(results: Results) -> tuple[pages.Page, dict[str, Any]]:
    """The page and its numbers as JSON."""
    rows = {term: differences(of) for term, of in results.terms.items()}
    best = {term: {site: differing_metrics(of, site) for site in (ABOVE, GEAR)} for term, of in rows.items()}
    tables = {}
    for term, of in rows.items():
        shown = sorted(of, key=lambda name: -max(abs(each.share) for each in of[name].values()))[:MOST_METRICS]
        tables[term] = [_row(name, of[name]) for name in shown]
    values = {
        "r": results,
        "base": BASE,
        "sites": [ABOVE, GEAR],
        "law": LAW,
        "efficiency": EFFICIENCY,
        "small": SMALL_ACCELERATION,
        "return_speeds": RETURN_SPEEDS,
        "return_kph": [f"{kph:g} km/h" for kph in RETURN_SPEEDS],
        "worms": list(results.returns)[1:],
        "return_rows": [(site, *(f"{angle:.1f}" for angle in angles)) for site, angles in results.returns.items()],
        "torques": {site: of.F_c for site, of in results.terms[EQUAL_LOSS].items()},
        "best": best,
        "rows": rows,
        "equal_torque": EQUAL_TORQUE,
        "equal_loss": EQUAL_LOSS,
        "tables": tables,
        "counts": {term: {site: len(names) for site, names in of.items()} for term, of in best.items()},
        "total": {term: len(of) for term, of in rows.items()},
        "matters": battery.MATTERS,
        "tests": list(TESTS),
        "count_rows": [(site, *(len(best[term][site]) for term in rows)) for site in (ABOVE, GEAR)],
        "picture_of_sites": friction_pictures.strips(
            {
                term: {site: [of[name][site].share for name in of] for site in (ABOVE, GEAR)}
                for term, of in rows.items()
            },
            battery.MATTERS,
            f"difference from the {BASE} [% of the metric]",
            6.4,
        ),
    }
    return pages.Page(PAGE_NAME, values), as_json(results, rows)


def as_json(results: Results, rows: dict[str, dict[str, dict[str, Difference]]]) -> dict[str, Any]:
    """The numbers."""
    return {
        "law": LAW,
        "efficiency": EFFICIENCY,
        "sliding_torque_nm": {
            term: {site: of.F_c for site, of in sites.items()} for term, sites in results.terms.items()
        },
        "differences": {
            term: {name: {site: battery.as_json(each) for site, each in row.items()} for name, row in of.items()}
            for term, of in rows.items()
        },
        "response_deg_s_nm": results.response._asdict(),
        "response_per_s": results.over_angle._asdict(),
        "torque_deadband_nm": results.deadband._asdict(),
        "handwheel_angle_after_3s_deg": {"speeds_kph": RETURN_SPEEDS, **results.returns},
    }


def main(argv: Sequence[str] | None = None, sweep: Runner = run, car: Car | None = None) -> None:
    """Drive the car with the same friction at several sites, and write a page on which metrics tell them apart."""
    parser = pages.parser(PAGE_NAME, main.__doc__)
    car_options.add(parser)
    args = parser.parse_args(argv)
    pages.check(args.out, PAGE_NAME)
    car = car or car_options.load(args)
    with progress("sites") as notify:
        results = collect(car, sweep, notify)
    found, data = build_page(results)
    print("\n".join([*found.verdict, *found.timing]))
    made: dict[str, Any] = {
        "car": car,
        "friction": {site: friction.resolve(sites(site, defaults.F_C)) for site in (BASE, ABOVE, GEAR)},
    }
    print(pages.write(args.out, found, data, pages.study_trace(PAGE_NAME, argv, args.out, **made)))
