"""What an external vehicle is: it takes the motion of the rack and gives the rack force and channels of its own."""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from steer_env.recording.channel_mapping import KNOWN
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST, HAND, HAND_SPEED, RACK_DISTURBANCE
from steer_env.vehicle.plant import CHANNEL, INPUTS
from steer_env.vehicle.subsystems.car import NAMED

Array = NDArray[np.float64]

# Inputs of the plant that a vehicle may take -> their names in the units that this project exports.
_STEERING = (HAND, HAND_SPEED, ASSIST_REQUEST, RACK_DISTURBANCE)  # inputs that the steering keeps
OF_PLANT = {name: NAMED[name][0] for i, (name, _) in enumerate(INPUTS) if i not in _STEERING}
RACK = ("rack_travel", "rack_speed")
START_SPEED = "start_speed"  # is set once, before the vehicle starts
# What a vehicle may take -> its unit.
VEHICLE_INPUT_UNITS = {
    **dict(zip(RACK, ("m", "m/s"))),
    **{name: unit for name, unit in INPUTS if name in OF_PLANT},
    START_SPEED: "m/s",
}
# What a vehicle may give -> its unit: every channel that is not of column and assist.
_RACK_FORCE = CHANNEL["rack_force"]
VEHICLE_OUTPUT_UNITS = {name: unit for name, unit in KNOWN.items() if CHANNEL.get(name, _RACK_FORCE) >= _RACK_FORCE}


class CouplingError(ValueError):
    """A run with an external vehicle cannot go on; the text names the vehicle, the time and the reason."""


class Vehicle(Protocol):
    """An external vehicle; values are in SI units, and a rack force is positive where it resists a left turn."""

    name: str
    takes: tuple[str, ...]  # of ``VEHICLE_INPUT_UNITS``, without the start speed
    gives: tuple[str, ...]  # of ``VEHICLE_OUTPUT_UNITS``; rack force and vehicle speed are among them
    meta: dict[str, Any]  # what it tells of itself, for recordings, as ``wheelbase_m``

    def start(self, speed: float) -> Array:
        """Begin anew in straight running, at a speed where the vehicle takes one [m/s]; what it gives (G,)."""

    def step(self, taken: Array, samples: int) -> Array:
        """Advance by a communication step of so many milliseconds; what it gives at the end (G,).

        ``taken`` (T,) are the motion of the rack at the end of the step, and the other inputs over it.
        """

    def close(self) -> None:
        """End the vehicle; it cannot be used afterwards."""
