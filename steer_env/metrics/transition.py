"""Transition: how the car leaves straight ahead when the handwheel turns slowly, to both sides.

Every ramp of the handwheel out of straight ahead is a repeat. Slopes are those of straight lines fitted over a fixed
range of lateral acceleration: near centre from 0.1 to 0.5 m/s2, at 1 m/s2 from 0.75 to 1.25 m/s2. A dead band is the
handwheel angle or torque at which the line near centre, extended to smaller values, reaches a response of zero; it is
half of the width in which angle or torque change without a response of the car. Zero is the zero of the sensor, so
ramps to both sides are needed in equal numbers; an offset then drops out. The ramps are found in the handwheel angle
less its reading in straight running before the first ramp, since an offset would move where they begin.
"""

from collections.abc import Mapping
from functools import partial
from operator import methodcaller
from typing import Any

import numpy as np

from steer_env.metrics.common import ramps, straight
from steer_env.metrics.common.definitions import RefusedError, declare, metric, register_evaluation
from steer_env.metrics.common.filtered_channels import ANGLE, AY, TORQUE, YAW, FilteredChannels
from steer_env.metrics.common.kept import kept
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle.constants import GRAVITY as G

CUTOFF = 2.0  # low-pass; the test is quasi-static [Hz]
CENTRE, AT_1 = (0.1, 0.5), (0.75, 1.25)  # ranges of lateral acceleration of the fits; assumed [m/s2]
QUICKEST = 5 * DEGREE  # highest handwheel speed of a ramp [rad/s]
SOURCE = "after ISO 13674-2"


class Transitions:
    """The ramps out of straight ahead; the methods return one value for each ramp, (n,)."""

    def __init__(self, recording: Recording, conditions: Mapping[str, Any]) -> None:
        self._smooth = FilteredChannels(recording, CUTOFF)
        try:
            zero = straight.zeros(recording)[ANGLE]
        except RefusedError:  # told in the notes
            zero = 0.0
        angle = self._smooth[ANGLE] - zero
        self.ramps = ramps.find(self._smooth.time, angle)
        sides = [ramp.side for ramp in self.ramps]
        if not sides or sides.count(1.0) != sides.count(-1.0):
            raise RefusedError(
                f"{sides.count(1.0)} ramps of {ANGLE} to the left and {sides.count(-1.0)} to the right: "
                "steer equally often to both sides, so that an offset drops out"
            )
        ends = [[self._smooth[AY][r.end - 1] for r in self.ramps if r.side == side] for side in (1.0, -1.0)]
        # The sensor's zero of the lateral acceleration, midway between its values at the ends of both sides.
        self._centre = float(np.mean(ends))
        for ramp in self.ramps:
            turned, took = np.ptp(angle[ramp.start : ramp.end]), np.ptp(self._smooth.time[ramp.start : ramp.end])
            if turned > 1.02 * QUICKEST * took:
                raise RefusedError(
                    f"{ANGLE} turns by {turned / took / DEGREE:.1f} deg/s: steer at {QUICKEST / DEGREE:.0f} or less"
                )

    def notes(self) -> list[str]:
        """What was found out about the sensors, in sentences."""
        return straight.notes(self._smooth.recording)

    @kept
    def line(self, y: str, x: str, level: tuple[float, float]) -> np.ndarray:
        """Offset and slope (n, 2) of y over x while the lateral acceleration is in a range [SI].

        Both channels count positive towards the side of the ramp.
        """
        found = []
        for ramp in self.ramps:
            # A dead band may begin before the handwheel is seen to move, but the response comes after it.
            band = ramps.rising_section(ramp.side * (self._smooth[AY][ramp.start : ramp.end] - self._centre), *level)
            if band is None:
                raise RefusedError(
                    f"lateral_acceleration does not go from {level[0]:g} to {level[1]:g} m/s2 in every ramp: "
                    "steer further, and slowly; check the signs, a left turn is positive"
                )
            u, v = (ramp.side * self._smooth[name][ramp.start : ramp.end][band] for name in (x, y))
            slope, offset = np.polyfit(u, v, 1)
            found.append((offset, slope))
        if np.mean(found, axis=0)[1] <= 0:
            raise RefusedError(f"{y} does not rise with {x}: check the signs, a left turn is positive in both")
        return np.array(found)

    def zero(self, response: str, hand: str) -> np.ndarray:
        """Handwheel angle or torque (n,) at which the line near centre, extended, gives a response of zero."""
        if hand == TORQUE:  # the noisier channel is fitted over the other
            return self.line(hand, response, CENTRE)[:, 0]
        offset, slope = self.line(response, hand, CENTRE).T
        return -offset / slope

    def slope(self, y: str, x: str, level: tuple[float, float]) -> np.ndarray:
        """Slope (n,) of y over x."""
        return self.line(y, x, level)[:, 1]

    def at_1(self, name: str) -> np.ndarray:
        """Value of a channel (n,) at 1 m/s2, on the line over the lateral acceleration."""
        offset, slope = self.line(name, AY, AT_1).T
        return offset + slope

    @kept
    def peak_acceleration(self) -> float:
        """Mean over the ramps of the highest lateral acceleration [g]."""
        return float(np.mean([np.abs(self._smooth[AY][ramp.start : ramp.end]).max() for ramp in self.ramps])) / G


register_evaluation("transition", Transitions, steered=True, speed_m_s=100 / 3.6)


VALID = (0.05, 0.35)  # peak lateral acceleration [g]
_transition_metric = partial(metric, validity=VALID, source=SOURCE)


def _deadbands(quantity: str, unit: str, channel: str, definition: str) -> None:
    """Declare the dead bands of what the hands hold, each at one response of the car."""
    for response in (YAW, AY):
        name = f"{response}_transition_{quantity}_deadband"
        text = definition.format(response.replace("_", " "))
        declare(name, unit, text, methodcaller("zero", response, channel), "transition", validity=VALID, source=SOURCE)


_deadbands("angle", "deg", ANGLE, "Handwheel angle at which the line of the {} near centre starts from zero.")
_deadbands("torque", "N m", TORQUE, "Handwheel torque on the line over the {0} near centre, at a {0} of zero.")


@_transition_metric("N m/g", "transition")
def transition_torque_gradient_near_centre(transitions: Transitions) -> np.ndarray:
    """Slope of the torque over the lateral acceleration from 0.1 to 0.5 m/s2."""
    return transitions.slope(TORQUE, AY, CENTRE)


@_transition_metric("N m/g", "transition")
def transition_torque_gradient_at_1m_s2(transitions: Transitions) -> np.ndarray:
    """Slope of the torque over the lateral acceleration from 0.75 to 1.25 m/s2."""
    return transitions.slope(TORQUE, AY, AT_1)


@_transition_metric("N m", "transition")
def transition_torque_at_1m_s2(transitions: Transitions) -> np.ndarray:
    """Handwheel torque at a lateral acceleration of 1 m/s2, on the line fitted there."""
    return transitions.at_1(TORQUE)


@_transition_metric("g/100 deg", "transition")
def transition_sensitivity_near_centre(transitions: Transitions) -> np.ndarray:
    """Slope of the lateral acceleration over the handwheel angle from 0.1 to 0.5 m/s2."""
    return transitions.slope(AY, ANGLE, CENTRE)


@_transition_metric("g/100 deg", "transition")
def transition_sensitivity_at_1m_s2(transitions: Transitions) -> np.ndarray:
    """Slope of the lateral acceleration over the handwheel angle from 0.75 to 1.25 m/s2."""
    return transitions.slope(AY, ANGLE, AT_1)


@_transition_metric("1/s", "transition")
def transition_yaw_rate_gain(transitions: Transitions) -> np.ndarray:
    """Slope of the yaw rate over the handwheel angle while the lateral acceleration rises from 0.1 to 0.5 m/s2."""
    return transitions.slope(YAW, ANGLE, CENTRE)
