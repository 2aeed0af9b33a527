from .coupled import Coupled, Coupling, opened
from .fmu_vehicle import FmuVehicle
from .own_process import OwnProcess
from .udp_vehicle import UdpVehicle
from .vehicle import CouplingError, Vehicle

__all__ = ["Coupled", "Coupling", "CouplingError", "FmuVehicle", "OwnProcess", "UdpVehicle", "Vehicle", "opened"]
