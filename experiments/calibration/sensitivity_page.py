"""The page of the sensitivity of metrics to parameters: heat maps, sentences and tables, and the numbers as JSON."""

import math
import textwrap
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from steer_env.experiments.calibration.problem import Range
from steer_env.experiments.calibration.screening import Effect
from steer_env.experiments.calibration.sensitivity import Results, Row
from steer_env.experiments.pages import tuning_pictures
from steer_env.experiments.pages.pages import Page
from steer_env.experiments.pages.tuning_pictures import Cell, Line, heat_map
from steer_env.experiments.pages.words import label, number, unit

NAME = "sensitivity"
SMALL = 0.1  # change that matters, as a share of what it is told as a share of; assumed [1]
TITLES = {
    "weave": "Weave, on centre",
    "release": "Release of the handwheel in a turn",
    "returnability": "Returnability at low speed",
    "step-steer": "Step steer",
    "parking": "Parking",
    "": "Assist loop, hands fixed",
}
PALE = f"grey: below {100.0 * SMALL:.0f} %, or not told apart from none; –: no value to compare with"
_LONGEST = 90  # letters of a reason in the picture


def share(row: Row, effect: Effect) -> float:
    """Size of a change as a share of the row's scale; NaN where the row has none [1]."""
    return effect.size / row.scale if row.scale else math.nan


def matters(row: Row, effect: Effect) -> bool:
    """Whether a change is large enough to matter, and is told apart from none."""
    return effect.low > 0.0 and share(row, effect) >= SMALL


def _cell(row: Row, effect: Effect) -> Cell:
    size, mark = 100.0 * share(row, effect), {1: "+", -1: "−", 0: "±"}[effect.sign]
    if math.isnan(size):
        return Cell("–", 0.0, 0.0, False)
    text = f"{mark}{size:.0f}" if round(size) else "0"
    return Cell(text, effect.sign * size, size, matters(row, effect))


def _line(row: Row, points: int) -> Line:
    text, note = unit(row.unit), ""
    own = f"{number(row.own)} {text}".strip()
    if row.band is None:
        about = own
    elif math.isinf(row.band[1]):
        about = f"{own} (from {number(row.band[0])})"
    else:
        about = f"{own} ({number(row.band[0])} to {number(row.band[1])})"
    if row.effects is None:
        note = textwrap.shorten(f"refused at {row.refused} of {points}: {row.reason}", _LONGEST)
    return Line(label(row.name), about, [_cell(row, e) for e in row.effects or ()], note)


def parameter_name(parameter: str) -> str:
    """A parameter in words; a key of a file or of a law as it is written there."""
    return parameter if "." in parameter else label(parameter)


def _columns(factors: Sequence[Range]) -> list[tuple[str, str]]:
    found = []
    for f in factors:
        name = textwrap.fill(parameter_name(f.name).replace(".", ". "), 9, break_long_words=False).replace(". ", ".")
        found.append((name, f"{number(f.low)} to\n{number(f.high)} {unit(f.unit)}".strip()))
    return found


def _picture(results: Results, rows: Sequence[Row], heads: tuple[str, str]) -> str:
    tests = dict.fromkeys(row.test for row in rows)
    groups = {TITLES.get(t, t): [_line(row, results.points) for row in rows if row.test == t] for t in tests}
    return heat_map(_columns(results.study.factors), groups, heads, PALE)


def ranking(results: Results, rows: Sequence[Row]) -> dict[str, float]:
    """Parameters by the mean of their shares over rows, the largest first [1]."""
    known = [row for row in rows if row.effects is not None and row.scale]
    means = {
        factor.name: float(np.mean([share(row, row.effects[j]) for row in known]))  # type: ignore[index]
        for j, factor in enumerate(results.study.factors)
    }
    return dict(sorted(means.items(), key=lambda item: -item[1]))


def _table(results: Results, rows: Sequence[Row]) -> list[tuple[str, ...]]:
    cells = []
    for row in rows:
        text = [
            f"{number(e.mean if e.sign else e.size)} ({number(e.low)} to {number(e.high)})" for e in row.effects or ()
        ] or ["–"] * len(results.study.factors)
        cells.append((label(row.name), row.test or "loop", unit(row.unit), *text, str(row.refused)))
    return cells


class Shown(NamedTuple):
    """The outputs of one section."""

    map: str  # SVG
    rows: list[tuple[str, ...]]


def build(results: Results) -> tuple[Page, dict[str, Any]]:
    """The page and its numbers as JSON."""
    wanted = [row for row in results.rows if row.band]
    others = [row for row in results.rows if not row.band]
    banded = [row for row in wanted if row.test]
    order, names = ranking(results, banded), [factor.name for factor in results.study.factors]
    of = {factor.name: factor for factor in results.study.factors}
    first, *_, last = order
    moved = {row.name: [n for n, e in zip(names, row.effects or ()) if matters(row, e)] for row in banded}
    alone = {parameter_name(name): [m for m, by in moved.items() if by == [name]] for name in names}
    refused = [row for row in results.rows if row.refused]
    of_bands = "change in % of the band's width,\nof a margin in % of its limit", "value now\n(band)"
    of_values = "change in % of the value now", "value now"
    values = {
        "r": results,
        "small": 100.0 * SMALL,
        "parameters": list(map(parameter_name, names)),
        "banded": len(banded),
        "most": {"name": parameter_name(first), "percent": 100.0 * order[first]},
        "least": {"name": parameter_name(last), "percent": 100.0 * order[last]},
        "ranking": tuning_pictures.ranking({parameter_name(name): share for name, share in order.items()}),
        "ranges": [
            (parameter_name(name), f"{number(of[name].low)} to {number(of[name].high)}", unit(of[name].unit))
            for name in order
        ],
        "still": [row.name for row in banded if row.effects is not None and not moved[row.name]],
        "alone": {name: by for name, by in alone.items() if by},
        "refused": refused,
        "reasons": [(label(row.name), f"{row.refused} of {results.points}", row.reason) for row in refused],
        "wanted": Shown(_picture(results, wanted, of_bands), _table(results, wanted)),
        "others": Shown(_picture(results, others, of_values), _table(results, others)),
    }
    return Page(NAME, values), _json(results)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _json(results: Results) -> dict[str, Any]:
    d, s = results.design, results.study
    return {
        "method": d.method,
        "blocks": d.points.shape[0],
        "parameter_sets": results.points,
        "seed": d.seed,
        "chassis": s.chassis,
        "friction": results.law,
        "targets": results.targets,
        "parameters": {
            f.name: {"unit": f.unit, "low": f.low, "high": f.high, "own": f.own, "logarithmic": f.logarithmic}
            for f in s.factors
        },
        "ranking": ranking(results, [row for row in results.rows if row.band and row.test]),
        "outputs": {
            row.name: {
                "test": row.test or "loop",
                "unit": row.unit,
                "own": _finite(row.own),
                "band": row.band and [_finite(end) for end in row.band],
                "scale": _finite(row.scale),
                "refused": row.refused,
                "reason": row.reason,
                "effects": row.effects
                and {
                    f.name: {key: _finite(x) for key, x in e._asdict().items()}
                    | {"sign": e.sign, "share": _finite(share(row, e)), "matters": matters(row, e)}
                    for f, e in zip(s.factors, row.effects)
                },
            }
            for row in results.rows
        },
    }
