"""The evaluation report: what the choice of a friction law does to feel, accuracy and real-time cost.

``build`` writes ``index.html`` (self-contained) and ``metrics.json`` into a directory beside the target, and puts that
in the target's place when everything is done.
"""

import math
import os
from base64 import b64encode
from pathlib import Path
from typing import Any

from steer_env import metrics, targets
from steer_env.experiments.drawing import figures, plots
from steer_env.experiments.output import provenance
from steer_env.experiments.output.files import replaced_directory, write_json
from steer_env.experiments.output.metrics_json import entries
from steer_env.experiments.report import assessment, findings
from steer_env.experiments.report.results import Notify, Results, Scope, collect
from steer_env.experiments.studies import (
    commonroad_cross_validation,
    friction_laws,
    full_vehicle,
    loop_width,
    real_time,
)
from steer_env.metrics.common.filtered_channels import TORQUE
from steer_env.vehicle import plant

CONTENTS = frozenset({"index.html", "metrics.json"})
EVERYTHING = Scope()
WANTED = "compact"  # targets that the summary holds the laws against


def metrics_json(results: Results, source: dict[str, Any]) -> dict[str, Any]:
    """The machine-readable half: metrics of the weave under their names, of other tests with that of the test ahead."""
    return {
        "metrics": {
            law: {
                ("" if test == "weave" else f"{test.replace('-', '_')}.") + name: entry
                for test, drives in results.drives.items()
                for name, entry in entries(drives[law].values).items()
            }
            for law in results.laws
        },
        "real_time": {
            "case": "column alone, hand torque 2.5 N m at 0.5 Hz",
            "units": {"step": "s", "error": "1", "ns_per_step": "ns", "worst_step_ns": "ns", "whole_car": "ns"},
            "laws": {law: [row._asdict() for row in rows] for law, rows in results.tables.items()},
            "whole_car": results.sample_ns,
        },
        **({"vehicle": _vehicle_json(results)} if results.vehicle else {}),
        "provenance": source,
    }


def _vehicle_json(results: Results) -> dict[str, Any]:
    study, compared = results.vehicle, results.cross_validation
    assert study is not None
    assert compared is not None
    return {
        "weave_peaks": {
            "units": {name: unit for name, unit in plant.CHANNELS if name in full_vehicle.SHOWN},
            **{row.title: row.values for row in study.peaks},
        },
        "parking": {state: entries(found.values) for state, found in study.parking.items()},
        "cross_validation": commonroad_cross_validation.entries(compared),
    }


def provenance_of(results: Results) -> dict[str, Any]:
    """Versions, laws, car and manoeuvres of a report."""
    return {
        **provenance.versions(),
        "laws": {law: provenance.law(p) for law, p in results.laws.items()},
        "calibration": provenance.calibration(),
        "car": provenance.car(results.car),
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


def render(results: Results, source: dict[str, Any]) -> str:
    """The page."""
    return (
        assessment.environment()
        .get_template("report.html.j2")
        .render(
            r=results,
            source=source,
            findings=findings,
            study=friction_laws,
            timing=real_time,
            crossing=commonroad_cross_validation,
            width=loop_width,
            definitions={name: metrics.definition(name) for test in results.drives for name in metrics.available(test)},
            images={name: _image(svg) for name, svg in _figures(results).items()},
            plots=_plots(results),
            script=plots.script(),
            wanted=targets.load(WANTED),
            light=targets.rating,
        )
    )


def _figures(results: Results) -> dict[str, str]:
    """SVG of every figure, by name."""
    drawn = {
        "characteristics": figures.characteristics(results.torques),
        "reversal": figures.reversal_and_hold(results.torques),
        "real_time": figures.real_time(results.tables),
        "margins": figures.margins(results.margins, findings.TARGETS),
    }
    if results.held:
        drawn |= {f"held_{state}": figures.held_torque(results.held, state) for state in friction_laws.ASSIST}
    if results.vehicle:
        drawn["chassis"] = figures.chassis(results.vehicle.cycles)
        drawn["parking"] = figures.parking(results.vehicle.parking)
    if results.cross_validation:
        shown = {
            name: found for name, found in results.cross_validation.items() if name in commonroad_cross_validation.SHOWN
        }
        drawn["cross_validation"] = figures.cross_validation(shown)
    if results.loop_width:
        drawn["loop_width"] = figures.loop_width(loop_width.panels(results.loop_width))
    return drawn


def _plots(results: Results) -> dict[str, str]:
    """Interactive plots by test; of loops with the torque less the base law's."""
    drawn = {}
    for test, drives in results.drives.items():
        curves = {law: drive.curves for law, drive in drives.items() if drive.curves}
        pairs = metrics.evaluation_by_name(test).plots
        shown = plots.panels(curves, pairs)
        if results.base in curves and "time" not in curves[results.base]:
            torques = [pair for pair in pairs if pair[1] == TORQUE]
            shown = shown[: len(torques)] + plots.apart(curves, results.base, torques)
        if shown:
            drawn[test] = plots.draw(shown, height=330)
    return drawn


def _image(svg: str) -> str:
    return "data:image/svg+xml;base64," + b64encode(svg.encode()).decode()


def build(
    out: str | os.PathLike[str],
    laws: dict[str, Any],
    scope: Scope = EVERYTHING,
    notify: Notify = lambda part, what: None,
) -> Results:
    """Write the report to a directory, which appears, or is replaced, whole or not at all.

    Parameters
    ----------
    out : path
        New, empty, or an earlier report.
    laws : mapping of str to parameters
        Label -> parameters of a friction law.
    scope : Scope
        How much of everything.
    notify : callable
        Gets the part that is done, from 0 to 1, and what comes next.

    Raises
    ------
    ValueError
        If ``out`` holds other files, or a manoeuvre cannot be driven.
    """
    with replaced_directory(Path(out), CONTENTS) as part:
        results = collect(laws, scope, notify)
        notify(0.96, "drawing")
        source = provenance_of(results)
        (part / "index.html").write_text(render(results, source), encoding="utf-8")
        write_json(part / "metrics.json", metrics_json(results, source))
    notify(1.0, "done")
    return results
