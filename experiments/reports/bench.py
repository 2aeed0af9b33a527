"""The page of computing times: ratios beside other packages, cost of a row, shares of a step, and the numbers."""

import math
from typing import Any

from steer_env.experiments.pages import bench_pictures, provenance
from steer_env.experiments.pages.pages import Page
from steer_env.experiments.pages.words import number
from steer_env.experiments.studies.common import step_time
from steer_env.experiments.studies.common.computing_time import Estimate
from steer_env.experiments.studies.common.step_time import OWN_FRICTION, ROW_COUNTS, Case, Results, Time
from steer_env.friction.numerics.extras import install
from steer_env.vehicle import cars

PAGE_NAME = "bench"
TRACKS = {"single_track": "one track", "two_track": "two tracks"}


def _ratio(e: Estimate) -> str:
    return f"{number(e.median)} ({number(e.low)} to {number(e.high)})"


def _is_vector(case: Case) -> bool:
    return case.what.endswith("vector")


def _words(case: Case) -> str:
    """What a row of a table or picture is called."""
    what = case.label.removesuffix(", vector").replace("_", " ")
    return f"{what}, {case.rows:,} rows, {_threads(case)}" if _is_vector(case) else what


def _threads(case: Case) -> str:
    return f"{case.threads} thread{'s' if case.threads > 1 else ''}"


def _own_ratio(times: list[Time], chassis: str, rows: int, threads: int, what: str = "") -> Estimate | None:
    """The ratio of this project's environment with the friction of the car."""
    wanted = f"{OWN_FRICTION}, {chassis}{what}"
    return next((t.ratio for t in times if (t.case.what, t.case.rows, t.case.threads) == (wanted, rows, threads)), None)


def build_page(found: Results) -> tuple[Page, dict[str, Any]]:
    """The page and its numbers as JSON."""
    most = max(step_time.THREAD_COUNTS)
    shown = [
        t for t in found.times if not _is_vector(t.case) or (t.case.rows, t.case.threads) == (ROW_COUNTS[-1], most)
    ]
    versions = provenance.versions()
    values = {
        "single": {chassis: _own_ratio(found.times, chassis, 1, 1) for chassis in cars.SPEEDS},
        "many": {
            chassis: _own_ratio(found.times, chassis, ROW_COUNTS[-1], most, ", vector") for chassis in cars.SPEEDS
        },
        "rows": ROW_COUNTS[-1],
        "threads": most,
        "task": step_time.TASK,
        "base": step_time.CART,
        "ratios": bench_pictures.ratios(
            {_words(t.case): (t.ratio.median, t.ratio.low, t.ratio.high, t.case.program == "steer-env") for t in shown}
        ),
        "of_rows": bench_pictures.rows(_lines(found.times)),
        "shares": bench_pictures.shares(
            {
                TRACKS[chassis]: {s.name: s.share.median for s in found.shares if s.chassis == chassis}
                for chassis in dict.fromkeys(s.chassis for s in found.shares)
            }
        ),
        "times": [
            (
                t.case.label.removesuffix(", vector").replace("_", " "),
                f"{t.case.rows:,}",
                str(t.case.threads),
                _ratio(t.ratio),
                number(1e6 * t.seconds.median),
                "" if math.isnan(t.bytes_a_row) else number(1e-3 * t.bytes_a_row),
            )
            for t in found.times
        ],
        "plants": [(p.name.replace("_", " "), _ratio(p.ratio), number(1e9 * p.seconds.median)) for p in found.plants],
        "of_plant": [(TRACKS[chassis], *_largest(found, chassis)) for chassis in cars.SPEEDS],
        "of_step": [(s.name, TRACKS[s.chassis], _ratio(Estimate(*(100.0 * x for x in s.share)))) for s in found.shares],
        "compiled": [(f"{rows:,}", each.median) for rows, each in found.compiled],
        "starts": [
            (name.replace("_", " "), "" if math.isnan(c) else number(c), number(w)) for name, c, w in found.starts
        ],
        "notes": [f"{note}: {install('bench')}" for note in found.notes],
        "versions": versions,
    }
    return Page(PAGE_NAME, values), {**step_time.as_json(found), "versions": versions}


def _largest(found: Results, chassis: str) -> tuple[float, str, float]:
    """Share of the plant in a step [1], and the largest of its parts with its share."""
    shares = {s.name: s.share.median for s in found.shares if s.chassis == chassis}
    around = shares.pop(step_time.AROUND_PLANT, math.nan)
    name = max(shares, key=lambda name: shares[name], default="")
    return 1.0 - around, name, shares.get(name, math.nan)


def _lines(times: list[Time]) -> dict[str, tuple[list[int], list[float]]]:
    """Ratio of a row over the number of rows, a line for each vector environment with threads."""
    lines: dict[str, tuple[list[int], list[float]]] = {}
    for case, _, ratio, _ in times:
        if _is_vector(case) and (case.program != "steer-env" or case.what.startswith(OWN_FRICTION)):
            what = case.label.removesuffix(", vector").replace("_", " ")
            x, y = lines.setdefault(f"{what}, {_threads(case)}", ([], []))
            x.append(case.rows)
            y.append(ratio.median)
    return lines
