"""The page of the linearised car: margins of the assist loop as a map, Nyquist curves, frequency responses, modes."""

import math
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.drivers.common.definition import arm
from steer_env.experiments.drawing import analysis_pictures, still_plots
from steer_env.experiments.drawing.plots import Line, Panel
from steer_env.experiments.drawing.style import colours
from steer_env.experiments.output.words import number
from steer_env.experiments.studies.common.page import Page, Picture, Section, Table
from steer_env.vehicle import assist_loop, linearised
from steer_env.vehicle.assist_loop import FREQUENCIES, Margins
from steer_env.vehicle.cars import Car
from steer_env.vehicle.linearised import Point
from steer_env.vehicle.operating_point import HANDS, Cornering, cornering, held, steady
from steer_env.vehicle.plant import CHASSIS_STEP
from steer_env.vehicle.steering.eps import boost_curve
from steer_env.vehicle.steering.margins import TARGETS

Array = NDArray[np.float64]
Complexes = NDArray[np.complex128]

NAME = "analyse"
KPH = 3.6  # [km/h] of 1 m/s
SPEEDS = (20.0, 40.0, 60.0, 80.0, 100.0, 120.0, 140.0)  # of the map [km/h]
TORQUES = (0.0, 1.0, 2.0, 3.0, 3.5, 4.0)  # of the map [N m]
MODES_SPEEDS = np.arange(20.0, 201.0, 6.0)  # of the modes [km/h]
BODE_SPEEDS = (50.0, 100.0, 140.0)  # [km/h]
BODE_FREQUENCIES = np.geomspace(0.1, 30.0, 120)  # [Hz]
SLIDING, RESTING = "friction slides", "friction at rest"
PHASE_LIMIT, GAIN_LIMIT = TARGETS  # [deg], [dB]
LIMIT_DISK = 2.0 * math.tan(math.radians(0.5 * PHASE_LIMIT))  # whose disk has this phase margin [1]
# Hands, input and output of the frequency responses that are drawn, and the unit of their gain.
PATHS = (
    ("on", "handwheel_angle", "yaw_rate", "1/s"),
    ("on", "handwheel_angle", "lateral_acceleration", "(m/s²)/rad"),
    ("on", "handwheel_angle", "handwheel_torque", "N m/rad"),
    ("off", "hand_torque", "yaw_rate", "(rad/s)/(N m)"),
)


class Cell(NamedTuple):
    """One point of the map."""

    speed_kph: float
    torque: float  # of the torsion bar [N m]
    hands: str
    friction: str
    margins: Margins | None  # None where the car does not reach the torque

    @property
    def phase_deg(self) -> float:
        """Phase margin [deg]; NaN without a point."""
        return math.nan if self.margins is None else math.degrees(self.margins.phase)

    @property
    def gain_db(self) -> float:
        """Gain margin [dB]; NaN without a point."""
        return math.nan if self.margins is None else 20.0 * math.log10(self.margins.gain)

    @property
    def where(self) -> str:
        """The point in words."""
        return f"{self.speed_kph:g} km/h, {self.torque:g} N m, hands {self.hands}, {self.friction}"


class Results(NamedTuple):
    """All that the page shows."""

    car: str
    chassis: str
    law: str
    cells: list[Cell]
    loops: dict[str, Complexes]  # label -> open loop at FREQUENCIES, at the speed and hands of the worst cell
    bode: dict[tuple[str, str], dict[str, Complexes]]  # (input, output) -> label -> response at BODE_FREQUENCIES
    speed_modes: list[Complexes]  # over MODES_SPEEDS, hands off, straight [1/s]
    factors: Array  # on the slope of the boost
    boost_modes: list[Complexes]  # over factors, at the worst cell [1/s]

    @property
    def worst(self) -> Cell:
        """The cell with the smallest disk margin."""
        return _worst(self.cells)


def _worst(cells: list[Cell]) -> Cell:
    return min((cell for cell in cells if cell.margins), key=lambda cell: cell.margins.disk)  # type: ignore[union-attr]


def _held(turn: Cornering, torque: float, hands: str, law: Any) -> Point:
    arms = arm()[:3] if hands == "arms" else (0.0, 0.0, 0.0)
    return held(steady(turn, torque=torque), hands, law, arms)


def _map(turn: Cornering, kph: float, law: Any) -> Iterator[Cell]:
    """The cells of one speed."""
    for torque in TORQUES:
        try:
            steady(turn, torque=torque)
        except ValueError:  # the car does not reach it, which the map shows
            reached = False
        else:
            reached = True
        for hands, friction in product(HANDS, (SLIDING, RESTING)):
            point = _held(turn, torque, hands, law if friction == RESTING else None) if reached else None
            yield Cell(kph, torque, hands, friction, assist_loop.margins(point) if point else None)


def _modes(A: Array) -> Complexes:
    z = np.linalg.eigvals(A).astype(complex)
    return np.log(z[np.abs(z) > 1e-3]) / CHASSIS_STEP


def _scaled(point: Point, factor: float) -> Point:
    """The point with a factor on the slope of the boost, which keeps its value."""
    a = point.plant.assist
    own = boost_curve(a, point.torque, point.speed)[0]
    return point._replace(plant=point.plant._replace(assist=a._replace(boost=own + factor * (a.boost - own))))


def collect(
    car: Car, law: Any, chassis: str, notify: Callable[[float, str], None] = lambda part, text: None
) -> Results:
    """Linearise the car everywhere.

    Parameters
    ----------
    car : Car
    law : steer_env.experiments.output.options.Friction or str
        The friction law at rest.
    chassis : str
    notify : callable
        Told the part that is done and what comes next.
    """
    label, p = (law, law) if isinstance(law, str) else (law.label, law.parameters)
    cells, turns = list[Cell](), dict[float, Cornering]()
    for i, kph in enumerate(SPEEDS):
        notify(0.8 * i / len(SPEEDS), f"margins at {kph:g} km/h")
        turns[kph] = cornering(car, kph / KPH, chassis)
        cells += _map(turns[kph], kph, p)
    worst = _worst(cells)
    notify(0.8, "responses and modes")
    at = [c for c in cells if c.margins and c[0] == worst.speed_kph and c[2:4] == (worst.hands, worst.friction)]
    resting = p if worst.friction == RESTING else None
    loops = {
        f"{cell.torque:g} N m": assist_loop.open_loop(
            _held(turns[worst.speed_kph], cell.torque, worst.hands, resting)
        ).response(FREQUENCIES)
        for cell in at
    }
    point = _held(turns[worst.speed_kph], worst.torque, worst.hands, resting)
    gain = worst.margins.gain if worst.margins else math.inf
    factors = np.linspace(0.0, 1.2 * min(gain, 20.0), 60)
    boost_modes = [
        _modes(linearised.transition(each.plant, state=each.state, inputs=each.inputs)[0])
        for each in (_scaled(point, float(factor)) for factor in factors)
    ]
    return Results(
        car.name, chassis, label, cells, loops, _bode(car, chassis), _speed_modes(car, chassis), factors, boost_modes
    )


def _speed_modes(car: Car, chassis: str) -> list[Complexes]:
    """Modes of the free car without friction over MODES_SPEEDS."""
    plants = (car.plant(linearised.FRICTIONLESS, float(kph) / KPH, chassis=chassis) for kph in MODES_SPEEDS)
    return [_modes(linearised.transition(p)[0]) for p in plants]


def _bode(car: Car, chassis: str) -> dict[tuple[str, str], dict[str, Complexes]]:
    """Frequency responses of PATHS in straight running, friction sliding."""
    found: dict[tuple[str, str], dict[str, Complexes]] = {path[1:3]: {} for path in PATHS}
    s = 2j * math.pi * BODE_FREQUENCIES
    for kph in BODE_SPEEDS:
        straight = steady(cornering(car, kph / KPH, chassis))
        for hands in ("on", "off"):
            g = linearised.linearise(held(straight, hands))
            response = g(np.exp(s * CHASSIS_STEP))
            if hands == "on":  # an angle that turns with its speed, one step ahead of the states
                own = (response[:, 0] + s * response[:, 1]) * np.exp(s * CHASSIS_STEP)
            else:
                own = response[:, 0]
            for of, _, output, _ in (path for path in PATHS if path[0] == hands):
                found["handwheel_angle" if of == "on" else "hand_torque", output][f"{kph:g} km/h"] = own[
                    g.output_labels.index(output)
                ]
    return found


def missed(cells: list[Cell]) -> list[Cell]:
    """The cells below the limits of phase or gain margin, or unstable."""
    return [
        c for c in cells if c.margins and (c.phase_deg < PHASE_LIMIT or c.gain_db < GAIN_LIMIT or not c.margins.stable)
    ]


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
        found[f"hands {hands}, {friction}"] = np.reshape(own, (len(SPEEDS), len(TORQUES))).T
    return found


def _margin_section(results: Results) -> Section:
    axes = [f"{v:g}" for v in SPEEDS], [f"{T:g}" for T in TORQUES]
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
    for kph in SPEEDS:
        own = [c for c in results.cells if c.margins and c.speed_kph == kph]
        worst = _worst(own)
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
    told = [f"at {number(BODE_FREQUENCIES[i])} Hz ({k})" if i else f"at rest ({k})" for k, i in peaks.items()]
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
    unstable = [v for v, modes in zip(MODES_SPEEDS, results.speed_modes) if modes.real.max() > 1e-3]
    free = f"grows from {unstable[0]:g} km/h on" if unstable else f"decays up to {MODES_SPEEDS[-1]:g} km/h"
    crossed = [f for f, modes in zip(results.factors, results.boost_modes) if modes.real.max() > 1e-3]
    boosted = f"with {number(crossed[0])} times its slope" if crossed else "with no slope that was tried"
    loci = [
        ("hands off, over speed", "speed [km/h]", MODES_SPEEDS, results.speed_modes, 6.0),
        ("over the slope of the boost", "factor on the slope [1]", results.factors, results.boost_modes, 60.0),
    ]
    return Section(
        "Modes",
        "No motion of the closed loop grows.",
        "Eigenvalues of the plant over a chassis step: of the free car without friction over speed, and over a factor "
        f"on the slope of the boost at the smallest disk margin ({w.where}).",
        f"Hands off the motion {free}. The assist becomes unstable {boosted}; its gain margin is "
        f"{number(w.margins.gain)}.",  # type: ignore[union-attr]
        "On the upper half plane; modes beyond the panel are not shown.",
        [Picture(analysis_pictures.root_loci(loci), "Root loci over speed and over the slope of the boost")],
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
        "missed": [c.where for c in missed(results.cells)],
    }
    sections = [make(results) for make in (_margin_section, _nyquist_section, _bode_section, _root_section)]
    lead = (
        f"The car '{results.car}' linearised with its sampled assist, from the hands to the tyres "
        f"({results.chassis}); friction at rest by {results.law}."
    )
    return Page(NAME, "Analysis of the assist", lead, sentences(results), sections), data
