"""The evaluation report: effects of the friction law on feel, accuracy and real-time cost.

``build_report`` writes ``index.html`` (self-contained) and ``metrics.json`` into a directory beside the target, which
replaces the target when everything is done. The page begins with what a person reads in two minutes; details are
folded.
"""

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from steer_env import metrics, targets
from steer_env.experiments.pages import pictures, plots, provenance
from steer_env.experiments.pages.files import replaced_directory
from steer_env.experiments.pages.metrics_json import entries
from steer_env.experiments.pages.pages import LIVE_FOLDER, OtherPage, Page, image, write_page
from steer_env.experiments.pages.style import picture_folder
from steer_env.experiments.reports import report_findings
from steer_env.experiments.reports.report_results import TIMED, Drives, Notify, Part, Results, Scope, base_law, collect
from steer_env.experiments.studies import friction_laws, loop_width, real_time, vehicle
from steer_env.experiments.studies.common import battery, computing_time
from steer_env.experiments.sweep import Runner, run
from steer_env.metrics.common import just_noticeable
from steer_env.metrics.common.filtered_channels import ANGLE, TORQUE
from steer_env.vehicle import plant
from steer_env.vehicle.steering.eps import SAMPLE_TIME

CONTENTS = frozenset({"index.html", "metrics.json", LIVE_FOLDER})
EVERYTHING = Scope()
LONGEST = 10  # rows of the first table


class Look(NamedTuple):
    """How the page shows the results."""

    full: bool = False  # interactive plots in place of pictures, which makes the page ten times as large
    noticed: float = just_noticeable.SHARE  # just-noticeable difference of sustained torque and angle [1]


DEFAULT = Look()


def metrics_json(results: Results, source: dict[str, Any], look: Look = DEFAULT) -> dict[str, Any]:
    """The numbers of the report: metrics of the weave by name, those of other tests with the test's name ahead."""
    return {
        "metrics": {
            law: {
                _key(test, name): entry
                for test, drives in results.drives.items()
                for name, entry in entries(drives[law].values).items()
            }
            for law in results.laws
        },
        "verdict": report_findings.verdict(results, report_findings.terms(results, look.noticed)),
        "small_turns": {law: entries(drive.values) for law, drive in results.small_turns.items()},
        "differences": _differences_json(results.drives, results.base, look.noticed),
        "fitted": _fitted_json(results, look.noticed),
        "real_time": {
            "case": "column alone, hand torque 2.5 N m at 0.5 Hz",
            "units": {"step": "s", "error": "1", "ns": "ns", "over_base": "1"},
            "laws": {law: [row._asdict() for row in rows] for law, rows in results.tables.items()},
            "times": results.times.as_json(),
        },
        "held_torque": [_plain(test._asdict(), "torque") for test in results.held],
        "margins": {speed: [_plain(cell._asdict()) for cell in cells] for speed, cells in results.margins.items()},
        **({"vehicle": _vehicle_json(results)} if results.vehicle else {}),
        "provenance": source,
    }


def _plain(row: Mapping[str, Any], *without: str) -> dict[str, Any]:
    """What JSON holds of a row; None for numbers that are not finite."""
    known = {key: value for key, value in row.items() if key not in without}
    return {key: None if isinstance(x, float) and not math.isfinite(x) else x for key, x in known.items()}


def _key(test: str, metric: str) -> str:
    return metric if test == "weave" else f"{test.replace('-', '_')}.{metric}"


def _differences_json(drives: Drives, base: str, noticed: float) -> dict[str, Any]:
    """Differences from the base law; those of refused metrics are left out."""
    found: dict[str, dict[str, Any]] = {law: {} for of in drives.values() for law in of if law != base}
    for row in report_findings.differences(drives, base, noticed).rows:
        if math.isfinite(row.found.value):
            found[row.law][_key(row.test, row.metric)] = battery.as_json(row.found)
    return {"base": base, "noticed_share": noticed, "laws": found}


def _fitted_json(results: Results, noticed: float) -> dict[str, Any]:
    """The laws as fitted to the measured friction, and their differences where there are two."""
    term, on_terms = results.fitted, report_findings.terms(results, noticed)
    laws = {law: {**provenance.law(p), "undetermined": list(term.undetermined[law])} for law, p in term.laws.items()}
    found = _differences_json(term.drives, on_terms[1].base, noticed) if len(on_terms) > 1 else None
    return {"laws": laws, "differences": found}


def _vehicle_json(results: Results) -> dict[str, Any]:
    study = results.vehicle
    assert study is not None
    return {
        "weave_peaks": {
            "units": {name: unit for name, unit in plant.CHANNELS if name in vehicle.SHOWN_CHANNELS},
            **{row.title: row.values for row in study.peaks},
        },
        "parking": {state: entries(found.values) for state, found in study.parking.items()},
    }


def provenance_of(results: Results) -> dict[str, Any]:
    """Versions, laws, car and manoeuvres of a report."""
    return {
        **provenance.versions(),
        "laws": {law: provenance.law(p) for law, p in results.laws.items()},
        "calibration": provenance.calibration(),
        "car": provenance.car(results.car),
        **({"external_vehicle": provenance.input_file(results.chassis)} if results.chassis else {}),
        "manoeuvres": {
            test: {
                "definition": manoeuvre.definition,
                "source": manoeuvre.source,
                "amplitude_rad" if manoeuvre.robot else "amplitude_nm": {
                    law: drive.amplitude if math.isfinite(drive.amplitude) else None
                    for law, drive in results.drives[test].items()
                },
            }
            for test, manoeuvre in results.manoeuvres.items()
        },
    }


class Ahead(NamedTuple):
    """What was drawn while other parts were computed."""

    plots: dict[str, "Plot"]  # by test
    pictures: dict[str, dict[str, str]]  # as SVG by name, by part of the results


def make_page(results: Results, source: dict[str, Any], look: Look = DEFAULT, ahead: Ahead | None = None) -> Page:
    """The page: what ``report.html.j2`` refers to by name, the numbers as ``r``."""
    ahead = ahead or Ahead({}, {})
    plots_of = {
        test: ahead.plots.get(test) or plot(test, drives, results.base, look.full)
        for test, drives in results.drives.items()
    }
    feels = {test: report_findings.feel(results, test, look.noticed) for test in results.drives}
    terms = report_findings.terms(results, look.noticed)
    drawn = {**_first_pictures(results, terms, look.noticed), **_pictures(results, ahead.pictures)}
    weave = _loops(results.drives.get("weave", {}), results.base)
    values = {
        "verdict": report_findings.verdict(results, terms),
        "small_turns": report_findings.small_turns(results),
        "turn": math.degrees(friction_laws.SMALL_TURN),
        "r": results,
        "source": source,
        "findings": report_findings,
        "feels": feels,
        "terms": terms,
        "differences": terms[0].differences,
        "look": look,
        "longest": LONGEST,
        "study": friction_laws,
        "timing": real_time,
        "computing": computing_time,
        "width": loop_width,
        "noticeable": just_noticeable,
        "definitions": {name: metrics.definition(name) for test in results.drives for name in metrics.available(test)},
        "coincident": pictures.coincident(weave) if weave else [],
        "images": {name: image(svg) for name, svg in drawn.items()},
        "plots": {test: shown for test, shown in plots_of.items() if shown.html},
        "script": plots.script() if look.full else "",
        "wanted": targets.load(report_findings.WANTED),
        "rate": targets.rating,
    }
    return Page("report", values)


def _loops(drives: Mapping[str, battery.Drive], base: str) -> dict[str, Any]:
    """Curves of a weave by law, those of the base law first; none where a law has not both of its channels."""
    curves = {law: drives[law].curves for law in sorted(drives, key=lambda law: law != base)}
    return curves if all({ANGLE, TORQUE} <= of.keys() for of in curves.values()) else {}


def _first_pictures(results: Results, terms: Sequence[report_findings.OnTerm], noticed: float) -> dict[str, str]:
    """The pictures that come first, as SVG by name; without a test or a difference its picture is missing."""
    history = friction_laws.HISTORIES["growing_sine"].x
    laws = sorted(results.torques, key=lambda law: law != results.base)
    drawn = {"first_loops": pictures.loops(history, {law: results.torques[law]["growing_sine"] for law in laws})}
    for name, drives in (("first_small_turns", results.small_turns), ("first_weave", results.drives.get("weave", {}))):
        if curves := _loops(drives, results.base):
            drawn[name] = pictures.weave(curves)
    shares = {term.title: {law: [row.of_base for row in of.known] for law, of in term.laws.items()} for term in terms}
    if any(values for of in shares.values() for values in of.values()):
        drawn["first_terms"] = pictures.terms(shares, noticed)
        with picture_folder(None):
            drawn["narrow_terms"] = pictures.terms(shares, noticed, narrow=True)
    return drawn


def _pictures(results: Results, ahead: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Every picture as SVG, by name; ``ahead`` are those of parts that are drawn."""
    drawn = {
        "characteristics": pictures.characteristics(friction_laws.HISTORIES, results.torques),
        "reversal": pictures.reversal_and_hold(friction_laws.HISTORIES, results.torques),
        "margins": pictures.margins(results.margins, report_findings.TARGETS),
    }
    if results.tables:
        drawn["real_time"] = pictures.real_time(results.tables, real_time.USABLE)
    if results.held:
        step = friction_laws.THINNING * SAMPLE_TIME
        for state in friction_laws.ASSIST:
            tests = [test for test in results.held if test.assist == state]
            drawn[f"held_{state}"] = pictures.held_torque(tests, step, friction_laws.SETTLING)
    for name, result in (("full vehicle", results.vehicle), ("loop widths", results.loop_width)):
        if result:
            drawn |= ahead.get(name) or _of_part(name, result)
    return drawn


def _of_part(name: str, result: Any) -> dict[str, str]:
    """Pictures of which one part of the results holds everything, as SVG by name; none for other parts."""
    if name == "full vehicle":
        return {"chassis": pictures.chassis(result.cycles), "parking": pictures.parking(result.parking)}
    if name == "loop widths":
        return {"loop_width": pictures.loop_width(loop_width.panels(result))}
    return {}


class Plot(NamedTuple):
    """The plot of a test."""

    html: str  # empty where no law was driven
    left_out: list[str]  # laws whose lines coincide with those of the base law in every panel


def plot(test: str, drives: Mapping[str, battery.Drive], base: str, full: bool) -> Plot:
    """The plot of a test, interactive on a full page; for loops also the torque of every law less the base law's."""
    curves = {law: drive.curves for law, drive in drives.items() if drive.curves}
    pairs = metrics.evaluation_by_name(test).plots
    shown, left_out = plots.without_coincident(plots.panels(curves, pairs), base)
    if base in curves and "time" not in curves[base]:
        torques = [pair for pair in pairs if pair[1] == TORQUE]
        shown = shown[: len(torques)] + plots.differences(curves, base, torques)
    return Plot(plots.markup(shown, test, full), left_out)


def build_report(
    out: str | os.PathLike[str],
    laws: dict[str, Any],
    scope: Scope = EVERYTHING,
    notify: Notify = lambda part, what: None,
    look: Look = DEFAULT,
    trace: Mapping[str, Any] | None = None,
    sweep: Runner = run,
    beside: OtherPage | None = None,
) -> Results:
    """Write the report to a directory, which appears or is replaced as a whole.

    Parameters
    ----------
    out : path
        New, empty, or an earlier report.
    laws : mapping of str to parameters
        Label -> parameters of a friction law.
    scope : Scope
        Extent of the report.
    notify : callable
        Receives the part that is done, from 0 to 1, and what comes next.
    look : Look
        How the page shows the results.
    trace : mapping, optional
        What both files hold as their trace, by default car and laws without a command.
    sweep : Runner
        What runs the parts of the report; by default this process, one after the other.
    beside : Beside, optional
        The page to explore, which is written beside the report and linked to.

    Raises
    ------
    ValueError
        If ``out`` holds other files, a manoeuvre cannot be driven, or the car was changed so that no car file makes it.
    """
    kept = provenance.trace(car=scope.loaded(), friction=laws) if trace is None else trace
    ahead = Ahead({}, {})

    def draw(part: Part, result: Any) -> None:  # while other parts are computed
        if part.name == "test":
            ahead.plots[part.of] = plot(part.of, result, base_law(laws), look.full)
        else:
            ahead.pictures[part.name] = _of_part(part.name, result)

    with replaced_directory(Path(out), CONTENTS) as part:
        results = collect(laws, scope, notify, sweep, draw)
        notify(TIMED, "drawing")
        source = provenance_of(results)
        numbers = {"metrics.json": metrics_json(results, source, look)}
        write_page(part, make_page(results, source, look, ahead), numbers, kept, beside)
    notify(1.0, "done")
    return results
