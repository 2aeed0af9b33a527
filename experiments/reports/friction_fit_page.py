"""The page and the files of friction laws that are fitted to a record (:mod:`friction_fit`).

``write`` makes ``index.html``, ``fit.json`` with everything, and ``LAW.json`` for each law that was fitted, which
``friction="LAW.json"`` takes.
"""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from steer_env import friction
from steer_env.experiments.pages import friction_pictures
from steer_env.experiments.pages.files import replaced_directory
from steer_env.experiments.pages.pages import OtherPage, Page, environment, image, write_page
from steer_env.experiments.pages.style import colours, picture_folder
from steer_env.experiments.pages.words import capital
from steer_env.experiments.pages.words import number as shown_number
from steer_env.experiments.reports.friction_fit import SHOWN_UNITS, Found, contents, known_from
from steer_env.friction import Compared, Fit
from steer_env.friction.identification import periods
from steer_env.friction.law import LAWS
from steer_env.metrics.common import just_noticeable

ADVICE = ": try another law with friction.compare"  # at the end of a warning of a law that does not describe the record
# Of the record's own repeatability: a law that leaves no more describes the record; assumed [1]
DESCRIBING_FACTOR = 1.5


class Row(NamedTuple):
    """A parameter as the page shows it, in the units of the record."""

    name: str
    value: str
    interval: str
    unit: str
    determined: bool
    limit: str = ""  # which end of the interval is a bound of the law: "lower", "upper", "lower and upper", or none


def percent(found: Found, value: float) -> float:
    """A friction as a share of the mean friction [%]."""
    return 100.0 * value / found.level


def verdict(found: Found) -> str:
    """One sentence: the laws that describe the record best, and which others a driver would notice in their place."""
    off = law_distances(found) if found.record.of_a_column else {}
    template = environment().get_template("friction_fit_said.html.j2")
    said = template.render(
        found=found,
        equals=[_title(each.law) for each in found.equals],
        shares=[shares(found, each) for each in found.equals],
        fitted=len(found.curves),
        off=max(off.values(), default=None),
        noticed=[_title(law) for law, torque in off.items() if torque >= just_noticeable.TORQUE],
        repeats=None if found.repeats is None else percent(found, found.repeats),
    )
    return capital(str(Markup(said.strip()).unescape())).replace(" %", "\u00a0%")


def law_distances(found: Found) -> dict[str, float]:
    """How far the friction of each law that leaves more is from the best one's where it judges, RMS, as recorded."""
    others = [each.law for each in found.laws if found.apart(each)]
    best = found.curves[found.best.law][found.first :] if found.best else np.zeros(0)
    return {law: float(np.sqrt(np.mean((found.curves[law][found.first :] - best) ** 2))) for law in others}


def shares(found: Found, each: Compared) -> tuple[float, float, float]:
    """What a law leaves and its interval [% of the mean friction]."""
    low, high = each.interval
    return percent(found, each.residual), percent(found, low), percent(found, high)


def _title(law: str) -> str:
    return LAW_TITLES.get(law, law.replace("_", " "))


LAW_TITLES = {  # of laws whose names are not plain words
    **{"bouc_wen": "Bouc-Wen", "coulomb": "Coulomb", "dahl": "Dahl", "elasto_plastic": "elasto-plastic (Dupont)"},
    **{"gms": "GMS", "lugre": "LuGre", "masing": "Masing", "stribeck": "Stribeck"},
    "masing_position": "Masing by position",
}


def parameter_unit(law: str, parameter: str, units: Mapping[str, str]) -> str:
    """Unit of a parameter for a record in these units."""
    return in_units(LAWS[law].units.get(parameter, ""), units)


def in_units(text: str, units: Mapping[str, str]) -> str:
    """A text on a law, which is in rad and N m, in the units of a record."""
    return re.sub(r"\brad\b", units["displacement"], re.sub(r"\bN m\b", units["torque"], text))


def warnings(fit: Fit, units: Mapping[str, str]) -> list[str]:
    """The warnings of a fit in the units of the record, without the advice to compare laws, as they are compared."""
    return [in_units(text.removesuffix(ADVICE), units) for text in fit.warnings]


def value_with_interval(value: float, ends: tuple[Any, Any]) -> tuple[str, str]:
    """A value and its interval with as many digits as the printed interval needs to hold the printed value."""
    low, high = map(float, ends)
    for digits in range(4, 10):
        a, x, b = (float(f"{each:.{digits}g}") for each in (low, value, high))
        # An end may be the value itself.
        if (a < x or low >= value or math.isclose(low, value)) and (
            x < b or value >= high or math.isclose(high, value)
        ):
            break
    return shown_number(value, digits), f"{shown_number(low, digits)} to {shown_number(high, digits)}"


def rows(fit: Fit, units: Mapping[str, str]) -> list[Row]:
    """The parameters of a law that was fitted."""
    found = []
    for name, value in friction.as_mapping(fit.parameters).items():
        if name == "law":
            continue
        interval = fit.intervals.get(name)
        undetermined = name in fit.undetermined
        text, ends = ", ".join(map(shown_number, value)) if isinstance(value, list) else shown_number(value, 4), ""
        if interval is not None and not np.ndim(interval[0]):
            text, ends = value_with_interval(value, interval)
        limit = " and ".join(side for side, at in zip(("lower", "upper"), fit.limits.get(name, (False, False))) if at)
        found.append(Row(name, text, ends, parameter_unit(fit.law, name, units), not undetermined, limit))
    for name, value in fitted_level(fit).items():
        interval = fit.intervals.get(name)
        unit = in_units({"load": "1/N", "order": "1/rad", "peak": "rad"}.get(name, "1"), units)
        text, ends = value_with_interval(value, interval) if interval else (shown_number(value, 4), "")
        found.append(Row(f"level, {name}", text, ends, unit, name not in fit.undetermined))
    return found


def fitted_level(fit: Fit) -> dict[str, float]:
    """What a fit found of the level, by the fields of ``steer_env.friction.level.Level``.

    Order and peak are there where the position has an influence.
    """
    found = {} if fit.level is None else fit.level._asdict()
    return {
        name: value
        for name, value in found.items()
        if (found["position"] if name in ("order", "peak") else value) != 0.0
    }


def car_options(fit: Fit | None) -> str:
    """The options that give a car the level over the position of a fit; empty without one."""
    level = {} if fit is None else fitted_level(fit)
    names = ("position", "order", "peak") if "position" in level else ()
    return " ".join(f"--set steering.friction_{name}={level[name]:.6g}" for name in names)


def asymmetry(fit: Fit) -> tuple[str, str]:
    """The asymmetry of the level that has the place of the offset, and its interval; empty texts without one."""
    value, low, high = fit.asymmetry
    return value_with_interval(value, (low, high)) if math.isfinite(value) else ("", "")


def saturated(fit: Fit, units: Mapping[str, str]) -> Row:
    """The saturated friction at the record's speed; open above where the record does not saturate."""
    value, low, high = fit.saturated
    text, ends = value_with_interval(value, (low, high))
    return Row("saturated friction at the record’s speed", text, ends, units["torque"], True)


def sliders(fit: Fit) -> list[tuple[str, str, str, str]]:
    """Stiffness and yield of each slider, both with their interval or none."""
    found = []
    for each in fit.sliders:
        pairs = ((each.k, each.k_interval), (each.y, each.y_interval))
        k, y = (value_with_interval(value, ends) if ends else (shown_number(value, 4), "") for value, ends in pairs)
        found.append((*k, *y))
    return found


def law_file(found: Found, each: Compared, fit: Fit) -> dict[str, Any]:
    """The file of a law, which ``friction="LAW.json"`` takes."""
    return {
        "friction": friction.as_mapping(fit.parameters),
        "units": dict(found.record.units),
        "level": None if fit.level is None else fit.level._asdict(),
        "intervals": {name: [_plain(end) for end in ends] for name, ends in fit.intervals.items()},
        "limits": {name: list(ends) for name, ends in fit.limits.items()},
        "saturated": [_plain(x) for x in fit.saturated],
        "sliders": [{name: _plain(x) for name, x in each._asdict().items()} for each in fit.sliders],
        "undetermined": list(fit.undetermined),
        "offset": fit.offset,
        "asymmetry": [_plain(x) for x in fit.asymmetry],
        "residual": fit.residual,
        "held_out": [_plain(x) for x in (each.residual, *each.interval)],
        "held_out_at_rest": each.resting,
        "held_out_alone": each.alone,
        "warnings": warnings(fit, found.record.units),
        "notes": list(found.record.notes),
    }


def as_json(found: Found) -> dict[str, Any]:
    """Everything that was found, as JSON; null for an end of an interval that is open."""
    r = found.record
    own = periods.period(r.motion)
    return {
        "record": {
            "name": found.name,
            "samples": r.x.size,
            "dt": r.dt,
            "start": r.start,
            "units": dict(r.units),
            "factors": dict(r.factors),
            "mean_friction": found.level,
            "period": None if own is None else own * r.dt,
            "repeats": found.repeats,
            "rests": found.rests,
            "notes": list(r.notes),
        },
        "judged_from": r.start + found.first * r.dt,
        "verdict": verdict(found),
        "best": found.best.law if found.best and len(found.equals) == 1 else None,
        "equals": [each.law for each in found.equals],
        "laws": {
            each.law: {"refused": each.refused}
            if each.fit is None
            else {
                **{key: value for key, value in law_file(found, each, each.fit).items() if key != "notes"},
                "criterion": _plain(found.criterion(each)),
                "alike": list(each.alike),
            }
            for each in found.laws
        },
    }


def _plain(value: Any) -> Any:
    """Numbers that JSON holds; None for those that are not finite."""
    if value is None:
        return None
    if np.ndim(value):
        return [_plain(each) for each in value]
    return float(value) if math.isfinite(value) else None


def shown_record(found: Found) -> friction_pictures.ShownRecord:
    """The record in the units of the page, with its last whole loop."""
    r = found.record
    (x_unit, x_size), (unit, size) = SHOWN_UNITS[r.units["displacement"]], SHOWN_UNITS[r.units["torque"]]
    n, known = periods.period(r.motion), known_from(r)
    loop = slice(-n if n else None, None)
    return friction_pictures.ShownRecord(
        r.time, r.motion / x_size, r.friction / size, x_unit, unit, loop, known, found.first or r.x.size
    )


def make_page(found: Found, folder: str) -> Page:
    """The page."""
    given = shown_record(found)
    fitted = [each for each in found.laws if each.fit is not None]
    fits = [each.fit for each in found.laws if each.fit is not None]
    overview = {_title(e.law): shares(found, e) for e in fitted}
    shades = dict(zip(found.curves, colours(found.curves)))
    brief = {e.law: _title(e.law).partition(" (")[0] for e in fitted}
    titles = {e.law: f"{brief[e.law]}, {shown_number(shares(found, e)[0])} %" for e in fitted}
    repeats = None if found.repeats is None else percent(found, found.repeats)
    values = {
        "found": found,
        "record": found.record,
        "folder": folder,
        "verdict": verdict(found),
        "fitted": fitted,
        "equals": [each.law for each in found.equals],
        "missed": [each for each in found.laws if each.fit is None],
        "percent": lambda x: percent(found, x),
        "shares": lambda each: shares(found, each),
        "title": _title,
        "by_position": any(each.alone is not None for each in fitted),
        "asymmetry": asymmetry,
        "car_options": car_options,
        "warnings": {fit.law: warnings(fit, found.record.units) for fit in fits},
        "rows": {fit.law: [saturated(fit, found.record.units), *rows(fit, found.record.units)] for fit in fits},
        "sliders": {fit.law: sliders(fit) for fit in fits},
        "loops": image(friction_pictures.fitted_loops(given, found.curves, titles)) if fitted else None,
        "narrow_loops": image(_narrow(given, found.curves, titles)) if fitted else None,
        "within": found.best is not None
        and (repeats is None or shares(found, found.best)[0] <= DESCRIBING_FACTOR * repeats),
        "repeats": repeats,
        "overview": image(friction_pictures.residuals(overview, repeats)) if fitted else None,
        "pictures": {
            e.law: image(friction_pictures.law(_title(e.law), given, found.curves[e.law], found.level, shades[e.law]))
            for e in fitted
        },
        "travel": float(np.ptp(given.x)),
        "x_unit": given.x_unit,
        "unit": given.friction_unit,
    }
    return Page("friction_fit", values)


def _narrow(given: friction_pictures.ShownRecord, curves: Mapping[str, Any], titles: Mapping[str, str]) -> str:
    """The loops for a narrow screen, which no folder of pictures needs beside the wide ones."""
    with picture_folder(None):
        return friction_pictures.fitted_loops(given, curves, titles, columns=2)


def write(out: Path, found: Found, trace: Mapping[str, Any], beside: OtherPage | None = None) -> None:
    """Write page and files into a directory, which appears or is replaced as a whole.

    ``trace`` is of :func:`steer_env.experiments.pages.provenance.trace`; every file holds it.
    ``beside`` is the page to explore, which is written beside it and linked to.
    """
    fitted = [(each, each.fit) for each in found.laws if each.fit is not None]
    laws = {f"{each.law}.json": law_file(found, each, fit) for each, fit in fitted}
    page = make_page(found, out.name)
    with replaced_directory(out, contents()) as part:
        write_page(part, page, {"fit.json": as_json(found), **laws}, trace, beside)
