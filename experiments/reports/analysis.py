"""The linearised car: margins of the assist loop as a map, open loops, frequency responses, modes, limit cycles."""

import math
from collections.abc import Callable
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import friction
from steer_env.experiments.calibration import margin_map
from steer_env.experiments.calibration.margin_map import KPH, Cell
from steer_env.friction import sites
from steer_env.vehicle.analysis import assist_loop, limit_cycle, linearised
from steer_env.vehicle.analysis.assist_loop import FREQUENCIES
from steer_env.vehicle.analysis.limit_cycle import Compared
from steer_env.vehicle.analysis.linearised import Point
from steer_env.vehicle.analysis.operating_point import Cornering, cornering, steady, with_hands
from steer_env.vehicle.cars import Car
from steer_env.vehicle.plant import CHASSIS_STEP
from steer_env.vehicle.steering.eps import boost_curve

Array = NDArray[np.float64]
Complexes = NDArray[np.complex128]

PAGE_NAME = "analyse"
MODES_SPEEDS = np.arange(20.0, 201.0, 6.0)  # of the modes [km/h]
BODE_SPEEDS = (50.0, 100.0, 140.0)  # [km/h]
BODE_FREQUENCIES = np.geomspace(0.1, 30.0, 120)  # [Hz]
# Hands, input and output of the frequency responses that are drawn, and the unit of their gain.
PATHS = (
    ("on", "handwheel_angle", "yaw_rate", "1/s"),
    ("on", "handwheel_angle", "lateral_acceleration", "(m/s²)/rad"),
    ("on", "handwheel_angle", "handwheel_torque", "N m/rad"),
    ("off", "hand_torque", "yaw_rate", "(rad/s)/(N m)"),
)


class Results(NamedTuple):
    """All that the page shows."""

    car: str
    chassis: str
    law: str
    cells: list[Cell]  # at standstill, then of the moving car
    loops: dict[str, Complexes]  # label -> open loop at FREQUENCIES, at the speed and hands of the worst cell
    bode: dict[tuple[str, str], dict[str, Complexes]]  # (input, output) -> label -> response at BODE_FREQUENCIES
    speed_modes: list[Complexes]  # over MODES_SPEEDS, hands off, straight [1/s]
    factors: Array  # on the slope of the boost
    boost_modes: list[Complexes]  # over factors, at the worst cell [1/s]
    cycles: list[tuple[float, str, Compared]]  # speed [km/h], hands, and the limit cycle
    driven_back_db: float  # by which a gear that slides and is driven back raises the loop's gain [dB]

    @property
    def worst(self) -> Cell:
        """The point of the moving car with the smallest disk margin."""
        return worst_cell([cell for cell in self.cells if cell.speed_kph])


def worst_cell(cells: list[Cell]) -> Cell:
    """The cell with the smallest disk margin."""
    return min((cell for cell in cells if cell.margins), key=lambda cell: cell.margins.disk)  # type: ignore[union-attr]


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
    law : steer_env.experiments.pages.options.Friction or str
        The friction law at rest.
    chassis : str
    notify : callable
        Told the part that is done and what comes next.
    """
    label, p = (law, law) if isinstance(law, str) else (law.label, law.parameters)
    cells, turns = margin_map.standing(car, p), dict[float, Cornering]()
    for i, kph in enumerate(margin_map.SPEEDS):
        notify(0.8 * i / len(margin_map.SPEEDS), f"margins at {kph:g} km/h")
        turns[kph] = cornering(car, kph / KPH, chassis)
        cells += margin_map.of_speed(turns[kph], kph, p)
    worst = worst_cell([cell for cell in cells if cell.speed_kph])
    notify(0.8, "responses and modes")
    at = [c for c in cells if c.margins and c[0] == worst.speed_kph and c[2:4] == (worst.hands, worst.friction)]
    points = {
        cell.torque: margin_map.worst_point(
            steady(turns[worst.speed_kph], torque=cell.torque), worst.hands, worst.friction, p
        )
        for cell in at
    }
    loops = {f"{torque:g} N m": assist_loop.response(each, FREQUENCIES) for torque, each in points.items()}
    point = points[worst.torque]
    gain = worst.margins.gain if worst.margins and worst.margins.stable else 1.0  # the locus ends above the limit
    factors = np.linspace(0.0, 1.2 * min(gain, 20.0), 60)
    boost_modes = [
        _modes(linearised.transition(each.plant, state=each.state, inputs=each.inputs)[0])
        for each in (_scaled(point, float(factor)) for factor in factors)
    ]
    notify(0.9, "limit cycles")
    cycles = [
        (kph, hands, each)
        for kph, hands in product(BODE_SPEEDS, ("on", "off"))
        for each in limit_cycle.compare(with_hands(steady(cornering(car, kph / KPH, chassis)), hands), p)
    ]
    return Results(
        car=car.name,
        chassis=chassis,
        law=label,
        cells=cells,
        loops=loops,
        bode=_bode(car, chassis),
        speed_modes=_speed_modes(car, chassis),
        factors=factors,
        boost_modes=boost_modes,
        cycles=cycles,
        driven_back_db=20.0 * math.log10(max(sites.transmissions(friction.resolve(p)))),
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
            g = linearised.linearise(with_hands(straight, hands))
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
