"""The page of the analysis: sections with verdicts, pictures and tables, and the numbers as JSON."""

import math
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.experiments.calibration import margin_map
from steer_env.experiments.calibration.margin_map import GAIN_LIMIT, PHASE_LIMIT, RESTING, SLIDING, Cell, missed
from steer_env.experiments.pages import analysis_pictures, still_plots
from steer_env.experiments.pages.plots import Line, Panel
from steer_env.experiments.pages.study_page import Page, Picture, Section, Table
from steer_env.experiments.pages.style import colours
from steer_env.experiments.pages.words import number
from steer_env.experiments.reports import analysis
from steer_env.experiments.reports.analysis import BODE_FREQUENCIES, NAME, PATHS, Results, worst_of
from steer_env.vehicle.analysis import limit_cycle
from steer_env.vehicle.analysis.assist_loop import FREQUENCIES
from steer_env.vehicle.analysis.operating_point import HANDS

Array = NDArray[np.float64]

LIMIT_DISK = 2.0 * math.tan(math.radians(0.5 * PHASE_LIMIT))  # whose disk has this phase margin [1]


def sentences(results: Results) -> list[str]:
    """The verdict in sentences."""
    found = [cell for cell in results.cells if cell.margins]
    phase, gain = min(found, key=lambda c: c.phase_deg), min(found, key=lambda c: c.gain_db)
    below, limits = missed(found), f"{PHASE_LIMIT:g} deg and {GAIN_LIMIT:g} dB"
    kept = (
        f"The assist loop of '{results.car}' keeps {limits} at all {len(found)} points of the map that the car reaches."
        if not below
        else f"The assist loop of '{results.car}' misses {limits} at {len(below)} of {len(found)} points: "
        + "; ".join(cell.where for cell in below[:4])
        + (f"; and {len(below) - 4} more." if len(below) > 4 else ".")
    )
    return [
        kept,
        f"The smallest phase margin is {number(phase.phase_deg)} deg ({phase.where}), the smallest gain margin "
        f"{number(gain.gain_db)} dB ({gain.where}).",
        f"The smallest disk margin, of gain and phase together, is {number(results.worst.margins.disk)} "  # type: ignore[union-attr]
        f"({results.worst.where}).",
    ]


def _maps(results: Results, value: Callable[[Cell], float]) -> dict[str, Array]:
    """Values (torque, speed) of every pair of hands and friction."""
    found = {}
    for hands, friction in product(HANDS, (SLIDING, RESTING)):
        own = [value(c) for c in results.cells if (c.hands, c.friction) == (hands, friction)]
        found[f"hands {hands}, {friction}"] = np.reshape(own, (len(margin_map.SPEEDS), len(margin_map.TORQUES))).T
    return found


def _margin_section(results: Results) -> Section:
    axes = [f"{v:g}" for v in margin_map.SPEEDS], [f"{T:g}" for T in margin_map.TORQUES]
    pictures = [
        Picture(
            analysis_pictures.margin_map(_maps(results, value), *axes, limit, top, label),
            f"{label}; below {limit:g} a red frame. A dash: the car does not reach the torque; ∞: no crossing.",
        )
        for value, limit, top, label in (
            (lambda c: c.phase_deg, PHASE_LIMIT, 90.0, "phase margin [deg]"),
            (lambda c: c.gain_db, GAIN_LIMIT, 24.0, "gain margin [dB]"),
        )
    ]
    rows = []
    for kph in margin_map.SPEEDS:
        own = [c for c in results.cells if c.margins and c.speed_kph == kph]
        worst = worst_of(own)
        least = [min(values) for values in zip(*((c.phase_deg, c.gain_db, 1e3 * c.margins.delay) for c in own))]  # type: ignore[union-attr]
        m = worst.margins
        rows.append((f"{kph:g}", *map(number, least), number(m.disk), worst.where, number(m.crossover)))  # type: ignore[union-attr]
    head = ("speed [km/h]", "phase [deg]", "gain [dB]", "delay [ms]", "disk [1]", "disk margin at", "crossover [Hz]")
    verdict = sentences(results)
    return Section(
        "Margins of the assist loop",
        f"The assist loop should keep a phase margin of {PHASE_LIMIT:g} deg and a gain margin of {GAIN_LIMIT:g} dB "
        "(usual limits, assumed) wherever the car is driven.",
        f"The whole car ({results.chassis}) is linearised in steady cornering at every speed and torque of the torsion "
        "bar, with a prescribed handwheel (on), with half tensed arms on it (arms) and with a constant hand "
        f"torque (off), while friction slides at a constant torque or is at rest by its law ({results.law}). The loop "
        "is opened at the torque sensor, at 1 ms. At a knot of the boost table the slope above it counts.",
        " ".join(verdict),
        "Small motions around a steady point. Between sliding and rest friction is not linear. Level and dry road, "
        "the unladen car.",
        pictures,
        [Table("Smallest margins at each speed", head, rows)],
        verdict[0],
    )


def _nyquist_section(results: Results) -> Section:
    w = results.worst
    title = f"{w.speed_kph:g} km/h, hands {w.hands}, {w.friction}"
    low = (1.0 - 0.5 * LIMIT_DISK) / (1.0 + 0.5 * LIMIT_DISK)
    return Section(
        "Nyquist curves",
        "The open loop passes −1 at a distance.",
        f"The open loops at the speed, hands and friction of the smallest disk margin ({w.where}), for every torque of "
        "the map that the car reaches.",
        f"The smallest disk margin is {number(w.margins.disk)}; the red disk is that of {number(LIMIT_DISK)}, with "  # type: ignore[union-attr]
        f"which the phase may change by {PHASE_LIMIT:g} deg or the gain by {number(-20.0 * math.log10(low))} dB.",
        f"From {FREQUENCIES[0]:g} to {FREQUENCIES[-1]:g} Hz.",
        [Picture(analysis_pictures.nyquist(results.loops, LIMIT_DISK, title), f"Open loops: {title}")],
    )


def _bode_section(results: Results) -> Section:
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
    yaw = results.bode["handwheel_angle", "yaw_rate"]
    peaks = {k: int(np.argmax(np.abs(y))) for k, y in yaw.items()}
    told = [
        f"at {number(BODE_FREQUENCIES[i])} Hz ({k})" if i else f"below {number(BODE_FREQUENCIES[0])} Hz ({k})"
        for k, i in peaks.items()
    ]
    return Section(
        "Frequency responses of the car",
        "How the car answers the hands, with its sampled assist, in small motions.",
        "Straight running, friction sliding; a handwheel that is turned, and a hand torque on a free handwheel.",
        f"The yaw rate's gain over the handwheel angle is largest {', '.join(told)}.",
        "Without the friction at rest, which holds the steering against motions smaller than its own distance.",
        [Picture(still_plots.draw(shown), "Gain and phase of the main paths")],
    )


def _root_section(results: Results) -> Section:
    w = results.worst
    unstable = [v for v, modes in zip(analysis.MODES_SPEEDS, results.speed_modes) if modes.real.max() > 1e-3]
    free = f"grows from {unstable[0]:g} km/h on" if unstable else f"decays up to {analysis.MODES_SPEEDS[-1]:g} km/h"
    crossed = [f for f, modes in zip(results.factors, results.boost_modes) if modes.real.max() > 1e-3]
    boosted = f"with {number(crossed[0])} times its slope" if crossed else "with no slope that was tried"
    loci = [
        ("hands off, over speed", "speed [km/h]", analysis.MODES_SPEEDS, results.speed_modes, 6.0),
        ("over the slope of the boost", "factor on the slope [1]", results.factors, results.boost_modes, 60.0),
    ]
    return Section(
        "Modes",
        "No motion of the closed loop grows.",
        "Eigenvalues of the plant over a chassis step: of the free car without friction over speed, and over a factor "
        f"on the slope of the boost at the smallest disk margin ({w.where}).",
        f"Hands off the motion {free}. "
        + (
            f"The assist becomes unstable {boosted}; its gain margin is {number(w.margins.gain)}."  # type: ignore[union-attr]
            if w.margins.stable  # type: ignore[union-attr]
            else "The assist is unstable with the slope that it has, so that its margins are no more than a distance."
        ),
        "On the upper half plane; modes beyond the panel are not shown.",
        [Picture(analysis_pictures.root_loci(loci), "Root loci over speed and over the slope of the boost")],
    )


def _cycle_section(results: Results) -> Section:
    rows, counted = [], [each for _, _, each in results.cycles if each.sinusoidal]
    for kph, hands, each in results.cycles:
        c, m = each.predicted, each.simulated
        told = (number(math.degrees(c.amplitude)), number(c.frequency)) if c else ("missed", "missed")
        own = (*told, number(math.degrees(m.amplitude)), number(m.frequency), number(100.0 * m.third))
        rows.append((f"{kph:g}", hands, *own, "yes" if each.agrees else "no"))
    verdict = f"No limit cycle is predicted or found with {results.law}: every start comes to rest."
    if results.cycles:
        verdict = (
            f"{len(results.cycles)} limit cycles; of {len(counted)} with a third harmonic below "
            f"{100.0 * limit_cycle.THIRD:g} %, {sum(each.agrees for each in counted)} are predicted within 10 %."
        )
    head = ("speed [km/h]", "hands", "amplitude, predicted [deg]", "frequency, predicted [Hz]",
            "amplitude [deg]", "frequency [Hz]", "third harmonic [%]", "within 10 %")  # fmt: skip
    starts = " and ".join(f"{math.degrees(kick):.1f}" for kick in limit_cycle.KICKS)
    return Section(
        "Limit cycles",
        "The steering does not shake by itself.",
        "Harmonic balance of the linear car in straight running with the describing functions of friction "
        f"({results.law}) and of the boost, beside simulations of 20 s in which the column is let go at {starts} deg "
        "and above every predicted cycle.",
        verdict,
        "The balance needs a motion that is nearly sinusoidal, of the column as of what the motor's limit leaves. A "
        "compensation of friction counts in the simulation only.",
        (),
        [Table("Limit cycles of the column angle", head, rows)] if rows else (),
    )


def build(results: Results) -> tuple[Page, dict[str, Any]]:
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
        "missed": [c.where for c in missed(results.cells)],
    }
    sections = [
        make(results) for make in (_margin_section, _nyquist_section, _bode_section, _root_section, _cycle_section)
    ]
    lead = (
        f"The car '{results.car}' linearised with its sampled assist, from the hands to the tyres "
        f"({results.chassis}); friction at rest by {results.law}."
    )
    return Page(NAME, "Analysis of the assist", lead, sentences(results), sections), data
