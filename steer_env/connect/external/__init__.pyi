from .coupled import Coupled, Coupling, opened
from .fmu_vehicle import FmuVehicle
from .udp_vehicle import UdpVehicle
from .vehicle import CouplingError, Vehicle

__all__ = ["Coupled", "Coupling", "CouplingError", "FmuVehicle", "UdpVehicle", "Vehicle", "opened"]
