"""What runs the plants of a manoeuvre: this project's own kernels, or its steering with an external vehicle."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from steer_env.connect import external as coupling
from steer_env.connect.external.vehicle import OF_PLANT
from steer_env.manoeuvres.common.definition import Manoeuvre
from steer_env.vehicle import chassis, plant
from steer_env.vehicle.chassis.common.interface import COAST, Names

Array = NDArray[np.float64]


class Simulator(Protocol):
    """The functions of :mod:`steer_env.vehicle.plant` that drive a manoeuvre; that module is one itself."""

    def channels(self, p: plant.Plant) -> Names:
        """Names and units of the channels."""

    def settled(self, p: plant.Plant) -> tuple[Array, Array]:
        """State (S,) and channels (C,) of straight running."""

    @property
    def run(self) -> Any:
        """``(p, state, inputs, record, substeps) -> bool``."""


OWN: Any = plant  # the simulator of manoeuvres without an external vehicle


@contextmanager
def simulator_of(manoeuvre: Manoeuvre) -> Iterator[Simulator]:
    """The simulator of a manoeuvre.

    Raises
    ------
    ValueError
        An external vehicle cannot be used, or lacks an input or a channel that the manoeuvre itself needs.
    """
    if not chassis.is_external(manoeuvre.chassis):
        yield OWN
        return
    with coupling.opened(manoeuvre.chassis, manoeuvre.speed) as coupled:
        _require(manoeuvre, coupled.vehicle)
        yield coupled


def require_vehicle(manoeuvre: Manoeuvre, simulator: Simulator) -> None:
    """ValueError where a manoeuvre with an external vehicle would run without it."""
    if simulator is OWN and chassis.is_external(manoeuvre.chassis):
        raise ValueError(f"{manoeuvre.chassis} is an external vehicle: drive it by manoeuvres.drive")


def given(names: Names, record: Array) -> list[int]:
    """Positions of the channels that a record (T, C) holds: those that an external vehicle does not give are NaN."""
    first = np.isnan(record[0])  # most channels are given, and are not looked at any further
    return [i for i in range(len(names)) if not (first[i] and np.isnan(record[:, i]).all())]


def about_vehicle(simulator: Simulator) -> dict[str, Any]:
    """What the recording of an external vehicle tells in place of tyre and geometry of this project's car."""
    if not isinstance(simulator, coupling.Coupled):
        return {}
    vehicle = simulator.vehicle
    return {"tyre": f"that of {vehicle.name}", **vehicle.meta}


def _require(manoeuvre: Manoeuvre, vehicle: coupling.Vehicle) -> None:
    inputs = [*manoeuvre.others, *([COAST] if manoeuvre.coasts_from is not None else [])]
    for name in (plant.INPUTS[i][0] for i in inputs):
        if name in OF_PLANT and name not in vehicle.takes:
            raise ValueError(f"{manoeuvre.name} needs the input {name}, which {vehicle.name} does not take")
    channels = ["x"] if manoeuvre.ends_at is not None or manoeuvre.coasts_from is not None else []
    if manoeuvre.driver is None and manoeuvre.amplitude is None and not manoeuvre.lock:
        channels.append("lateral_acceleration")
    for name in channels:
        if name not in vehicle.gives:
            raise ValueError(f"{manoeuvre.name} needs the channel {name}, which {vehicle.name} does not give")
