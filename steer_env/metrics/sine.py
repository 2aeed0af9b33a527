"""Sine steering: gains and time lags between the peaks of the handwheel angle and the peaks of the responses.

A recording contains one or more bursts of a sine. Each half wave of full amplitude is a repeat. The first cycle of a
burst is left out, because the car starts from straight running; the ratio of the first half wave to the later ones
shows its effect. Left and right half waves come in equal numbers, so that an offset of a sensor drops out of the mean.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy import special

from steer_env.metrics.common import events, noise
from steer_env.metrics.common.confidence import CONFIDENCE_LEVEL
from steer_env.metrics.common.definitions import Bounded, RefusedError, metric, register_evaluation
from steer_env.metrics.common.filtered_channels import ANGLE, AY, TORQUE, YAW, FilteredChannels
from steer_env.metrics.common.kept import kept
from steer_env.recording.recording import Recording
from steer_env.vehicle.constants import GRAVITY as G

CUTOFF = 5.0  # low-pass [Hz]
SPREAD = 0.2  # largest deviation of a half wave's amplitude from their median, as a fraction of it; assumed [1]
FREQUENCY_SPREAD = 0.1  # largest deviation from the expected frequency, as a fraction of it; assumed [1]
FEWEST = 4  # half waves of a burst: one cycle at the start, one cycle that is read
SOURCE = "after ISO 7401"


class HalfWaves:
    """The half waves of the bursts in a recording; most methods return one value for each settled half wave, (n,)."""

    def __init__(self, recording: Recording, conditions: Mapping[str, Any]) -> None:
        self._smooth = FilteredChannels(recording, CUTOFF)
        self.time, self.angle = self._smooth.time, self._smooth[ANGLE]
        centred = self.angle - (self.angle.max() + self.angle.min()) / 2
        far = np.abs(centred) > centred.max() / 4  # where a half wave stands out of the noise
        found = []
        for i, j in (run for side in (1, -1) for run in events.true_runs(far & (np.sign(centred) == side))):
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
        expected, seen = conditions["frequency_hz"], 1 / self.period
        if not abs(self.period * expected - 1) <= FREQUENCY_SPREAD:
            raise RefusedError(
                f"{ANGLE} is at {seen:.4g} Hz, not {expected:g} Hz: give frequency_hz={seen:.4g} if that is right"
            )
        pieces = np.split(np.arange(times.size), np.flatnonzero(np.diff(times) > 0.75 * self.period) + 1)
        whole = [[found[k] for k in piece[: piece.size // 2 * 2]] for piece in pieces if piece.size >= FEWEST]
        if not whole:
            raise RefusedError(f"no {FEWEST} half waves of {ANGLE} in a row: steer two cycles or more without a pause")
        self.bursts = whole

    @kept
    def peaks(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Lag behind the handwheel's peak [s] and ratio to its height, for each half wave in the order of time."""
        values, found = self._smooth[name], []
        for time, height, side in (half for burst in self.bursts for half in burst):
            # The peak follows that of the handwheel by less than half a period; that of a torque may lead.
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
        """Out of values for all half waves, those from the second cycle of each burst on."""
        return values[np.concatenate([np.arange(len(burst)) >= 2 for burst in self.bursts])]

    def first_ratio(self, name: str) -> Bounded:
        """Gain of the first half wave of each burst over the mean of the settled half waves to its side, (bursts,).

        The offset of a sensor is subtracted. It is the difference of the two sides, and may drift linearly over the
        bursts. The bounds of a single burst, which does not repeat itself, are those from the noise of both channels.
        """
        gains = self.peaks(name)[1]
        time, _, side = np.array([half for burst in self.bursts for half in burst]).T
        basis = np.column_stack([side, np.ones(time.size), time - time.mean()])[:, : 3 if len(self.bursts) > 1 else 2]
        fit = np.linalg.lstsq(self.settled(basis), self.settled(gains * side), rcond=None)[0]
        gains = gains - side * (basis[:, 1:] @ fit[1:])
        bursts = np.split(gains, np.cumsum([len(burst) for burst in self.bursts])[:-1])
        ratios = np.array([burst[0] / burst[2::2].mean() for burst in bursts])
        if ratios.size > 1:
            return Bounded(ratios, 0.0, 0.0)
        share = np.hypot(self._noise(name, gains), self._noise(ANGLE)) * np.sqrt(1.0 + 1.0 / bursts[0][2::2].size)
        reach = float(special.ndtri(0.5 + 0.5 * CONFIDENCE_LEVEL) * share * ratios[0])
        return Bounded(ratios, reach, reach)

    def _noise(self, name: str, gains: np.ndarray | float = 1.0) -> float:
        """Standard deviation of the height of a channel's peak, from white noise, as a fraction of the height.

        A cubic that is fitted to n samples has 1.5 / sqrt(n) of their deviation in its middle.
        """
        height = float(np.mean(np.abs(gains) * np.array([half[1] for burst in self.bursts for half in burst])))
        samples = np.arccos(events.TOP) / np.pi * self.period * self._smooth.recording.rate
        return 1.5 * noise.white(self._smooth, name, CUTOFF) / (np.sqrt(samples) * height)

    def angle_at_zero(self, name: str) -> np.ndarray:
        """Handwheel angle where a channel crosses zero before each settled half wave; positive if the angle leads."""
        values, found = self._smooth[name], []
        middle = (self.angle.max() + self.angle.min()) / 2
        for burst in self.bursts:
            for time, _, side in burst[2:]:
                near = (self.time > time - 0.5 * self.period) & (self.time < time + 0.4 * self.period)
                at = events.crossing(self.time[near], side * values[near], 0.0)
                found.append(side * (np.interp(at, self.time, self.angle) - middle))
        return np.array(found)

    @kept
    def peak_acceleration(self) -> float:
        """Mean peak of the lateral acceleration in the settled half waves [g]."""
        heights = np.array([half[1] for burst in self.bursts for half in burst])
        return float(self.settled(self.peaks(AY)[1] * heights).mean()) / G


register_evaluation("sine", HalfWaves, steered=True, speed_m_s=80 / 3.6, frequency_hz=0.5)


def _sine_metric(unit: str, **more: Any) -> Callable:
    return metric(unit, "sine", **{"source": SOURCE, **more})


@_sine_metric("1/s")
def yaw_rate_sine_gain(waves: HalfWaves) -> np.ndarray:
    """Peak yaw rate divided by peak handwheel angle, for each half wave from the second cycle on."""
    return waves.settled(waves.peaks(YAW)[1])


@_sine_metric("ms")
def yaw_rate_sine_lag(waves: HalfWaves) -> np.ndarray:
    """Time from the peak of the handwheel angle to the yaw rate's, for each half wave from the second cycle on."""
    return waves.settled(waves.peaks(YAW)[0])


@_sine_metric("1")
def yaw_rate_first_peak_ratio(waves: HalfWaves) -> Bounded:
    """Ratio of yaw rate to handwheel angle at the first peak, divided by that ratio at later peaks to the same side."""
    return waves.first_ratio(YAW)


@_sine_metric("g/100 deg")
def lateral_acceleration_sine_gain(waves: HalfWaves) -> np.ndarray:
    """Peak lateral acceleration divided by peak handwheel angle, for each half wave from the second cycle on."""
    return waves.settled(waves.peaks(AY)[1])


@_sine_metric("ms")
def lateral_acceleration_sine_lag(waves: HalfWaves) -> np.ndarray:
    """Time from the peak of the handwheel angle to that of the lateral acceleration.

    It is read for each half wave from the second cycle on.
    """
    return waves.settled(waves.peaks(AY)[0])


@_sine_metric("1")
def lateral_acceleration_first_peak_ratio(waves: HalfWaves) -> Bounded:
    """Ratio of lateral acceleration to handwheel angle at the first peak, divided by that ratio at later peaks.

    The later peaks are those to the same side.
    """
    return waves.first_ratio(AY)


@_sine_metric("deg", source="common use")
def lateral_acceleration_sine_hysteresis(waves: HalfWaves) -> np.ndarray:
    """Width in handwheel angle of the loop over lateral acceleration at 0 g: twice the angle at each zero crossing."""
    return 2.0 * waves.angle_at_zero(AY)


@_sine_metric("deg", source="common use")
def yaw_rate_sine_hysteresis(waves: HalfWaves) -> np.ndarray:
    """Width in handwheel angle of the loop over yaw rate at zero: twice the angle at each zero crossing."""
    return 2.0 * waves.angle_at_zero(YAW)


@_sine_metric("N m/deg", source="common use")
def torque_sine_gain(waves: HalfWaves) -> np.ndarray:
    """Peak handwheel torque divided by peak handwheel angle, for each half wave from the second cycle on."""
    return waves.settled(waves.peaks(TORQUE)[1])
