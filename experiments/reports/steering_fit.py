"""The page and the files of a hand torque that was identified from drives (:mod:`steer_env.hand_torque`).

``write`` makes ``index.html``, ``fit.json`` with everything, and, where its car can be driven through the drive,
``car.toml``, fitted to it, with ``friction.json``, the friction at its column, which ``--friction`` takes.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from steer_env import friction
from steer_env.experiments.calibration.column_fit import LONGEST, RUN_IN, ColumnFit, make_term
from steer_env.experiments.pages.files import replaced_directory
from steer_env.experiments.pages.pages import LIVE_FOLDER, OtherPage, Page, image, write_page
from steer_env.experiments.pages.plots import thin_out
from steer_env.experiments.pages.style import PALETTE, as_svg, new_figure
from steer_env.experiments.reports.friction_fit_page import LAW_TITLES
from steer_env.friction.fitted_file import UNITS as LAW_UNITS
from steer_env.hand_torque import Identified
from steer_env.hand_torque.drive import FEWEST
from steer_env.hand_torque.fit import NONE, QUANTITIES, VISCOUS, Fitted, at_ends
from steer_env.hand_torque.model import BEND, RATE, UNITS, on_samples
from steer_env.metrics.common import just_noticeable
from steer_env.vehicle import cars

FIRST_TABLE_ROWS = 10  # of the first table
SECONDS = 30.0  # of the judging part that are drawn over time [s]
POINTS = 1500  # of a picture, at most
TITLES = {NONE: "no damping, no friction", VISCOUS: "damping and tyres alone"}
SITES = {"F_u": "above", "F_c": "below"}  # level -> where its friction is, by the torsion bar
PRIOR = ("ratio", "wheelbase", "understeer")  # of (H2), not determined


class Term(NamedTuple):
    """A coefficient of (H1) of the best row, as a reader sees it."""

    name: str
    value: float  # [unit]
    interval: tuple[float, float]  # 95 % [unit]
    unit: str
    meaning: str


MEANINGS = {
    "T_0": "offset of sensor and road",
    "k": "gradient over lateral acceleration, left over by the assist",
    "T_c": "steep part on centre",
    "k_w": "weight on inclined king-pins",
    "k_s": "tyres that are turned as they roll",
    "C": "damping, of the assist too",
    "I": "inertia",
}


def drive_notes(found: Identified, names: Sequence[str]) -> list[str]:
    """What is told of the drives, with their names where there are several."""
    if len(names) == 1:
        return list(found.drive.notes)
    return [f"{name}: {note}" for name, d in zip(names, found.drives) for note in d.notes]


def contents() -> frozenset[str]:
    """Names of the files of an output."""
    return frozenset({"index.html", "fit.json", "car.toml", "friction.json", LIVE_FOLDER})


def title(name: str) -> str:
    """Name of a row for readers."""
    return {**LAW_TITLES, **TITLES}.get(name, name.replace("_", " "))


def about_zero(found: Identified) -> float:
    """Root mean square of the torque of the drives about zero [N m]."""
    return float(np.sqrt(np.mean(np.concatenate([d.torque[d.weight > 0.0] for d in found.drives]) ** 2)))


def seconds(found: Identified) -> tuple[float, float]:
    """What is fitted and what judges, of all drives [s]."""
    fitted = sum(float(d.weight[:first].sum()) * d.dt for d, first in zip(found.drives, found.firsts))
    return fitted, sum(float(d.weight.sum()) * d.dt for d in found.drives) - fitted


def agreements(found: Identified) -> dict[str, tuple[tuple[tuple[float, float], ...], str]]:
    """Quantity -> its interval by each drive, and its unit, for drives of one car."""
    units = {**{name: UNITS[name] for name in found.best.model.terms if name != "T_0"}, "level": UNITS["level"]}
    told = {name: (found.agreement(name), unit) for name, unit in units.items() if name != "level" or found.dry}
    if found.dry and math.isfinite(found.best.x_c):
        told["x_c"] = tuple((math.degrees(a), math.degrees(b)) for a, b in found.agreement("x_c")), "deg"
    return told


def first_rows(found: Identified) -> list[Fitted]:
    """The rows of the first table: both without friction, and the dry laws that leave least."""
    dry = {row.name for row in found.dry[: FIRST_TABLE_ROWS - 2]}
    return [row for row in found.rows if row.name in dry or row.name in TITLES]


def law_file(fit: ColumnFit, law: str) -> dict[str, Any]:
    """The file of the friction at the column of the fitted car, which ``friction="friction.json"`` takes."""
    return {
        "friction": friction.as_mapping(fit.friction),
        "units": dict(LAW_UNITS),
        "level": None,
        "interval_of_level": list(fit.intervals.get("F_c", (0.0, 0.0))),
        "undetermined": [],
        "notes": [f"{law} friction at the column of car.toml beside this file, identified with it"],
    }


def fitted_car(fit: ColumnFit, names: Sequence[str]) -> cars.Car:
    """The fitted car with its name and where it comes from."""
    base, name = fit.car, "_".join(names)
    trail = ", the pneumatic trail" if "n" in fit.terms else ""
    return base._replace(
        name=f"{base.name}_{name}",
        description=f"{base.name}, with boost, motor damping{trail} and friction identified from {' and '.join(names)}",
        source=f"identified from {' and '.join(names)}: assist.boost, assist.damping{trail} and the friction in "
        "friction.json beside this file, with steering.friction_load = 0. Everything else is the prior, "
        f"{base.name}: {base.source}",
    )


def as_json(found: Identified, names: Sequence[str], of_car: ColumnFit | str) -> dict[str, Any]:
    """Everything that was found, as JSON; null for a number that is not finite. ``names`` are those of the drives."""
    fitted, judged = seconds(found)
    return {
        "verdict": make_page(found, names, "").verdict[0],
        "car": {"refused": of_car} if isinstance(of_car, str) else _car(of_car),
        "drives": {
            name: {
                "judged_from": float(d.time[first]),
                "corrections": d.turns,
                "bank_balances_at": math.sqrt(model.balance),
                "offset": model.terms["T_0"],
                "prior": d.prior._asdict(),
                "notes": list(d.notes),
            }
            for name, d, first, model in zip(names, found.drives, found.firsts, found.best.models)
        },
        "seconds_fitted": fitted,
        "seconds_judged": judged,
        "torque_rms": about_zero(found),
        "unseen": {
            "residual": found.unseen.residual,
            "without": found.unseen.without,
            "adds": found.unseen.adds,
            "adds_interval": list(found.unseen.adds_interval),
            "least_that_shows": found.unseen.least,
        },
        "level_grows_with": {
            name: {"value": _plain(value), "interval": [_plain(x) for x in ends], "unit": f"N m/({QUANTITIES[name]})"}
            for name, (value, ends) in found.changes.items()
        },
        "across": [
            {
                "fitted_on": names[each.fitted_on],
                "judged_on": names[each.judged_on],
                "residual": each.residual,
                "adds": _plain(each.adds),
                "adds_interval": [_plain(x) for x in each.adds_interval],
            }
            for each in found.across
        ],
        "by_each_drive": {
            name: {"intervals": [[_plain(x) for x in ends] for ends in each], "unit": unit}
            for name, (each, unit) in (agreements(found) if found.alone else {}).items()
        },
        "differ": list(found.differ),
        "chosen": found.chosen,
        "equals": list(found.equals),
        "apart": found.apart,
        "noticed_from": just_noticeable.TORQUE,
        "not_determined": list(PRIOR),
        "notes": list(at_ends(found)),
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
        "offsets": [dict(each) for each in fit.offsets],
        "shown": fit.shown,
        "terms": {
            name: {"value": value, "interval": list(fit.intervals[name]), "unit": make_term(name).unit}
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
        "sigma": row.model.relaxation,
        "work": {name: {"share": value, "interval": list(ends)} for name, (value, ends) in row.work.items()},
        "terms": {
            name: {"value": value, "interval": list(row.intervals[name]), "unit": UNITS[name]}
            for name, value in row.model.terms.items()
        },
    }


def _plain(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


@as_svg
def measured_over_predicted(found: Identified, names: Sequence[str]) -> Figure:
    """Measured over predicted torque of the judging part of each drive, and both over time."""
    count = len(found.drives)
    figure = new_figure(9.6, 3.2 * count)
    figure.set_label("measured_over_predicted")
    for axes, name, d, first, model in zip(
        figure.subplots(count, 2, width_ratios=(1.0, 2.0), squeeze=False),
        names,
        found.drives,
        found.firsts,
        found.best.judged,
    ):
        left, right = axes
        predicted = on_samples(model, d.angle, d.speed, d.dt)
        used = np.flatnonzero((np.arange(d.time.size) >= first) & (d.weight > 0.0))
        x, y = thin_out(predicted[used], POINTS), thin_out(d.torque[used], POINTS)
        ends = [min(x.min(), y.min()), max(x.max(), y.max())]
        left.plot(x, y, ".", color=PALETTE[0], markersize=2.0, alpha=0.5)
        left.plot(ends, ends, color="#777777", linewidth=1.0)
        left.set(title=f"{name}, not fitted", xlabel="predicted torque [N m]", ylabel="measured torque [N m]")
        shown = used[: round(SECONDS * RATE)]
        right.plot(d.time[shown], d.torque[shown], color="#9aa3ad", linewidth=1.8, label="measured")
        right.plot(d.time[shown], predicted[shown], color=PALETTE[1], linewidth=1.2, label="predicted")
        right.set(title=f"first {SECONDS:.0f} s of it", xlabel="time [s]", ylabel="torque [N m]")
        right.legend(loc="upper right", ncols=2)
    return figure


def make_page(found: Identified, names: Sequence[str], folder: str, of_car: ColumnFit | str = "") -> Page:
    """The page; ``names`` are those of the drives, ``of_car`` the fitted car, or why there is none."""
    best, (fitted, judged) = found.best, seconds(found)
    terms = [
        Term(key, value, best.intervals[key], UNITS[key], MEANINGS[key]) for key, value in best.model.terms.items()
    ]
    speeds = 3.6 * np.concatenate([d.speed[d.weight > 0.0] for d in found.drives])
    values = {
        "found": found,
        "drive_name": " and ".join(names),
        "names": names,
        "unseen": found.unseen,
        "turns": sum(d.turns for d in found.drives),
        "about_zero": about_zero(found),
        "agreements": agreements(found) if found.alone else {},
        "bend": BEND,
        "slowest": speeds.min(),
        "fastest": speeds.max(),
        "folder": folder,
        "drive": found.drive,
        "of_car": None if isinstance(of_car, str) else of_car,
        "refused": of_car,
        "term_of": make_term,
        "sites_said": "" if isinstance(of_car, str) else sites_said(of_car),
        "limited": () if isinstance(of_car, str) else of_car.limited,
        "longest": LONGEST,
        "run_in": RUN_IN,
        "notes": [*drive_notes(found, names), *at_ends(found)],
        "best": best,
        "rows": first_rows(found),
        "equals": [title(law) for law in found.equals],
        "title": title,
        "terms": terms,
        "seconds": judged,
        "fitted_seconds": fitted,
        "picture": image(measured_over_predicted(found, names)),
        "noticed": just_noticeable.TORQUE,
        "fewest": FEWEST,
        "degrees": math.degrees,
        "without": found.row(VISCOUS),
    }
    return Page("steering_fit", values)


def write(
    out: Path,
    found: Identified,
    names: Sequence[str],
    of_car: ColumnFit | str,
    trace: Mapping[str, Any],
    beside: OtherPage | None = None,
) -> None:
    """Write page, JSON and the fitted car with its friction into a directory, which is replaced as a whole.

    ``of_car`` is of :func:`steer_env.experiments.calibration.column_fit.fit_column`, or says why there is none;
    ``trace`` is of :func:`steer_env.experiments.pages.provenance.trace`. Page and JSON files hold both.
    ``beside`` is the page to explore, which is written beside it and linked to.
    """
    files = {"fit.json": as_json(found, names, of_car)}
    if not isinstance(of_car, str):
        files["friction.json"] = law_file(of_car, title(found.best.name) if found.dry else "no dry")
    with replaced_directory(out, contents()) as part:
        write_page(part, make_page(found, names, out.name, of_car), files, trace, beside)
        if not isinstance(of_car, str):
            cars.write(fitted_car(of_car, names), part / "car.toml")
