"""The page and the files of a hand torque that was identified from a drive (:mod:`steer_env.hand_torque`).

``write`` makes ``index.html``, ``fit.json`` with everything, and, where its car can be driven through the drive,
``car.toml``, fitted to it, with ``friction.json``, the friction at its column, which ``--friction`` takes.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from steer_env import friction
from steer_env.experiments.calibration.column_fit import LONGEST, RUN_IN, TERMS, ColumnFit
from steer_env.experiments.pages.files import replaced_directory
from steer_env.experiments.pages.pages import LIVE, Beside, Page, image, place
from steer_env.experiments.pages.plots import thinned
from steer_env.experiments.pages.style import PALETTE, new_figure, styled
from steer_env.experiments.reports.friction_fit_page import LAW_TITLES
from steer_env.friction.fitted_file import UNITS as LAW_UNITS
from steer_env.hand_torque import Identified
from steer_env.hand_torque.drive import FEWEST
from steer_env.hand_torque.fit import NONE, VISCOUS, Fitted, at_ends
from steer_env.hand_torque.model import MAPS, RATE, UNITS, on_samples
from steer_env.metrics.common.just_noticeable import LEAST, SHARE
from steer_env.vehicle import cars

ROWS = 10  # of the first table
SECONDS = 30.0  # of the judging part that are drawn over time [s]
POINTS = 1500  # of a picture, at most
TITLES = {NONE: "no damping, no friction", VISCOUS: "damping alone (viscous)"}
NOTICED = SHARE * LEAST["N m"]  # smallest difference of a sustained torque that is known to be noticed [N m]
SITES = {"F_u": "above", "F_c": "below"}  # level -> where its friction is, by the torsion bar
PRIOR = ("ratio", "wheelbase", "understeer")  # of (H2), not determined


class Term(NamedTuple):
    """A coefficient of (H1) of the best row, as a reader sees it."""

    name: str
    value: float  # [unit]
    unit: str
    meaning: str


MEANINGS = {
    "T_0": "offset of sensor and road",
    "k": "gradient over lateral acceleration, left over by the assist",
    "T_c": "steep part on centre",
    "k_3": "cubic part",
    "C": "damping, of the assist too",
    "I": "inertia",
}


def contents() -> frozenset[str]:
    """Names of the files of an output."""
    return frozenset({"index.html", "fit.json", "car.toml", "friction.json", LIVE})


def title(name: str) -> str:
    """Name of a row for readers."""
    return {**LAW_TITLES, **TITLES}.get(name, name.replace("_", " "))


def rms(found: Identified) -> float:
    """Root mean square of the torque of the judging part about its mean [N m]."""
    d = found.drive
    return float(np.std(d.torque[found.first :][d.weight[found.first :] > 0.0]))


def first_rows(found: Identified) -> list[Fitted]:
    """The rows of the first table: both without friction, and the dry laws that leave least."""
    dry = {row.name for row in found.dry[: ROWS - 2]}
    return [row for row in found.rows if row.name in dry or row.name in TITLES]


def law_file(fit: ColumnFit, law: str) -> dict[str, Any]:
    """The file of the friction at the column of the fitted car, which ``friction="friction.json"`` takes."""
    return {
        "friction": friction.as_mapping(fit.friction),
        "units": dict(LAW_UNITS),
        "level": None,
        "interval_of_level": list(fit.intervals.get("F_c", (0.0, 0.0))),
        "undetermined": [],
        "notes": [f"{law} friction at the column of car.toml beside this file, identified with it from one drive"],
    }


def fitted_car(fit: ColumnFit, name: str) -> cars.Car:
    """The fitted car with its name and where it comes from."""
    base = fit.car
    trail = ", the pneumatic trail" if "n" in fit.terms else ""
    return base._replace(
        name=f"{base.name}_{name}",
        description=f"{base.name}, with boost, motor damping{trail} and friction identified from the drive {name}",
        source=f"identified from the drive {name}: assist.boost, assist.damping{trail} and the friction in "
        "friction.json beside this file, with steering.friction_load = 0. Everything else is the prior, "
        f"{base.name}: {base.source}",
    )


def as_json(found: Identified, of_car: ColumnFit | str) -> dict[str, Any]:
    """Everything that was found, as JSON; null for a number that is not finite."""
    d = found.drive
    return {
        "verdict": page_of(found, "", "").verdict[0],
        "car": {"refused": of_car} if isinstance(of_car, str) else _car(of_car),
        "judged_from": float(d.time[found.first]),
        "seconds_fitted": float(d.weight[: found.first].sum() * d.dt),
        "seconds_judged": float(d.weight[found.first :].sum() * d.dt),
        "corrections": d.turns,
        "torque_rms": rms(found),
        "growth": _plain(found.growth),
        "growth_interval": [_plain(x) for x in found.growth_interval],
        "chosen": found.chosen,
        "equals": list(found.equals),
        "apart": found.apart,
        "noticed_from": NOTICED,
        "shape": found.shape,
        "shapes": {each.name: {"by_time": each.by_time, "beyond": each.beyond} for each in found.shapes},
        "prior": d.prior._asdict(),
        "not_determined": list(PRIOR),
        "notes": [*d.notes, *at_ends(found)],
        "rows": {row.name: _row(row) for row in found.rows},
    }


def _car(fit: ColumnFit) -> dict[str, Any]:
    return {
        "speed": fit.speed,
        "at_limits": list(fit.limited),
        "residual": fit.residual,
        "adds": fit.adds,
        "adds_interval": list(fit.adds_interval),
        "one_site": fit.one_site or None,
        "shown": fit.shown,
        "terms": {
            name: {"value": value, "interval": list(fit.intervals[name]), "unit": TERMS[name].unit}
            for name, value in fit.terms.items()
        },
    }


def sites_said(fit: ColumnFit) -> str:
    """What the fit of a car says of friction above the torsion bar and below it, in one sentence."""
    if fit.one_site:
        return fit.one_site
    told = []
    for level, where in SITES.items():
        low, high = fit.intervals[level]
        shown = f"{fit.terms[level]:.3f} N m [{low:.3f}, {high:.3f}]"
        told.append(f"{where} {shown if fit.shown[level] else f'not shown, at most {high:.3f} N m'}")
    return f"friction above the torsion bar is told from friction below it: {', '.join(told)}"


def _row(row: Fitted) -> dict[str, Any]:
    return {
        "residual": row.residual,
        "interval": list(row.interval),
        "adds": row.adds,
        "adds_interval": list(row.adds_interval),
        "fitted": row.fitted,
        "crossed": row.crossed,
        "level": row.level,
        "level_interval": list(row.level_interval),
        "presliding_deg": _plain(math.degrees(row.x_c)),
        "presliding_deg_interval": [_plain(math.degrees(x)) for x in row.x_c_interval],
        "a_c": row.model.a_c,
        "terms": {name: {"value": value, "unit": UNITS[name]} for name, value in row.model.terms.items()},
    }


def _plain(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


@styled
def measured_over_predicted(found: Identified) -> Figure:
    """Measured over predicted torque of the judging part, and both over time."""
    d, figure = found.drive, new_figure(9.6, 3.2)
    figure.set_label("measured_over_predicted")
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 2.0))
    predicted = on_samples(found.best.judged, d.angle, d.speed, d.dt)
    used = np.flatnonzero((np.arange(d.time.size) >= found.first) & (d.weight > 0.0))
    x, y = thinned(predicted[used], POINTS), thinned(d.torque[used], POINTS)
    ends = [min(x.min(), y.min()), max(x.max(), y.max())]
    left.plot(x, y, ".", color=PALETTE[0], markersize=2.0, alpha=0.5)
    left.plot(ends, ends, color="#777777", linewidth=1.0)
    left.set(title="part that was not fitted", xlabel="predicted torque [N m]", ylabel="measured torque [N m]")
    shown = used[: round(SECONDS * RATE)]
    right.plot(d.time[shown], d.torque[shown], color="#9aa3ad", linewidth=1.8, label="measured")
    right.plot(d.time[shown], predicted[shown], color=PALETTE[1], linewidth=1.2, label="predicted")
    right.set(title=f"first {SECONDS:.0f} s of it", xlabel="time [s]", ylabel="torque [N m]")
    right.legend(loc="upper right", ncols=2)
    return figure


def page_of(found: Identified, name: str, folder: str, of_car: ColumnFit | str = "") -> Page:
    """The page; ``name`` is that of the drive, ``of_car`` the fitted car, or why there is none."""
    best = found.best
    terms = [Term(key, value, UNITS[key], MEANINGS[key]) for key, value in best.model.terms.items()]
    values = {
        "found": found,
        "drive_name": name,
        "folder": folder,
        "drive": found.drive,
        "of_car": None if isinstance(of_car, str) else of_car,
        "refused": of_car,
        "car_terms": TERMS,
        "sites_said": "" if isinstance(of_car, str) else sites_said(of_car),
        "limited": () if isinstance(of_car, str) else of_car.limited,
        "longest": LONGEST,
        "run_in": RUN_IN,
        "notes": [*found.drive.notes, *at_ends(found)],
        "best": best,
        "rows": first_rows(found),
        "rms": rms(found),
        "equals": [title(law) for law in found.equals],
        "title": title,
        "terms": terms,
        "shape_terms": MAPS[found.shape],
        "seconds": found.drive.weight[found.first :].sum() * found.drive.dt,
        "fitted_seconds": found.drive.weight[: found.first].sum() * found.drive.dt,
        "picture": image(measured_over_predicted(found)),
        "noticed": NOTICED,
        "fewest": FEWEST,
        "degrees": math.degrees,
        "without": found.row(VISCOUS),
    }
    return Page("steering_fit", values)


def write(
    out: Path,
    found: Identified,
    name: str,
    of_car: ColumnFit | str,
    trace: Mapping[str, Any],
    beside: Beside | None = None,
) -> None:
    """Write page, JSON and the fitted car with its friction into a directory, which is replaced as a whole.

    ``of_car`` is of :func:`steer_env.experiments.calibration.column_fit.fit_column`, or says why there is none;
    ``trace`` is of :func:`steer_env.experiments.pages.provenance.trace`. Page and JSON files hold both.
    ``beside`` is the page to explore, which is written beside it and linked to.
    """
    files = {"fit.json": as_json(found, of_car)}
    if not isinstance(of_car, str):
        files["friction.json"] = law_file(of_car, title(found.best.name) if found.dry else "no dry")
    with replaced_directory(out, contents()) as part:
        place(part, page_of(found, name, out.name, of_car), files, trace, beside)
        if not isinstance(of_car, str):
            cars.write(fitted_car(of_car, name), part / "car.toml")
