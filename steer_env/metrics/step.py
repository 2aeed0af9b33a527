"""Step steer: how yaw rate and lateral acceleration answer, timed from where the handwheel has turned half its way."""

from collections.abc import Mapping
from typing import Any

import control
import numpy as np

from steer_env.metrics.definitions import metric, procedure
from steer_env.metrics.reading import ANGLE, AY, YAW, Reading
from steer_env.recording import Recording

CUTOFF = 25.0  # low-pass [Hz]
SOURCE = "after ISO 7401"


class Step:
    """Responses to one step of the handwheel; steady is the mean of the last second."""

    def __init__(self, recording: Recording, asked: Mapping[str, Any]) -> None:
        self._smooth = Reading(recording, CUTOFF)
        angle = self._smooth[ANGLE]
        self.time, self.last = self._smooth.time, self._smooth.time > self._smooth.time[-1] - 1.0
        self.angle = float(angle[self.last].mean())
        self.start = float(self.time[np.argmax(np.abs(angle) >= 0.5 * abs(self.angle))])

    def response(self, name: str) -> np.ndarray:
        """A channel, positive in the direction of the step."""
        return self._smooth[name] * np.sign(self.angle)

    def steady(self, name: str) -> float:
        """Its steady value."""
        return float(self.response(name)[self.last].mean())

    def gain(self, name: str) -> float:
        """Steady value over steady handwheel angle."""
        return self.steady(name) / abs(self.angle)

    def time_to_90(self, name: str) -> float:
        """From half of the handwheel angle to nine tenths of the steady value [s]."""
        return float(self.time[np.argmax(self.response(name) >= 0.9 * self.steady(name))]) - self.start

    def info(self, name: str) -> dict[str, float]:
        """Measures of python-control."""
        return control.step_info(self.response(name), T=self.time, yfinal=self.steady(name), SettlingTimeThreshold=0.05)


procedure("step-steer", Step, speed_m_s=80 / 3.6)


@metric("1/s", "step-steer", source=SOURCE)
def yaw_rate_step_gain(step: Step) -> float:
    """Steady yaw rate over steady handwheel angle."""
    return step.gain(YAW)


@metric("s", "step-steer", source=SOURCE)
def yaw_rate_time_to_90(step: Step) -> float:
    """Time from half of the handwheel angle to 90 % of the steady yaw rate."""
    return step.time_to_90(YAW)


@metric("s", "step-steer", source=SOURCE)
def yaw_rate_peak_time(step: Step) -> float:
    """Time from half of the handwheel angle to the highest yaw rate."""
    return step.info(YAW)["PeakTime"] - step.start


@metric("1", "step-steer", source=SOURCE)
def yaw_rate_overshoot(step: Step) -> float:
    """Highest over steady yaw rate, less one."""
    return step.info(YAW)["Overshoot"] / 100.0


@metric("g/100 deg", "step-steer", source=SOURCE)
def lateral_acceleration_step_gain(step: Step) -> float:
    """Steady lateral acceleration over steady handwheel angle."""
    return step.gain(AY)


@metric("s", "step-steer", source=SOURCE)
def lateral_acceleration_time_to_90(step: Step) -> float:
    """Time from half of the handwheel angle to 90 % of the steady lateral acceleration."""
    return step.time_to_90(AY)


@metric("s", "step-steer", source=SOURCE)
def lateral_acceleration_peak_time(step: Step) -> float:
    """Time from half of the handwheel angle to the highest lateral acceleration."""
    return step.info(AY)["PeakTime"] - step.start


@metric("1", "step-steer", source=SOURCE)
def lateral_acceleration_overshoot(step: Step) -> float:
    """Highest over steady lateral acceleration, less one."""
    return step.info(AY)["Overshoot"] / 100.0
