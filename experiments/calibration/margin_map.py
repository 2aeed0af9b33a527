"""The margins of the assist loop at every point where a car is driven: speed, torque, hands and friction."""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import product
from typing import Any, NamedTuple

from steer_env.drivers.common.definition import arm
from steer_env.friction import resolve
from steer_env.friction.numerics import cache
from steer_env.friction.sites import transmissions
from steer_env.vehicle.analysis import assist_loop
from steer_env.vehicle.analysis.linearised import Point
from steer_env.vehicle.analysis.operating_point import HAND_MODES, Cornering, cornering, steady, with_hands
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.margins import TARGETS, Margins, least, of_cells

KPH = 3.6  # [km/h] of 1 m/s
SPEEDS = (20.0, 40.0, 60.0, 80.0, 100.0, 120.0, 140.0)  # [km/h]
SAMPLE = 60.0  # whose points are timed [km/h]
TORQUES = (0.0, 1.0, 2.0, 3.0, 3.5, 4.0)  # [N m]
SLIDING, RESTING = "friction slides", "friction at rest"
PHASE_LIMIT, GAIN_LIMIT = TARGETS  # [deg], [dB]


class Cell(NamedTuple):
    """One point of the map."""

    speed_kph: float  # [km/h]
    torque: float  # of the torsion bar [N m]
    hands: str
    friction: str
    margins: Margins | None  # None where the car does not reach the torque
    load: float = 0.0  # [kg]

    @property
    def phase_deg(self) -> float:
        """Phase margin [deg]; NaN without a point."""
        return math.nan if self.margins is None else math.degrees(self.margins.phase)

    @property
    def gain_db(self) -> float:
        """Gain margin [dB]; NaN without a point."""
        return math.nan if self.margins is None else 20.0 * math.log10(self.margins.gain)

    @property
    def broken(self) -> tuple[str, ...]:
        """The limits that the point breaks, in words."""
        if self.margins is None:
            return ()
        broken = not self.margins.stable, self.phase_deg < PHASE_LIMIT, self.gain_db < GAIN_LIMIT
        return tuple(words for words, each in zip(("stability", "phase margin", "gain margin"), broken) if each)

    @property
    def where(self) -> str:
        """The point in words."""
        laden = f", {self.load:g} kg of load" if self.load else ""
        return f"{self.speed_kph:g} km/h, {self.torque:g} N m, hands {self.hands}, {self.friction}{laden}"


def hold(point: Point, hands: str, law: Any) -> Point:
    """The point with hands of ``HAND_MODES``; ``law`` is that of the friction at rest, None where it slides."""
    return with_hands(point, hands, law, arm()[:3] if hands == "arms" else (0.0, 0.0, 0.0))


def _steady_turn(turn: Cornering, torque: float) -> Point | None:
    """The steady turn at a torque [N m]; None where the car does not reach it, which the map shows."""
    if torque <= turn.torques.max():
        with suppress(ValueError):  # too near to the limit of the front tyres
            return steady(turn, torque=torque)
    return None


def operating_points(point: Point, hands: str, friction: str, law: Any) -> list[Point]:
    """The point with its hands and friction; of friction that slides, with each factor that its gear has (E25)."""
    if friction == RESTING:
        return [hold(point, hands, law)]
    return [assist_loop.transmitted(hold(point, hands, None), factor) for factor in transmissions(resolve(law))]


def worst_point(point: Point, hands: str, friction: str, law: Any) -> Point:
    """That of :func:`operating_points` with the smallest disk margin."""
    each = operating_points(point, hands, friction, law)
    return min(each, key=lambda p: assist_loop.margins(p).disk) if len(each) > 1 else each[0]


def _margins(point: Point | None, hands: str, friction: str, law: Any) -> Margins | None:
    return (
        least([assist_loop.margins(each) for each in operating_points(point, hands, friction, law)]) if point else None
    )


def of_speed(turn: Cornering, kph: float, law: Any) -> Iterator[Cell]:
    """The cells of one speed."""
    for torque in TORQUES:
        point = _steady_turn(turn, torque)
        for hands, friction in product(HAND_MODES, (SLIDING, RESTING)):
            yield Cell(kph, torque, hands, friction, _margins(point, hands, friction, law))


def standing(car: Car, law: Any) -> list[Cell]:
    """The points at standstill: the column against a rack force that stays, in every cell of the boost table."""
    cells = of_cells(car.column, car.assist, 0.0, transmissions(resolve(law)))
    return [Cell(0.0, cell.torque, "on", SLIDING, cell.margins) for cell in cells]


def of_car(car: Car, law: Any, loads: Sequence[float], chassis: str) -> list[Cell]:
    """The cells of all speeds with every load [kg]."""
    cells = list[Cell]()
    for load, kph in product(loads, SPEEDS):
        found = of_speed(cornering(car.loaded(load), kph / KPH, chassis), kph, law)
        cells += [cell._replace(load=load) for cell in found]
    return cells


def seconds(car: Car, law: Any, chassis: str) -> float:
    """Time that a point of the map takes, of those of one speed that the car reaches [s]."""
    start = time.perf_counter() - cache.compile_seconds()
    cells = list(of_speed(cornering(car, SAMPLE / KPH, chassis), SAMPLE, law))
    return (time.perf_counter() - cache.compile_seconds() - start) / sum(cell.margins is not None for cell in cells)


def map_points(points: Sequence[Cell], car: Car, law: Any, chassis: str) -> list[Cell]:
    """The cells of a car at the points of other cells."""
    found = list[Cell]()
    for p in points:
        turn = cornering(car.loaded(p.load), p.speed_kph / KPH, chassis)
        found.append(p._replace(margins=_margins(_steady_turn(turn, p.torque), p.hands, p.friction, law)))
    return found


def cells_below_limits(cells: Sequence[Cell]) -> list[Cell]:
    """The cells below the limits of phase or gain margin, or unstable."""
    return [cell for cell in cells if cell.broken]
