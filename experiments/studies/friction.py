"""Which friction law is more accurate, which runs in real time, and what the choice changes in the car.

``common.friction_results`` computes everything as sweeps; the functions here say what the page shows of it.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env import friction
from steer_env.experiments.pages import car_options, friction_pictures, pages
from steer_env.experiments.pages.options import progress
from steer_env.experiments.pages.pages import Page
from steer_env.experiments.pages.words import label, number, percent, within
from steer_env.experiments.studies import real_time
from steer_env.experiments.studies.common import computing_time
from steer_env.experiments.studies.common import friction_cases as cases
from steer_env.experiments.studies.common import friction_records as records
from steer_env.experiments.studies.common.battery import MATTERS
from steer_env.experiments.studies.common.computing_time import SCHEME
from steer_env.experiments.studies.common.friction_cases import BASE_LAW, Effect
from steer_env.experiments.studies.common.friction_distinction import DISTINCTION_THRESHOLD, experiments
from steer_env.experiments.studies.common.friction_results import QUICK_SCOPE, Results, collect, full
from steer_env.experiments.sweep import Runner, run
from steer_env.friction.identification import periods
from steer_env.recording.recording import DEGREE
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Loop = tuple[NDArray[np.float64], NDArray[np.float64]]  # displacement (T,) [deg], friction (T,) [N m]

BOTH = ("weave", "slow-ramp")  # at 0.2 and at 0.02 Hz
NEAR_ERROR = 0.5  # error of laws whose loops are drawn, at most [1]
FIRST_TABLE_ROWS = 10  # of the first table


def make_page(r: Results) -> Page:
    """The page."""
    values = {
        "r": r,
        "base": BASE_LAW,
        "others": [law for law in r.laws if law != BASE_LAW],
        "matters": MATTERS,
        "near": NEAR_ERROR,
        "told": DISTINCTION_THRESHOLD,
        "usable": real_time.USABLE,
        "computing": computing_time,
        "a": accuracy(r),
        "road": on_road(r),
        "c": steps(r),
        "laws": of_laws(r),
        "factors": of_factors(r),
        "apart": laws_told_apart(r),
        "speeds": speeds(r),
        "felt": friction_test_effects(r),
        "loops": in_loop(r),
        "confusion": confusion(r),
    }
    return Page("friction", values)


def accuracy(r: Results) -> dict[str, Any]:
    """Which law describes the measured record best."""
    known = r.known()
    of = {each.law: each for each in known}
    leaders = [each for each in known if each is known[0] or each.law in known[0].alike]
    ends = [percent(pick(each.error for each in leaders), 2) for pick in (min, max)]
    seconds = r.record.dt * r.record.x.size
    rows = [
        (each.law, percent(each.error, 3), f"{percent(each.low, 3)} to {percent(each.high, 3)}",
         number(each.error / r.repeatability, 2), ", ".join(each.undetermined) or "–")
        for each in known
    ]  # fmt: skip
    rows += [(each.law, *("–" * 4)) for each in r.judged if each.parameters is None]
    return {
        "known": known,
        "leaders": leaders,
        "leaders_span": list(dict.fromkeys(ends)),
        "left": [each for each in known if each not in leaders],
        "lugre": of.get("lugre"),
        "masing": of.get("masing"),
        "sure": next((each for each in known if not each.undetermined), None),
        "undetermined": [each.law for each in known if each.undetermined],
        "seconds": seconds,
        "fitted": (1.0 - records.HELD_OUT) * seconds,
        "picture": friction_pictures.record_loops(*last_loops(r)),
        "errors": friction_pictures.residuals(
            {each.law: (100.0 * each.error, 100.0 * each.low, 100.0 * each.high) for each in known},
            100.0 * r.repeatability,
        ),
        "rows": rows,
        "remarks": [(each.law, "; ".join(each.remarks)) for each in r.judged if each.remarks],
    }


def last_loops(r: Results) -> tuple[Loop, dict[str, Loop]]:
    """Displacement [deg] and friction [N m] of the record's last period, measured and by each law that is near it."""
    period = periods.period(r.record.motion) or r.record.x.size
    x = r.record.x[-period:] / DEGREE
    laws = {
        each.law: (x, friction.response(each.parameters, r.record.x, r.record.dt)[-period:] + each.offset)
        for each in r.known()
        if each.error < NEAR_ERROR
    }
    return (x, r.record.friction[-period:]), laws


def on_road(r: Results) -> dict[str, Any]:
    """What each law leaves of the hand torque of drives where it was not fitted."""
    found = r.road
    rows = [
        (row.name, number(row.crossed, 3), number(row.residual, 3), " to ".join(number(x, 3) for x in row.interval),
         *((number(row.adds, 2), " to ".join(number(x, 2) for x in row.adds_interval)) if row in found.dry else "––"))
        for row in found.rows
    ]  # fmt: skip
    used = sum(d.weight.sum() * d.dt for d in found.drives)
    levels = [each.best.level_interval for each in found.alone]
    return {
        "rows": rows,
        "best": found.best,
        "unseen": found.unseen,
        "equals": found.equals,
        "seconds": used,
        "levels": levels,
        "drives": len(found.drives),
    }


def steps(r: Results) -> dict[str, Any]:
    """Error at 1 ms and longest step of each law."""
    at = {
        law: next(row for row in rows if (row.scheme, row.step) == (SCHEME, SAMPLE_TIME))
        for law, rows in r.tables.items()
    }
    longest = {law: real_time.usable_step(rows, SCHEME) for law, rows in r.tables.items()}
    explicit = {law: real_time.usable_step(rows, "explicit Euler") for law, rows in r.tables.items()}
    rows = [(law, percent(at[law].error, 2), _ms(longest[law]), _ms(explicit[law])) for law in r.laws]
    return {
        "longest": _by_step(longest),
        "explicit": _by_step(explicit),
        "rows": rows,
    }


def _ms(step: float | None) -> str:
    return f"{1e3 * step:g} ms" if step else "none"


def _by_step(of: Mapping[str, float | None]) -> list[tuple[float | None, list[str]]]:
    """Laws by their longest step, the longest first."""
    groups = groupby(sorted(of, key=lambda law: -(of[law] or 0.0)), key=lambda law: of[law])
    return [(step, list(laws)) for step, laws in groups]


def _summaries(of: Mapping[str, Sequence[Effect]]) -> dict[str, Any]:
    return {name: cases.summary(effects) for name, effects in of.items()}


def _outstanding(rows: Sequence[Effect]) -> list[Effect]:
    """Every perceptible or large effect, the largest first."""
    kept = (row for row in rows if row.noticed or row.found.matters)
    return sorted(kept, key=lambda row: -abs(row.found.share))


def of_laws(r: Results) -> dict[str, Any]:
    """What the law alone changes in the battery."""
    factors = cases.by_factor(r.effects)
    levels = cases.by_level(factors[cases.LAW_FACTOR])
    remembering = [row for law in r.remembers() for row in levels.get(law, [])]
    measured = [row for row in factors.get(cases.MEASURED_LAW_FACTOR, []) if row.case.level in r.remembers()]
    ranked = sorted(_summaries(levels).items(), key=lambda pair: -pair[1].large)
    felt = [row for row in remembering if row.noticed]
    return {
        "felt": list(dict.fromkeys(row.case.level for row in felt)),
        "felt_fitted": list(dict.fromkeys(row.case.level for row in measured if row.noticed)),
        "largest": cases.summary(felt or remembering).largest,
        "remembering": cases.summary(remembering),
        "other": _summaries({law: rows for law, rows in levels.items() if law not in r.remembers()}),
        "measured": cases.summary(measured) if measured else None,
        "measured_laws": sorted({row.case.level for row in measured}),
        "measured_base": measured[0].case.base.rpartition(" ")[2] if measured else "",
        "levels": _summaries(levels),
        "measured_levels": _summaries(cases.by_level(factors.get(cases.MEASURED_LAW_FACTOR, []))),
        "first": ranked[:FIRST_TABLE_ROWS],
        "rest": [law for law, _ in ranked[FIRST_TABLE_ROWS:]],
        "effects": _outstanding(factors[cases.LAW_FACTOR]),
    }


def of_factors(r: Results) -> dict[str, Any]:
    """What level, pre-sliding distance, damping, step, site and load change beside the law."""
    factors = {
        factor: rows
        for factor, rows in cases.by_factor(r.effects).items()
        if factor not in (cases.LAW_FACTOR, cases.MEASURED_LAW_FACTOR, cases.UNASSISTED_LAW_FACTOR)
    }
    of_law = f"{cases.LAW_FACTOR} (with pre-sliding)"
    remembering = set(r.remembers())
    compared = {
        **factors,
        of_law: [row for row in r.effects if row.case.factor == cases.LAW_FACTOR and row.case.level in remembering],
    }
    means = {factor: _mean_large(rows) for factor, rows in compared.items()}
    ranked = dict(sorted(means.items(), key=lambda pair: -pair[1]))
    order = list(ranked)
    place = order.index(of_law)
    return {
        "ranked": ranked,
        "law": ranked[of_law],
        "stronger": {factor: ranked[factor] for factor in order[:place]},
        "weaker": order[place + 1 :],
        "noticed": [factor for factor in order if cases.summary(compared[factor]).noticed],
        "picture": friction_pictures.strips(shares(r.effects), MATTERS),
        "levels": _summaries(
            {f"{factor}: {level}": of for factor, rows in factors.items() for level, of in cases.by_level(rows).items()}
        ),
        "effects": _outstanding([row for rows in factors.values() for row in rows]),
    }


def shares(effects: Sequence[Effect]) -> dict[str, dict[str, list[float]]]:
    """Factor -> case -> real differences as shares of their metrics [1], as the picture shows them."""
    return {
        factor: {
            level: [row.found.share for row in rows if row.found.real and math.isfinite(row.found.share)]
            for level, rows in cases.by_level(of).items()
        }
        for factor, of in cases.by_factor(effects).items()
    }


def _mean_large(rows: Sequence[Effect]) -> float:
    """Share of the compared metrics above ``MATTERS``, mean over the cases [1]."""
    found = [cases.summary(of) for of in cases.by_level(rows).values()]
    return float(np.mean([s.large / s.compared for s in found if s.compared])) if found else 0.0


def laws_told_apart(r: Results) -> dict[str, Any]:
    """Where laws can be told apart with one calibration."""
    remembering = r.remembers()
    told = {name: [law for law in remembering if of[law] > DISTINCTION_THRESHOLD] for name, of in r.apart.items()}
    of_name = experiments()
    groups: dict[tuple[str, ...], list[str]] = {}
    for law in remembering:
        where = tuple(of_name[name].short for name, laws in told.items() if law in laws)
        groups.setdefault(where, []).append(law)
    free = [
        row for row in r.effects if row.case.factor == cases.LAW_FACTOR and row.test in ("release", "returnability")
    ]
    columns = [law for law in r.laws if law != BASE_LAW]
    rows = [(of_name[name].title, *(percent(of[law], 2) for law in columns)) for name, of in r.apart.items()]
    ripples = {(each.law, each.calibration): 1e3 * each.ripple for each in r.held}
    rows += [
        (f"ripple of a held torque, {title} [mN m]", *(number(ripples[law, title], 2) for law in columns))
        for title in dict.fromkeys(each.calibration for each in r.held)
    ]
    return {
        "where": {of_name[name].title: laws for name, laws in told.items() if laws},
        "alike": [of_name[name].title for name, laws in told.items() if not laws],
        "groups": list(groups.items()),
        "shaking": sorted({each.law for each in r.held if each.lasting > 0.9 and each.ripple > 1e-3}),
        "free": cases.summary([row for row in free if row.case.level in remembering]),
        "rows": rows,
    }


def speeds(r: Results) -> dict[str, Any]:
    """0.2 against 0.02 Hz."""
    remembering = set(r.remembers())
    shares: dict[str, dict[str, dict[str, float]]] = {}
    for row in r.effects:
        factor, level = row.case.factor, row.case.level
        counts_here = factor == cases.LEVEL_FACTOR or (factor == cases.LAW_FACTOR and level in remembering)
        if row.test in BOTH and row.found.real and counts_here:
            of = shares.setdefault(row.metric, {}).setdefault(row.test, {})
            of[factor] = max(of.get(factor, 0.0), abs(row.found.share))
    common = {metric: of for metric, of in shares.items() if set(of) == set(BOTH)}
    rows = []
    for metric, both in common.items():
        cells = [both[test].get(factor, 0.0) for test in BOTH for factor in (cases.LAW_FACTOR, cases.LEVEL_FACTOR)]
        rows.append((label(metric), *(percent(cell, 2) for cell in cells)))
    fast, slow = (
        max((both[test].get(cases.LAW_FACTOR, 0.0) for both in common.values()), default=0.0) for test in BOTH
    )
    return {"fast": fast, "slow": slow, "rows": rows}


def friction_test_effects(r: Results) -> dict[str, Any]:
    """What the law changes in the tests in which friction is most of what is felt."""
    remembering = r.remembers()
    rows = [row for row in r.effects if row.case.level in remembering]
    of = {
        factor: cases.by_test([row for row in rows if row.case.factor == factor], cases.FRICTION_TESTS)
        for factor in (cases.LAW_FACTOR, cases.MEASURED_LAW_FACTOR)
    }
    table = []
    for test in of[cases.LAW_FACTOR]:
        cells: list[str] = []
        for factor in (cases.LAW_FACTOR, cases.MEASURED_LAW_FACTOR):
            told = cases.summary(of[factor].get(test, ()))
            most = f"{label(told.largest.metric)} {percent(told.largest.found.share, 2)}" if told.largest else "–"
            cells += [f"{told.large} of {told.compared}", most]
        table.append((test, *cells))
    every = [row for rows_of in of[cases.LAW_FACTOR].values() for row in rows_of]
    return {"rows": table, "summary": cases.summary(every), "tests": list(of[cases.LAW_FACTOR])}


def in_loop(r: Results) -> dict[str, Any]:
    """Driver and assist in the loop."""
    remembering = r.remembers()
    every = [row for row in r.effects if row.case.factor == cases.UNASSISTED_LAW_FACTOR]
    assisted = [row for row in r.effects if row.case.factor == cases.LAW_FACTOR and row.case.level in remembering]
    rows, shares = _with_driver(r)
    large = sorted((key for key, share in shares.items() if share > MATTERS), key=lambda key: -shares[key])
    most: dict[str, float] = {}
    for key in large:
        most.setdefault(key[1], shares[key])  # the largest first
    return {
        "bare": cases.summary([row for row in every if row.case.level in remembering]),
        "assisted": cases.summary(assisted),
        "levels": _summaries(cases.by_level(every)),
        "large": len(large),
        "comparisons": len(remembering) * len(rows),
        "most": most,
        "columns": [f"{law} less {BASE_LAW}" for law in r.laws if law != BASE_LAW],
        "rows": rows,
    }


def _with_driver(r: Results) -> tuple[list[tuple[str, ...]], dict[tuple[str, str, str], float]]:
    """Rows of the table, and the real differences of laws with pre-sliding by task, metric and law, as shares [1]."""
    rows, shares = [], {}
    for task in dict.fromkeys(each.task for each in r.driven):
        mine = {each.law: each.metrics for each in r.driven if each.task == task}
        for metric, base in mine[BASE_LAW].items():
            scale, cells = abs(float(np.mean(base))), []
            for law in r.laws:
                if law == BASE_LAW:
                    continue
                gap, half = cases.paired_difference(mine[law][metric], base)
                cells.append(within(gap, half))
                if law in r.remembers() and not abs(gap) <= half and scale > 0.0:
                    shares[task, metric, law] = abs(gap) / scale
            rows.append((task.removeprefix("steer_env/"), label(metric), number(float(np.mean(base))), *cells))
    return rows, shares


def confusion(r: Results) -> list[dict[str, Any]]:
    """Which law is taken for which on synthetic records, by kind of record and noise."""
    found = []
    for record in r.scope.records:
        for noise in r.scope.noises:
            table = records.shares(r.confusion, record, noise)
            laws = list(table)
            taken = {truth: [law for law in laws if law != truth and table[truth][law] > 0.5] for truth in laws}
            found.append(
                {
                    "record": record,
                    "noise": noise,
                    "table": table,
                    "rows": [(truth, *(percent(of[law], 2) for law in laws)) for truth, of in table.items()],
                    "folded": noise != r.scope.noises[0],
                    "taken": {truth: others for truth, others in taken.items() if others},
                    "others": float(np.mean([sum(of.values()) - of[truth] for truth, of in table.items()])),
                    "own": float(np.mean([table[truth][truth] for truth in laws])),
                }
            )
    return found


def as_json(r: Results) -> dict[str, Any]:
    """The numbers of the study; null for what is not finite."""

    def finite(x: float | None) -> float | None:
        return x if x is not None and math.isfinite(x) else None

    effects = [
        {
            "factor": row.case.factor, "level": row.case.level, "test": row.test, "metric": row.metric,
            "base": finite(row.base.value), "unit": row.base.unit, "difference": finite(row.found.value),
            "half_width": finite(row.found.half_width), "share": finite(row.found.share), "real": row.found.real,
            "perception": row.found.perception.verdict, "perception_sure": row.found.perception.sure,
        }
        for row in r.effects
        if math.isfinite(row.found.value)
    ]  # fmt: skip
    judged = {
        each.law: {
            **{name: finite(getattr(each, name)) for name in ("error", "low", "high")},
            "parameters": None if each.parameters is None else friction.law.as_mapping(each.parameters),
            "undetermined": list(each.undetermined),
            "remarks": list(each.remarks),
            "alike": list(each.alike),
        }
        for each in r.judged
    }
    confused = [{**each._asdict(), "errors": {k: finite(v) for k, v in each.errors.items()}} for each in r.confusion]
    return {
        "record": {
            "laws": judged,
            "repeatability": r.repeatability,
            "held_out": records.HELD_OUT,
            "notes": list(r.record.notes),
        },
        "road": {
            row.name: {
                "unseen": row.crossed,
                "residual": row.residual,
                "adds": row.adds,
                "adds_interval": row.adds_interval,
                "level": row.level,
                "level_interval": row.level_interval,
            }
            for row in r.road.rows
        },
        "steps": {law: [row._asdict() for row in of] for law, of in r.tables.items()},
        "effects": effects,
        "apart": r.apart,
        "held_torque": [each._asdict() for each in r.held],
        "driver": [each._asdict() for each in r.driven],
        "confusion": confused,
        "real_time": r.times.as_json(),
    }


PAGE_NAME = "friction"


def main(argv: Sequence[str] | None = None, sweep: Runner = run, car: Car | None = None) -> None:
    """Answer which friction law is more accurate, which runs in real time, and what the choice changes."""
    parser = pages.parser(PAGE_NAME, main.__doc__)
    car_options.add(parser)
    text = "three tests, one noise and few repeats in place of the whole battery: for a first look"
    parser.add_argument("--quick", action="store_true", help=text)
    args = parser.parse_args(argv)
    pages.check(args.out, PAGE_NAME)
    car = car or car_options.load(args)
    with progress("computing") as notify:
        results = collect(car, QUICK_SCOPE if args.quick else full(), sweep=sweep, notify=notify)
    found = make_page(results)
    print("\n".join([*found.verdict, *found.timing]))
    made: dict[str, Any] = {"car": car, "friction": results.laws}
    print(pages.write(args.out, found, as_json(results), pages.study_trace(PAGE_NAME, argv, args.out, **made)))
