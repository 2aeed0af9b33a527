"""Sine steering: gains and time lags between the peaks of the handwheel angle and those of the responses.

A recording holds one or more bursts of the sine. Each half wave of full amplitude is a repeat; the first cycle of a
burst is left out, as the car starts from rest, and shows in the ratio of the first half wave to the later ones. Left
and right half waves come in equal numbers, so that an offset of a sensor drops out of the mean.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from steer_env.metrics.common import events
from steer_env.metrics.common.definitions import RefusedError, metric, procedure
from steer_env.metrics.common.reading import ANGLE, AY, TORQUE, YAW, Reading
from steer_env.recording.recording import Recording
from steer_env.vehicle.constants import GRAVITY as G

CUTOFF = 5.0  # low-pass [Hz]
SPREAD = 0.2  # of the half waves' amplitudes around their median; assumed
FREQUENCY_SPREAD = 0.1  # of the frequency found around the one expected; assumed
FEWEST = 4  # half waves of a burst: a cycle to start, a cycle to read
SOURCE = "after ISO 7401"


class HalfWaves:
    """Half waves of the bursts in a recording; readings have one value a settled half wave, (n,)."""

    def __init__(self, recording: Recording, asked: Mapping[str, Any]) -> None:
        self._smooth = Reading(recording, CUTOFF)
        self.time, self.angle = self._smooth.time, self._smooth[ANGLE]
        centred = self.angle - (self.angle.max() + self.angle.min()) / 2
        far = np.abs(centred) > centred.max() / 4  # a half wave has left the noise
        found = []
        for i, j in (run for side in (1, -1) for run in events.runs(far & (np.sign(centred) == side))):
            if j - i >= events.FEWEST:
                side = np.sign(centred[i])
                found.append((*events.peak(self.time[i:j], side * centred[i:j]), side))
        found.sort()
        height = np.median([half[1] for half in found]) if found else 0.0
        found = [half for half in found if abs(half[1] - height) <= SPREAD * height]
        if len(found) < FEWEST:
            raise RefusedError(f"{len(found)} half waves of {ANGLE} with alike amplitude: steer {FEWEST} or more")
        times = np.array([half[0] for half in found])
        self.period = 2.0 * float(np.median(np.diff(times)))
        if not abs(self.period * asked["frequency_hz"] - 1) <= FREQUENCY_SPREAD:
            seen = 1 / self.period
            raise RefusedError(
                f"{ANGLE} is at {seen:.4g} Hz, not {asked['frequency_hz']:g} Hz: say frequency_hz={seen:.4g} if right"
            )
        pieces = np.split(np.arange(times.size), np.flatnonzero(np.diff(times) > 0.75 * self.period) + 1)
        whole = [[found[k] for k in piece[: piece.size // 2 * 2]] for piece in pieces if piece.size >= FEWEST]
        if not whole:
            raise RefusedError(f"no {FEWEST} half waves of {ANGLE} in a row: steer two cycles or more without a pause")
        self.bursts = whole

    def peaks(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Lag [s] behind the handwheel's peak and height over its height, of each half wave in turn."""
        values, found = self._smooth[name], []
        for time, height, side in (half for burst in self.bursts for half in burst):
            # From the handwheel's peak to half a period later; a torque may lead.
            near = (self.time > time - 0.25 * self.period) & (self.time < time + 0.4 * self.period)
            if self.time[-1] < time + 0.4 * self.period:
                raise RefusedError("the recording ends with the sine: record a second more")
            try:
                at, top = events.peak(self.time[near], side * values[near])
            except RefusedError:
                raise RefusedError(
                    f"{name} has no peak near that of {ANGLE}: check the signs, left is positive"
                ) from None
            if top <= 0:
                raise RefusedError(f"{name} does not follow {ANGLE}: check the signs, a left turn is positive in both")
            found.append((at - time, top / height))
        lags, gains = np.array(found).T
        return lags, gains

    def settled(self, values: np.ndarray) -> np.ndarray:
        """Of values of all half waves those from the second cycle of each burst on."""
        return values[np.concatenate([np.arange(len(burst)) >= 2 for burst in self.bursts])]

    def first_ratio(self, name: str) -> np.ndarray:
        """Gain of the first half wave over the mean of those settled on its side, (bursts,), less a sensor's zero.

        What one side has more than the other is that zero; between bursts it may move evenly.
        """
        gains = self.peaks(name)[1]
        time, _, side = np.array([half for burst in self.bursts for half in burst]).T
        basis = np.column_stack([side, np.ones(time.size), time - time.mean()])[:, : 3 if len(self.bursts) > 1 else 2]
        fit = np.linalg.lstsq(self.settled(basis), self.settled(gains * side), rcond=None)[0]
        gains = gains - side * (basis[:, 1:] @ fit[1:])
        parts = np.split(gains, np.cumsum([len(burst) for burst in self.bursts])[:-1])
        return np.array([of[0] / of[2::2].mean() for of in parts])

    def angle_at_zero(self, name: str) -> np.ndarray:
        """Handwheel angle, positive where it runs ahead, where a channel crosses zero before a settled half wave."""
        values, found = self._smooth[name], []
        middle = (self.angle.max() + self.angle.min()) / 2
        for burst in self.bursts:
            for time, _, side in burst[2:]:
                near = (self.time > time - 0.5 * self.period) & (self.time < time + 0.4 * self.period)
                at = events.crossing(self.time[near], side * values[near], 0.0)
                found.append(side * (np.interp(at, self.time, self.angle) - middle))
        return np.array(found)

    def peak_acceleration(self) -> float:
        """Mean peak of the lateral acceleration in the settled half waves [g]."""
        heights = np.array([half[1] for burst in self.bursts for half in burst])
        return float(self.settled(self.peaks(AY)[1] * heights).mean()) / G


procedure("sine", HalfWaves, speed_m_s=80 / 3.6, frequency_hz=0.5)


def _sine_metric(unit: str, **more: Any) -> Callable:
    return metric(unit, "sine", **{"source": SOURCE, **more})


@_sine_metric("1/s")
def yaw_rate_sine_gain(waves: HalfWaves) -> np.ndarray:
    """Peak yaw rate over peak handwheel angle, of each half wave from the second cycle on."""
    return waves.settled(waves.peaks(YAW)[1])


@_sine_metric("ms")
def yaw_rate_sine_lag(waves: HalfWaves) -> np.ndarray:
    """Time from the handwheel angle's peak to that of the yaw rate, of each half wave from the second cycle on."""
    return waves.settled(waves.peaks(YAW)[0])


@_sine_metric("1")
def yaw_rate_first_peak_ratio(waves: HalfWaves) -> np.ndarray:
    """Yaw rate over handwheel angle at the first peak, over that at the later peaks to the same side."""
    return waves.first_ratio(YAW)


@_sine_metric("g/100 deg")
def lateral_acceleration_sine_gain(waves: HalfWaves) -> np.ndarray:
    """Peak lateral acceleration over peak handwheel angle, of each half wave from the second cycle on."""
    return waves.settled(waves.peaks(AY)[1])


@_sine_metric("ms")
def lateral_acceleration_sine_lag(waves: HalfWaves) -> np.ndarray:
    """Time from the handwheel angle's peak to that of the lateral acceleration, from the second cycle on."""
    return waves.settled(waves.peaks(AY)[0])


@_sine_metric("1")
def lateral_acceleration_first_peak_ratio(waves: HalfWaves) -> np.ndarray:
    """Lateral acceleration over handwheel angle at the first peak, over that at the later peaks to the same side."""
    return waves.first_ratio(AY)


@_sine_metric("deg", source="common use")
def lateral_acceleration_sine_hysteresis(waves: HalfWaves) -> np.ndarray:
    """Width in handwheel angle of the loop over lateral acceleration at 0 g: twice the angle at each crossing."""
    return 2.0 * waves.angle_at_zero(AY)


@_sine_metric("deg", source="common use")
def yaw_rate_sine_hysteresis(waves: HalfWaves) -> np.ndarray:
    """Width in handwheel angle of the loop over yaw rate at zero: twice the angle at each crossing."""
    return 2.0 * waves.angle_at_zero(YAW)


@_sine_metric("N m/deg", source="common use")
def torque_sine_gain(waves: HalfWaves) -> np.ndarray:
    """Peak handwheel torque over peak handwheel angle, of each half wave from the second cycle on."""
    return waves.settled(waves.peaks(TORQUE)[1])
