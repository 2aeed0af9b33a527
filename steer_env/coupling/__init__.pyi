from .coupled import Coupled, Coupling
from .opening import opened
from .vehicle import CouplingError, Vehicle

__all__ = ["Coupled", "Coupling", "CouplingError", "Vehicle", "opened"]
