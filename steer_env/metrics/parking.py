"""Parking: effort of the sweeps between the locks with the car standing."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from steer_env.metrics.definitions import metric, procedure
from steer_env.metrics.reading import ANGLE, TORQUE, Reading
from steer_env.recording import Recording

CUTOFF = 10.0  # low-pass [Hz]
SOURCE = "parking test of steering-feel practice"


class Sweeps:
    """The last cycle between its locks; the rack's end stops are left out by 5 % of the angle."""

    def __init__(self, recording: Recording, asked: Mapping[str, Any]) -> None:
        self._smooth = Reading(recording, CUTOFF)
        settled = self._smooth.time > self._smooth.time[-1] - 1.0 / asked["frequency_hz"]
        angle, rate = (np.where(settled, self._smooth[name], np.nan) for name in (ANGLE, "handwheel_speed"))
        lock = np.nanmax(np.abs(angle))
        self.inside, self.centre = np.abs(angle) < 0.95 * lock, np.abs(angle) < 0.05 * lock
        self.outward = self.inside & (rate * angle > 0.0)

    def size(self, name: str, where: np.ndarray) -> np.ndarray:
        """Size of a channel where it is asked for."""
        return np.abs(self._smooth[name][where])


procedure("parking", Sweeps, constant_speed=False, frequency_hz=1.0 / 24.0)


@metric("N", "parking", source=SOURCE)
def rack_force_at_centre(sweeps: Sweeps) -> float:
    """Mean size of the rack force within 5 % of the angle of the lock."""
    return sweeps.size("rack_force", sweeps.centre).mean()


@metric("N", "parking", source=SOURCE)
def rack_force_peak(sweeps: Sweeps) -> float:
    """Largest rack force short of the end stops."""
    return sweeps.size("rack_force", sweeps.inside).max()


@metric("N", "parking", source=SOURCE)
def rack_force_mean_towards_lock(sweeps: Sweeps) -> float:
    """Mean size of the rack force on the way from centre to the locks."""
    return sweeps.size("rack_force", sweeps.outward).mean()


@metric("N m", "parking", source=SOURCE)
def handwheel_torque_at_centre(sweeps: Sweeps) -> float:
    """Mean size of the hand torque within 5 % of the angle of the lock."""
    return sweeps.size(TORQUE, sweeps.centre).mean()


@metric("N m", "parking", source=SOURCE)
def handwheel_torque_peak(sweeps: Sweeps) -> float:
    """Largest hand torque short of the end stops."""
    return sweeps.size(TORQUE, sweeps.inside).max()


@metric("N m", "parking", source=SOURCE)
def motor_torque_peak(sweeps: Sweeps) -> float:
    """Largest torque of the assist motor, at the column, short of the end stops."""
    return sweeps.size("motor_torque", sweeps.inside).max()
