"""The page of a production: shares in the target bands, distributions, what drives failures, and the table as JSON."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from steer_env.experiments.calibration.production import INNER, Driver, Judged, Results, Share
from steer_env.experiments.calibration.sensitivity_page import TITLES, parameter_name
from steer_env.experiments.pages import tuning_pictures
from steer_env.experiments.pages.pages import Page
from steer_env.experiments.pages.tuning_pictures import Spread
from steer_env.experiments.pages.words import label, number, unit

NAME = "production"
SHOWN = 10  # metrics, the worst ones, in the answer


def percent(share: Share) -> str:
    """A share with its interval, in per cent: no more digits than the number of cars gives."""
    digits = 0 if share.of < 300 else 1
    value, low, high = (f"{100.0 * x:.{digits}f}" for x in (share.value, *share.interval))
    return f"{value} % ({low} to {high} %)" if share.of else "–"


def _band(row: Judged) -> str:
    low, high = row.band.good
    return f"from {number(low)}" if math.isinf(high) else f"{number(low)} to {number(high)}"


def _test(row: Judged) -> str:
    return TITLES.get(row.test, row.test)


def _driver_words(drivers: Sequence[Driver]) -> str:
    """The parameters that are told to drive failures, with the side of failing cars and the distance."""
    found = [f"{parameter_name(d.name)} {'high' if d.high else 'low'} ({d.distance:.2f})" for d in drivers if d.told]
    return ", ".join(found)


def _shares(rows: Sequence[Judged]) -> list[tuple[str, ...]]:
    return [
        (
            label(row.name), _test(row), unit(row.unit), _band(row), number(row.own), percent(row.share),
            percent(row.fair), str(row.below), str(row.above), str(row.refused),
        )
        for row in rows
    ]  # fmt: skip


def _spread(row: Judged) -> Spread | None:
    """Where the cars lie in a band with two ends."""
    low, high = row.band.good
    if math.isinf(high):
        return None
    known = row.values[np.isfinite(row.values)]
    fair = (row.band.fair[0] - low) / (high - low), (row.band.fair[1] - low) / (high - low)
    return Spread((known - low) / (high - low), (row.own - low) / (high - low), fair)


def build(results: Results) -> tuple[Page, dict[str, Any]]:
    """The page and its numbers as JSON."""
    rows = sorted(results.judged, key=lambda row: row.share.value)
    failing = [row for row in rows if row.share.cars < row.share.of]
    gain = sorted(results.narrowed.items(), key=lambda item: -item[1].value if item[1].of else 1.0)
    spreads = {label(row.name): spread for row in rows if (spread := _spread(row)) is not None}
    of = {f.name: f for f in results.study.factors}
    values = {
        "r": results,
        "total": percent(results.total),
        "fair": percent(results.fair),
        "failing": failing,
        "held": percent(results.held),
        "outside": [row for row in rows if not row.nominal],
        "shares": tuning_pictures.shares(
            {label(row.name): (row.share.value, *row.share.interval) for row in rows[:SHOWN]}
        ),
        "worst": [(label(r.name), percent(r.share), str(r.below), str(r.above)) for r in rows[:SHOWN]],
        "tolerances": [
            (parameter_name(f.name), f"{number(f.low)} to {number(f.high)}", number(f.own), unit(f.unit))
            for f in results.study.factors
        ],
        "spread": tuning_pictures.distributions(spreads),
        "rows": _shares(rows),
        "refused": [(label(r.name), f"{r.refused} of {r.share.of}", r.reason) for r in rows if r.refused],
        "drivers": [d for d in results.drivers if d.told],
        "names": {name: parameter_name(name) for name in of},
        "of_total": [
            (parameter_name(d.name), f"{d.distance:.2f}", "high" if d.high else "low", "yes" if d.told else "no")
            for d in results.drivers
        ],
        "of_each": [(label(r.name), percent(r.share), _driver_words(r.drivers) or "none told apart") for r in failing],
        "inner": 100.0 * INNER,
        "gain": [(parameter_name(name), percent(share), str(share.of)) for name, share in gain],
    }
    return Page(NAME, values), _json(results)


def _share(share: Share) -> dict[str, Any]:
    return {"cars": share.cars, "of": share.of, "share": _finite(share.value), "ci": list(share.interval)}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _json(r: Results) -> dict[str, Any]:
    return {
        "chassis": r.study.chassis,
        "friction": r.law,
        "targets": r.targets,
        "tests": list(r.study.tests),
        "distribution": r.distribution,
        "seed": r.seed,
        "tolerances": {f.name: {"unit": f.unit, "low": f.low, "high": f.high, "own": f.own} for f in r.study.factors},
        "total": {
            **_share(r.total),
            "fair": _share(r.fair),
            "held": _share(r.held),
            "drivers": [d._asdict() for d in r.drivers],
        },
        "outputs": {
            row.name: {
                "test": row.test or "loop",
                "unit": row.unit,
                "own": _finite(row.own),
                "good": [_finite(end) for end in row.band.good],
                **_share(row.share),
                "fair": _share(row.fair),
                "below": row.below,
                "above": row.above,
                "refused": row.refused,
                "reason": row.reason,
                "drivers": [d._asdict() for d in row.drivers],
            }
            for row in r.judged
        },
        "narrowed": {name: _share(share) for name, share in r.narrowed.items()},
        "units": r.cars.units,
        "cars": {name: [_finite(x) for x in values.tolist()] for name, values in r.cars.columns.items()},
    }
