from .haptics import Wheel, stability
from .loop import RealTime
from .mailbox import Mailboxes
from .safety import Limits
from .sets import CarSet, CarSets

__all__ = ["CarSet", "CarSets", "Limits", "Mailboxes", "RealTime", "Wheel", "stability"]
