"""The page of the analysis: what its template says, and the numbers as JSON."""

import math
from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.experiments.calibration import margin_map
from steer_env.experiments.calibration.margin_map import (
    GAIN_LIMIT,
    PHASE_LIMIT,
    RESTING,
    SLIDING,
    Cell,
    cells_below_limits,
)
from steer_env.experiments.pages import car_pictures, plots
from steer_env.experiments.pages.pages import Page
from steer_env.experiments.pages.plots import Line, Panel
from steer_env.experiments.pages.style import colours
from steer_env.experiments.pages.words import number
from steer_env.experiments.reports import analysis
from steer_env.experiments.reports.analysis import BODE_FREQUENCIES, PAGE_NAME, PATHS, Results, worst_cell
from steer_env.vehicle.analysis import limit_cycle
from steer_env.vehicle.analysis.assist_loop import FREQUENCIES
from steer_env.vehicle.analysis.operating_point import HAND_MODES

Array = NDArray[np.float64]

LIMIT_DISK = 2.0 * math.tan(math.radians(0.5 * PHASE_LIMIT))  # whose disk has this phase margin [1]


def limits(cells: Sequence[Cell]) -> list[str]:
    """The limits that some of the cells break, in words; both limits where none does."""
    words = {"stability": "stability", "phase margin": f"{PHASE_LIMIT:g} deg", "gain margin": f"{GAIN_LIMIT:g} dB"}
    broken = {each for cell in cells for each in cell.broken}
    return [text for each, text in words.items() if each in broken] or [*words.values()][1:]


def _maps(results: Results, value: Callable[[Cell], float]) -> dict[str, Array]:
    """Values (torque, speed) of every pair of hands and friction."""
    found = {}
    for hands, friction in product(HAND_MODES, (SLIDING, RESTING)):
        own = [value(c) for c in results.cells if c.speed_kph and (c.hands, c.friction) == (hands, friction)]
        found[f"hands {hands}, {friction}"] = np.reshape(own, (len(margin_map.SPEEDS), len(margin_map.TORQUES))).T
    return found


def _speeds(results: Results) -> list[tuple[str, ...]]:
    """Smallest margins at each speed, a row for each."""
    rows = []
    for kph in sorted({c.speed_kph for c in results.cells}):
        own = [c for c in results.cells if c.margins and c.speed_kph == kph]
        worst = worst_cell(own)
        least = [min(values) for values in zip(*((c.phase_deg, c.gain_db, 1e3 * c.margins.delay) for c in own))]  # type: ignore[union-attr]
        m = worst.margins
        rows.append((f"{kph:g}", *map(number, least), number(m.disk), worst.where.partition(", ")[2]))  # type: ignore[union-attr]
    return rows


def _least(results: Results) -> dict[str, tuple[Array, Array, Array]]:
    """Speeds [km/h] with the smallest phase [deg] and gain margin [dB], for all hands."""
    found = {}
    for hands in HAND_MODES:
        own = [c for c in results.cells if c.margins and c.hands == hands]
        speeds = sorted({c.speed_kph for c in own})
        at = [[c for c in own if c.speed_kph == kph] for kph in speeds]
        rows = [(min(c.phase_deg for c in each), min(c.gain_db for c in each)) for each in at]
        phase, gain = np.array(rows).T
        found[f"hands {hands}"] = np.array(speeds), phase, gain
    return found


def _bode(results: Results) -> str:
    """Gain and phase of the main paths as a picture."""
    shown = []
    for _, source, output, unit in PATHS:
        curves = results.bode[source, output]
        shades = colours(list(curves))
        names = f"{output} / {source}".replace("_", " ").replace("lateral acceleration", "lat. acceleration")
        for title, values in (
            (f"{names}\n[dB of {unit}]", {k: 20.0 * np.log10(np.abs(y)) for k, y in curves.items()}),
            ("phase [deg]", {k: np.degrees(np.unwrap(np.angle(y))) for k, y in curves.items()}),
        ):
            lines = [Line(k, BODE_FREQUENCIES, y, shade) for (k, y), shade in zip(values.items(), shades)]
            shown.append(Panel("frequency [Hz]", title, lines, None, True))
    return plots.draw(shown, "bode")


def _cycles(results: Results) -> list[tuple[str, ...]]:
    """Limit cycles, predicted and simulated, a row for each."""
    rows: list[tuple[str, ...]] = []
    for kph, hands, each in results.cycles:
        c, m = each.predicted, each.simulated
        predicted = (number(math.degrees(c.amplitude)), number(c.frequency)) if c else ("missed", "missed")
        own = (*predicted, number(math.degrees(m.amplitude)), number(m.frequency), number(100.0 * m.third))
        rows.append((f"{kph:g}", hands, *own, "yes" if each.agrees else "no"))
    return rows


def _grows(values: Array, modes: Sequence[NDArray[np.complex128]]) -> float | None:
    """The first value at which a mode grows, None where none does."""
    return next((float(v) for v, each in zip(values, modes) if each.real.max() > 1e-3), None)


def _page(results: Results) -> Page:
    found, worst = [cell for cell in results.cells if cell.margins], results.worst
    axes = [f"{v:g}" for v in margin_map.SPEEDS], [f"{T:g}" for T in margin_map.TORQUES]
    maps = [
        (label, limit, car_pictures.margin_map(_maps(results, value), *axes, limit, top, label))
        for value, limit, top, label in (
            (lambda c: c.phase_deg, PHASE_LIMIT, 90.0, "phase margin [deg]"),
            (lambda c: c.gain_db, GAIN_LIMIT, 24.0, "gain margin [dB]"),
        )
    ]
    loops_at = f"{worst.speed_kph:g} km/h, hands {worst.hands}, {worst.friction}"
    peaks = {k: int(np.argmax(np.abs(y))) for k, y in results.bode["handwheel_angle", "yaw_rate"].items()}
    loci = [
        ("hands off, over speed", "speed [km/h]", analysis.MODES_SPEEDS, results.speed_modes, 6.0),
        ("over the slope of the boost", "factor on the slope [1]", results.factors, results.boost_modes, 60.0),
    ]
    values = {
        "r": results,
        "limits": limits(found),
        "phase_limit": PHASE_LIMIT,
        "gain_limit": GAIN_LIMIT,
        "reached": len(found),
        "missed": cells_below_limits(found),
        "phase": min(found, key=lambda c: c.phase_deg),
        "gain": min(found, key=lambda c: c.gain_db),
        "least": car_pictures.least_margins(_least(results), (PHASE_LIMIT, GAIN_LIMIT)),
        "maps": maps,
        "speeds": _speeds(results),
        "limit_disk": LIMIT_DISK,
        "disk_gain": -20.0 * math.log10((1.0 - 0.5 * LIMIT_DISK) / (1.0 + 0.5 * LIMIT_DISK)),
        "frequencies": FREQUENCIES,
        "loops_at": loops_at,
        "nyquist": car_pictures.nyquist(results.loops, LIMIT_DISK, loops_at),
        "peaks": {k: (i > 0, BODE_FREQUENCIES[i]) for k, i in peaks.items()},
        "bode": _bode(results),
        "grows_from": _grows(analysis.MODES_SPEEDS, results.speed_modes),
        "unstable_factor": _grows(results.factors, results.boost_modes),
        "mode_speeds": analysis.MODES_SPEEDS,
        "loci": car_pictures.root_loci(loci),
        "kicks": [f"{math.degrees(kick):.1f}" for kick in limit_cycle.KICKS],
        "third": limit_cycle.THIRD,
        "sinusoidal": [each for _, _, each in results.cycles if each.sinusoidal],
        "cycles": _cycles(results),
    }
    return Page(PAGE_NAME, values)


def build_page(results: Results) -> tuple[Page, dict[str, Any]]:
    """The page and its numbers as JSON; null for a margin without a crossing."""

    def finite(x: float) -> float | None:
        return x if math.isfinite(x) else None

    cells = []
    for c in results.cells:
        m = c.margins
        values = {key: value if key == "stable" else finite(value) for key, value in m._asdict().items()} if m else {}
        cells.append(
            {"speed_kph": c.speed_kph, "torque": c.torque, "hands": c.hands, "friction": c.friction}
            | {"reached": m is not None, **values}
        )
    data = {
        "chassis": results.chassis,
        "limits": {"phase_deg": PHASE_LIMIT, "gain_db": GAIN_LIMIT},
        "units": {"phase": "rad", "gain": "1", "delay": "s", "disk": "1", "crossover": "Hz", "torque": "N m"},
        "map": cells,
        "limit_cycles": [
            {
                "speed_kph": kph,
                "hands": hands,
                "predicted": each.predicted and each.predicted._asdict(),
                "simulated": {key: finite(value) for key, value in each.simulated._asdict().items()},
            }
            for kph, hands, each in results.cycles
        ],
        "least": {
            "phase_deg": min(c.phase_deg for c in results.cells if c.margins),
            "gain_db": min(c.gain_db for c in results.cells if c.margins),
        },
        "missed": [c.where for c in cells_below_limits(results.cells)],
        "driven_back_db": results.driven_back_db,
    }
    return _page(results), data
