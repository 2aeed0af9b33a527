"""Catch-up: the handwheel speed above which the assist falls behind and the hands feel a higher torque.

The recording contains sweeps to and fro at several speeds. Each sweep is read in the middle half of its travel, where
the speed is nearly constant and the inertia of the handwheel has no mean effect. A fast sweep is compared with the slow
sweeps over the same angles to the same side.
"""

from collections.abc import Mapping
from functools import cached_property, partial
from typing import Any

import numpy as np

from steer_env.metrics.common.definitions import RefusedError, metric, register_evaluation
from steer_env.metrics.common.filtered_channels import ANGLE, TORQUE, FilteredChannels
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle.keys import checked
from steer_env.vehicle.steering import motor

CUTOFF = 10.0  # low-pass [Hz]
MIDDLE = 0.5  # fraction of the travel that is read; assumed [1]
FULL = 0.9  # fraction of the travel that a sweep must cover; assumed [1]
SLOW = 60.0 * DEGREE  # highest speed of a quasi-static sweep; assumed [rad/s]
AT_LIMIT = 0.98  # of its largest torque, from which the motor counts as at its limit; assumed [1]
CATCH_UP = 2.5  # torque above the quasi-static torque that the hands feel, 2 to 3 in practice [N m]
AT = 500.0 * DEGREE  # speed at which the excess is reported; assumed [rad/s]
FEWEST = 4  # samples in the middle of a sweep; assumed
SOURCE = "catch-up test of steering-feel practice"


class FastSweeps:
    """Speed and mean torque of each sweep, and by how much the torque exceeds that of the slow sweeps to that side."""

    def __init__(self, recording: Recording, conditions: Mapping[str, Any]) -> None:
        smooth, time = FilteredChannels(recording, CUTOFF), recording.time
        self._smooth, self._limits = smooth, conditions["motor"]
        angle, torque = smooth[ANGLE], smooth[TORQUE]
        half = 0.5 * np.ptp(angle)
        travel = (angle - 0.5 * (angle.max() + angle.min())) / max(half, 1e-9)
        far = np.flatnonzero(np.abs(travel) >= FULL)
        crossed = np.flatnonzero(travel[far[:-1]] * travel[far[1:]] < 0)
        rate, effort, side = [], [], []
        self._middle: list[np.ndarray] = []
        for a, b in zip(far[crossed], far[crossed + 1]):
            inside = np.arange(a, b + 1)[np.abs(travel[a : b + 1]) <= MIDDLE]
            if inside.size < FEWEST:
                raise RefusedError(
                    f"{inside.size} samples in the middle of a sweep: record faster than {recording.rate:g} Hz"
                )
            sign = np.sign(travel[b] - travel[a])
            slope = np.polynomial.polynomial.polyfit(time[inside] - time[inside[0]], angle[inside], 1)[1]
            # The mean over the angle, not over time, gives the angles the same weight in a fast and in a slow sweep.
            mean = np.trapezoid(torque[inside], angle[inside]) / (angle[inside[-1]] - angle[inside[0]])
            rate.append(sign * slope)
            effort.append(sign * mean)
            side.append(sign)
            self._middle.append(inside)
        self.rate, self.effort, self.side = np.array(rate), np.array(effort), np.array(side)
        self.sides = [s for s in (1.0, -1.0) if np.any((self.side == s) & (self.rate <= SLOW))]
        if not self.sides:
            raise RefusedError(f"no sweep at {SLOW / DEGREE:g} deg/s or slower to compare with: steer some first")
        self.quasi_static = np.array([self.effort[(self.side == s) & (self.rate <= SLOW)].mean() for s in self.sides])
        if np.any(self.quasi_static <= 0):
            raise RefusedError(f"{TORQUE} runs against the turning {ANGLE}: check the signs, left is positive in both")

    @cached_property
    def at_limit(self) -> np.ndarray:
        """Share of the middle of each sweep in which the motor gives its largest torque [1]."""
        if not isinstance(self._limits, Mapping):  # a drive says there whether its wheel has a motor
            raise RefusedError(
                "the recording has no limits of a motor in its meta motor: give limit and the keys motor_* of its car "
                "file there, in a mapping [meta.motor]"
            )
        try:
            keys = dict(self._limits)
            limit, m = checked("assist", "limit", keys.pop("limit")), motor.make(**keys)
        except (TypeError, ValueError, KeyError) as error:
            raise RefusedError(f"the recording has no limits of a motor in its meta motor: {error}") from None
        T, w = self._smooth["motor_torque"], self._smooth["column_speed"]
        at = np.abs(T) >= AT_LIMIT * np.minimum(motor.course(m, self._smooth.recording.time, T, w), limit)
        return np.array([at[inside].mean() for inside in self._middle])

    def series(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """For each side the speeds of the sweeps, in ascending order, and their excess torques."""
        found = []
        for side, slow in zip(self.sides, self.quasi_static):
            k = np.flatnonzero(self.side == side)
            k = k[np.argsort(self.rate[k])]
            found.append((self.rate[k], self.effort[k] - slow))
        return found


register_evaluation("catch-up", FastSweeps, speed_m_s=0.0, motor=None)

_catch_up = partial(metric, source=SOURCE)


@_catch_up("deg/s", "catch-up")
def catch_up_rate(sweeps: FastSweeps) -> np.ndarray:
    """Handwheel speed at which the torque exceeds that of slow sweeps over the same angles by 2.5 N m; one per side."""
    found = []
    for rate, excess in sweeps.series():
        above = np.flatnonzero(excess >= CATCH_UP)
        if above.size == 0:
            raise RefusedError(
                f"not reached up to {rate.max() / DEGREE:.0f} deg/s, where the excess is {excess[-1]:.2g} of "
                f"{CATCH_UP:g} N m: steer faster, or conclude that the assist keeps up"
            )
        k = int(above[0])
        found.append(np.interp(CATCH_UP, excess[k - 1 : k + 1], rate[k - 1 : k + 1]))
    return np.array(found)


@_catch_up("N m", "catch-up")
def torque_excess_at_500_deg_s(sweeps: FastSweeps) -> np.ndarray:
    """Hand torque above that of slow sweeps over the same angles at a handwheel speed of 500 deg/s; one per side."""
    found = []
    for rate, excess in sweeps.series():
        if rate.max() < AT:
            raise RefusedError(f"the fastest sweep is at {rate.max() / DEGREE:.0f} deg/s: steer at 500 deg/s or faster")
        found.append(np.interp(AT, rate, excess))
    return np.array(found)


@_catch_up("N m", "catch-up")
def quasi_static_torque(sweeps: FastSweeps) -> np.ndarray:
    """Mean hand torque of the sweeps at 60 deg/s or slower, in the middle half of their travel; one per side."""
    return sweeps.quasi_static


@_catch_up("1", "catch-up")
def share_at_motor_limit(sweeps: FastSweeps) -> np.ndarray:
    """Share of the sweeps above 60 deg/s, in the middle half of their travel, at the motor's limit; one per side."""
    fast = sweeps.rate > SLOW
    found = [sweeps.at_limit[fast & (sweeps.side == side)] for side in sweeps.sides]
    if not all(each.size for each in found):
        raise RefusedError(f"no sweep above {SLOW / DEGREE:g} deg/s to each side: steer faster")
    return np.array([each.mean() for each in found])


@_catch_up("deg/s", "catch-up")
def motor_limit_rate(sweeps: FastSweeps) -> np.ndarray:
    """Speed of the slowest sweep in whose middle half the motor reaches its limit, of those driven; one per side."""
    found = [sweeps.rate[(sweeps.at_limit > 0.0) & (sweeps.side == side)] for side in sweeps.sides]
    if not all(each.size for each in found):
        raise RefusedError(f"not reached up to {sweeps.rate.max() / DEGREE:.0f} deg/s: steer faster, or none is met")
    return np.array([each.min() for each in found])
