"""From the name of an external vehicle to a steering that is coupled to it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from steer_env.connect.external.coupled import Coupled, Coupling
from steer_env.connect.external.fmu_vehicle import FmuVehicle
from steer_env.connect.external.mapping import read
from steer_env.connect.external.own_process import OwnProcess
from steer_env.connect.external.vehicle import Vehicle


@contextmanager
def opened(chassis: str | Path, speed: float, coupling: Coupling | None = None) -> Iterator[Coupled]:
    """Our steering with an external vehicle, which is closed at the end.

    Parameters
    ----------
    chassis : str or path
        A unit (``.fmu``) or a mapping (``.toml``), as :class:`steer_env.connect.external.fmu_vehicle.FmuVehicle` takes
        it.
    speed : float
        At which the vehicle shall start [m/s].
    coupling : Coupling, optional
        By default the communication step of the mapping, without a delay.

    Raises
    ------
    ValueError
        As :class:`steer_env.connect.external.fmu_vehicle.FmuVehicle`.
    """
    mapping = read(chassis) if Path(chassis).suffix == ".toml" else None
    vehicle: Vehicle = OwnProcess(chassis) if mapping and mapping.own_process else FmuVehicle(chassis)
    try:
        yield Coupled(vehicle, speed, coupling or Coupling(mapping.step if mapping else 1), str(chassis))
    finally:
        vehicle.close()
