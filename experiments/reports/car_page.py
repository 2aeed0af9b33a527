"""The page of a car: derived quantities beside the ranges of passenger cars, and curves, for any car.

``write_car_page`` writes ``index.html`` (self-contained) and ``car.json``.
"""

import math
from importlib import metadata
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from steer_env.experiments.pages import car_pictures, pictures, provenance
from steer_env.experiments.pages.files import replaced_directory
from steer_env.experiments.pages.pages import LIVE_FOLDER, OtherPage, Page, image, write_page
from steer_env.experiments.reports import car_quantities, car_suspension
from steer_env.experiments.reports.car_quantities import CHASSIS, Quantity, ranges
from steer_env.experiments.reports.car_simulated import OWN_FRICTION, SPEED, SPEEDS, Simulated, simulate
from steer_env.experiments.studies.common.assist_margins import TARGETS
from steer_env.recording.recording import DEGREE
from steer_env.vehicle import cars
from steer_env.vehicle.analysis import understeer
from steer_env.vehicle.analysis.free_control import SETTLED_AMPLITUDE
from steer_env.vehicle.cars import Car

CONTENTS = frozenset({"index.html", "car.json", LIVE_FOLDER})
KPH = 3.6  # [km/h] of 1 m/s


def outside(found: list[Quantity]) -> list[Quantity]:
    """The quantities that are out of their ranges."""
    return [quantity for quantity in found if quantity.plausible is False]


def as_json(car: Car, found: list[Quantity]) -> dict[str, Any]:
    """The quantities by name; null for a value or a limit that does not exist."""

    def finite(x: float) -> float | None:
        return float(x) if math.isfinite(x) else None

    return {
        "car": {"name": car.name, "description": car.description, "source": car.source},
        "quantities": {
            q.name: {
                "group": q.group,
                "title": q.title,
                "value": finite(q.value),
                "unit": q.unit,
                "range": [finite(q.low), finite(q.high)],
                "basis": q.basis,
                "source": q.source,
                "plausible": q.plausible,
                "note": q.note,
            }
            for q in found
        },
        "outside": [q.name for q in outside(found)],
        "version": metadata.version("steer-env"),
    }


class Strip(NamedTuple):
    """Where the range and the value of a quantity stand on a strip [%]."""

    start: float
    end: float
    value: float


def strip(q: Quantity) -> Strip | None:
    """The range in the middle half of a strip, or up to its end where it has one limit only; None without a range."""
    if q.plausible is None:
        return None
    low, high = math.isfinite(q.low), math.isfinite(q.high)
    if low and high:
        size, origin = q.high - q.low, q.low
    else:
        origin = q.low if low else q.high
        size = abs(origin) or 1.0
    place = 25.0 + 50.0 * (q.value - origin) / size if low else 75.0 + 50.0 * (q.value - origin) / size
    return Strip(25.0 if low else 0.0, 75.0 if high else 100.0, min(max(place, 2.0), 98.0))


def _in_ranges(found: list[Quantity]) -> str:
    """Where the quantities stand in their ranges, by group; one with a single limit keeps it or not."""
    groups = dict[str, list[float]]()
    for q in found:
        if place := strip(q):
            x, group = (place.value - 25.0) / 50.0, q.group.split(",")[0].split(" at ")[0]
            groups.setdefault(group, []).append(min(max(x, 0.0), 1.0) if q.plausible else x)
    return car_pictures.in_ranges(groups)


def _limits(name: str) -> tuple[float, float]:
    found = ranges()[name]
    return found["low"], found["high"]


def _pictures(car: Car, found: list[Quantity], simulated: Simulated) -> dict[str, str]:
    """Every picture as SVG, by name."""
    prefix, values = "understeer: ", {q.name: q.value for q in found}
    terms = {name.removeprefix(prefix): value for name, value in values.items() if name.startswith(prefix)}
    shown = {f"simulated, {title}": values[f"understeer_gradient_{name}"] for name, title in CHASSIS.items()}
    speeds, curves, slopes = np.array(SPEEDS), car_suspension.curves(car), car_suspension.slopes(car)
    lags = {
        title: {
            "simulated with friction": simulated.lags[chassis, OWN_FRICTION],
            "simulated without friction": simulated.lags[chassis, "none"],
            "linear model": np.array([understeer.yaw_lag(car, v, chassis=chassis) for v in SPEEDS]),
            "Bundorf": np.array([understeer.bundorf_lag(car, v, chassis) for v in SPEEDS]),
        }
        for chassis, title in CHASSIS.items()
    }
    amplitudes = {
        f"{CHASSIS[name]}, {'no friction' if law == 'none' else law}": np.array([p.amplitude for p in pulses]) / DEGREE
        for name, free in simulated.hands_off.items()
        for law, pulses in free.pulses.items()
    }
    cells = {"parking" if kph == 0.0 else f"{kph:g} km/h": found for kph, found in simulated.assist.items()}
    axles, a = ("front", "rear"), car.assist
    return {
        "in_ranges": _in_ranges(found),
        "budget": car_pictures.budget(terms, shown, _limits("understeer_gradient")),
        "lag": car_pictures.lag(
            KPH * speeds,
            {title: {label: 1e3 * y for label, y in of_label.items()} for title, of_label in lags.items()},
            KPH * SPEED,
            _limits("yaw_lag_single_track"),
        ),
        "hands_off": car_pictures.hands_off(
            KPH * speeds,
            {CHASSIS[name]: free.damping for name, free in simulated.hands_off.items()},
            amplitudes,
            SETTLED_AMPLITUDE / DEGREE,
        ),
        "kinematics": car_pictures.kinematics(curves),
        "steering": car_pictures.steering(curves),
        "compliance": car_pictures.compliance(
            {axle: 1e3 / DEGREE * slope for axle, slope in zip(axles, slopes.lateral_steer)},
            {axle: slope / DEGREE for axle, slope in zip(axles, slopes.aligning_steer)},
            dict(zip(axles, slopes.roll_steer)),
        ),
        "parking": pictures.parking(simulated.parking),
        "assist": car_pictures.assist(
            a.torques, {f"{KPH * v:.0f} km/h": row for v, row in zip(a.speeds, a.boost)}, KPH * a.speeds, a.damping
        ),
        "margins": pictures.margins({label: found for label, found in cells.items() if found}, TARGETS),
    }


def make_page(car: Car, found: list[Quantity], simulated: Simulated) -> Page:
    """The page."""
    values = {
        "car": car,
        "data": car.data(),
        "keys": cars.declared_keys(),
        "groups": {group: list(members) for group, members in groupby(found, key=lambda q: q.group)},
        "outside": outside(found),
        "strip": strip,
        "images": {name: image(svg) for name, svg in _pictures(car, found, simulated).items()},
        "law": car.friction,
    }
    return Page("car", values)


def write_car_page(
    out: Path, car: Car, trace: dict[str, Any] | None = None, beside: OtherPage | None = None
) -> list[Quantity]:
    """Derive the quantities of a car and write its page into a directory, which appears or is replaced as a whole.

    Parameters
    ----------
    out : Path
        New, empty, or an earlier page.
    car : Car
    trace : dict, optional
        Of :func:`steer_env.experiments.pages.provenance.trace`; both files hold it.
    beside : Beside, optional
        The page to explore, which is written beside it and linked to.

    Raises
    ------
    ValueError
        If ``out`` holds other files, or the car cannot park.
    """
    trace = provenance.trace(car=car) if trace is None else trace
    with replaced_directory(out, CONTENTS) as part:
        simulated = simulate(car)
        found = car_quantities.collect(car, simulated)
        write_page(part, make_page(car, found, simulated), {"car.json": as_json(car, found)}, trace, beside)
    return found
