"""Margins of the assist loop in every cell of a car's boost table."""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

from steer_env.friction import resolve
from steer_env.friction.sites import transmissions
from steer_env.vehicle import cars
from steer_env.vehicle.steering import margins
from steer_env.vehicle.steering.margins import TARGETS


class Cell(NamedTuple):
    """Margins of the assist loop in one cell of the boost table."""

    torque: float  # middle of the cell [N m]
    gain: float  # [1]
    phase_deg: float  # [deg]
    gain_db: float  # [dB]
    crossover_hz: float  # [Hz]
    stable: bool


def assist_cells(car: str | cars.Car, speed_kph: float, frictions: Iterable[Any] = ()) -> list[Cell]:
    """Margins of the assist loop of a car, or of the packaged car of a name, in every cell that assists at a speed.

    The smallest with any of the frictions, whose gears may change the loop while they slide (E25).
    """
    passed = sorted({1.0, *(factor for each in frictions for factor in transmissions(resolve(each)))})
    loaded = cars.load(car) if isinstance(car, str) else car
    return [
        Cell(
            torque,
            slope,
            math.degrees(m.phase),
            20.0 * math.log10(m.gain),
            m.crossover,
            m.stable,
        )
        for torque, slope, m in margins.of_cells(loaded.column, loaded.assist, speed_kph / 3.6, passed)
    ]


def on_target(cell: Cell) -> bool:
    """Whether a cell is stable with the usual margins."""
    return cell.stable and cell.phase_deg >= TARGETS[0] and cell.gain_db >= TARGETS[1]
