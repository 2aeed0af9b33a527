"""Channels of a recording as the metrics use them: with checked units, and low-passed without a phase shift."""

import numpy as np
from numpy.typing import NDArray

from steer_env.metrics.common.definitions import RefusedError
from steer_env.metrics.common.kept import kept
from steer_env.recording.recording import Recording, low_passed
from steer_env.recording.units import COUNTS
from steer_env.vehicle import plant

ANGLE, TORQUE, AY = "handwheel_angle", "handwheel_torque", "lateral_acceleration"
YAW, SPEED, SIDESLIP, ROLL = "yaw_rate", "vehicle_speed", "sideslip_angle", "roll_angle"
CHANNELS = {**dict(plant.CHANNELS), SPEED: "m/s", SIDESLIP: "rad"}  # name -> unit

# A channel whose size exceeds its limit is in another unit than it says (degrees for radians, km/h for m/s).
PLAUSIBLE = {ANGLE: 20.0, TORQUE: 100.0, AY: 30.0, YAW: 5.0, SPEED: 120.0}  # assumed [SI]


class DoubleFiltered(Recording):
    """A recording to which every low-pass is applied twice; the change of a metric shows what the low-pass does."""


@kept
def checked(recording: Recording, name: str) -> NDArray[np.float64]:
    """A channel before the low-pass; refused if it is missing, has another unit, or exceeds its limit."""
    unit = recording.units.get(name)
    if unit is None:
        raise RefusedError(
            f"the recording has no channel {name!r}: record it, or map it from the name that it has in the file "
            "(steer-env evaluate FILE --template map.toml guesses a mapping)"
        )
    if unit != CHANNELS[name]:
        if unit == COUNTS:
            told = f"give the {CHANNELS[name]} of a count, as scale in the mapping with that unit"
            raise RefusedError(f"{name} is in counts of its sensor, uncalibrated: {told}")
        raise RefusedError(f"{name} is in {unit!r}: give it in {CHANNELS[name]!r}")
    values = recording[name]
    most, limit = np.max(np.abs(values), where=np.isfinite(values), initial=0.0), PLAUSIBLE.get(name, np.inf)
    if most > limit:
        raise RefusedError(
            f"{name} reaches {most:.4g} {unit}, which is beyond {limit:g}: check the unit that it is given in"
        )
    return values


@kept
def filtered_once(recording: Recording, name: str, cutoff: float) -> NDArray[np.float64]:
    """A channel (T,) after one low-pass [Hz], kept with the recording, which several readings share; not to be changed.

    The arguments and errors are those of :meth:`Recording.filtered`.
    """
    return low_passed(name, recording[name], cutoff, recording.rate)


class FilteredChannels:
    """Channels (T,) of a recording by name, low-passed at ``cutoff`` [Hz], with their ``time`` (T,) [s].

    A channel that is missing or has another unit refuses the metrics that use it. The low-pass is applied ``passes``
    times: twice to a :class:`DoubleFiltered` recording, once to any other.
    """

    def __init__(self, recording: Recording, cutoff: float) -> None:
        self.time, self.recording = recording.time, recording
        self.passes = 2 if isinstance(recording, DoubleFiltered) else 1
        self._cutoff = cutoff

    @kept
    def _smooth(self, name: str) -> NDArray[np.float64]:
        checked(self.recording, name)
        values = filtered_once(self.recording, name, self._cutoff)
        for _ in range(1, self.passes):
            values = low_passed(name, values, self._cutoff, self.recording.rate)
        return values

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        try:
            return self._smooth(name)
        except ValueError as error:  # a channel that cannot be filtered refuses its own metrics only
            raise RefusedError(str(error)) from None

    @kept
    def sideslip(self) -> NDArray[np.float64]:
        """Sideslip angle (T,), as recorded or from lateral and forward speed [rad]."""
        return self[SIDESLIP] if SIDESLIP in self else np.arctan2(self["lateral_speed"], self[SPEED])

    def __contains__(self, name: str) -> bool:
        return name in self.recording.units
