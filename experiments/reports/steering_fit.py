"""The page and the files of a hand torque that was identified from a drive (:mod:`steer_env.hand_torque`).

``write`` makes ``index.html``, ``fit.json`` with everything, ``LAW.json`` for each dry law, which ``--friction`` takes,
and ``car.toml``, a packaged car with what the drive says of it.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import CubicSpline

from steer_env import friction
from steer_env.experiments.pages.files import replaced_directory
from steer_env.experiments.pages.pages import Page, image, place
from steer_env.experiments.pages.plots import thinned
from steer_env.experiments.pages.style import PALETTE, new_figure, styled
from steer_env.experiments.reports.friction_fit_page import LAW_TITLES
from steer_env.friction.fitted_file import UNITS as LAW_UNITS
from steer_env.friction.law import LAWS
from steer_env.hand_torque import Identified
from steer_env.hand_torque.drive import FEWEST
from steer_env.hand_torque.fit import NONE, VISCOUS, Fitted, at_ends
from steer_env.hand_torque.model import MAPS, RATE, UNITS, Array, on_samples, stretched
from steer_env.manoeuvres import Manoeuvre, drive
from steer_env.manoeuvres.common.shapes import ramp_and_hold
from steer_env.metrics.common.just_noticeable import LEAST, SHARE
from steer_env.vehicle import cars
from steer_env.vehicle.chassis.common.interface import SPEED_MAX, SPEED_MIN, TARGET_SPEED

ROWS = 10  # of the first table
FADE = 2.0  # from straight ahead to the angle of the drive ...
RUN_IN = 10.0  # ... and from there to the first sample that judges, so that the car follows; both assumed [s]
LONGEST = 600.0  # of the judging part that a car is driven through, assumed [s]
SECONDS = 30.0  # of the judging part that are drawn over time [s]
POINTS = 1500  # of a picture, at most
TITLES = {NONE: "no damping, no friction", VISCOUS: "damping alone (viscous)"}
NOTICED = SHARE * LEAST["N m"]  # smallest difference of a sustained torque that is known to be noticed [N m]
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


class Driven(NamedTuple):
    """What a car leaves of the judging part that is driven through its handwheel angles and speeds."""

    residual: float = math.nan  # root mean square of its torque and T_0 less the measured torque [N m]
    slope: float = math.nan  # of the measured torque over its torque, by regression [1]
    refused: str = ""  # why it could not be driven


def contents() -> frozenset[str]:
    """Names of the files of an output."""
    return frozenset({"index.html", "fit.json", "car.toml", *(f"{law}.json" for law in LAWS.available())})


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


def law_file(found: Identified, row: Fitted) -> dict[str, Any]:
    """The file of a dry law, which ``friction="LAW.json"`` takes: its level is that of the hands, after the assist."""
    return {
        "friction": friction.as_mapping(of_level(row)),
        "units": dict(LAW_UNITS),
        "level": None,
        "interval_of_level": [_plain(x) for x in row.level_interval],
        "undetermined": [],
        "notes": [
            "identified from one drive at the torsion bar, behind an unknown assist: the friction below it is larger by"
            " one plus the assist's gain",
            *found.drive.notes,
        ],
    }


def of_level(row: Fitted) -> Any:
    """Parameters of a row's law with the level of the whole drive."""
    return stretched(row.name, max(row.level, 1e-3), row.x_c if math.isfinite(row.x_c) else math.radians(0.3))


def car(found: Identified, base: cars.Car, name: str) -> cars.Car:
    """A car with what the drive says of it: no increase of the friction by load, as the level is that of the drive."""
    changed = cars.load(base.data(), {"steering.friction_load": 0.0})
    told = (
        f"the level of its friction ({found.best.level:.3g} N m at the hands, {found.best.name}.json beside this file)"
    )
    return changed._replace(
        name=f"{base.name}_{name}",
        description=f"{base.name}, with friction identified from the drive {name}",
        source=f"identified from the drive {name}: {told}, steering.friction_load = 0. Everything else is the prior, "
        f"{base.name}: {base.source}",
    )


def driven(found: Identified, base: cars.Car) -> Driven:
    """Drive column and chassis of a car, with the best law of the fitted part, through the judging part.

    No torque of the judging part is used, as in the prediction by (H1).
    """
    d, best = found.drive, found.best
    first = max(found.first - round(RUN_IN * RATE), 0)
    part = slice(first, found.first + round(LONGEST * RATE))
    time, speed = d.time[part] - d.time[first], np.clip(d.speed[part], SPEED_MIN, SPEED_MAX)
    curve = CubicSpline(time, d.angle[part])

    def hand(t: Array, amplitude: float) -> tuple[Array, Array]:
        on, change = ramp_and_hold(t, 1.0, FADE)
        return amplitude * on * curve(t), amplitude * (change * curve(t) + on * curve(t, 1))

    manoeuvre = Manoeuvre(
        name="drive",
        hands="the handwheel angle of a drive",
        source="the drive",
        speed=float(speed[0]),
        duration=float(time[-1]),
        hand=hand,
        amplitude=1.0,
        chassis="two_track",
        others={TARGET_SPEED: lambda t: np.interp(t, time, speed) - speed[0]},
    )
    law = friction.make("viscous", sigma_2=0.0) if best.judged.friction is None else best.judged.friction
    try:
        made = drive(cars.load(base.data(), {"steering.friction_load": 0.0}), manoeuvre, law)
    except ValueError as error:
        return Driven(refused=str(error))
    used = (d.weight[part] > 0.0) & (np.arange(first, first + time.size) >= found.first)
    torque = np.interp(time, made.time, made["torsion_bar_torque"])[used] + best.judged.terms["T_0"]
    measured = d.torque[part][used]
    return Driven(float(np.sqrt(np.mean((torque - measured) ** 2))), float(np.polyfit(torque, measured, 1)[0]))


def as_json(found: Identified, of_car: Driven) -> dict[str, Any]:
    """Everything that was found, as JSON; null for a number that is not finite."""
    d = found.drive
    return {
        "verdict": page_of(found, "", "").verdict[0],
        "car_driven": {
            "residual": _plain(of_car.residual),
            "measured_over_predicted": _plain(of_car.slope),
            "refused": of_car.refused,
        },
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
        "not_determined": [*PRIOR, "boost"],
        "notes": [*d.notes, *at_ends(found)],
        "rows": {row.name: _row(row) for row in found.rows},
    }


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


def page_of(found: Identified, name: str, folder: str, of_car: Driven | None = None) -> Page:
    """The page; ``name`` is that of the drive, and ``of_car`` what its car file leaves."""
    best = found.best
    terms = [Term(key, value, UNITS[key], MEANINGS[key]) for key, value in best.model.terms.items()]
    values = {
        "found": found,
        "drive_name": name,
        "folder": folder,
        "drive": found.drive,
        "of_car": of_car,
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


def write(out: Path, found: Identified, name: str, base: cars.Car, of_car: Driven, trace: Mapping[str, Any]) -> None:
    """Write page, files of laws and car into a directory, which appears or is replaced as a whole.

    ``of_car`` is of :func:`driven`, ``trace`` of :func:`steer_env.experiments.pages.provenance.trace`; page and JSON
    files hold both.
    """
    laws = {f"{row.name}.json": law_file(found, row) for row in found.dry}
    with replaced_directory(out, contents()) as part:
        place(part, page_of(found, name, out.name, of_car), {"fit.json": as_json(found, of_car), **laws}, trace)
        cars.write(car(found, base, name), part / "car.toml")
