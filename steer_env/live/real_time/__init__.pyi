from .configurations import CarConfiguration, CarConfigurations
from .haptics import Wheel, stability
from .loop import RealTime
from .mailbox import Mailboxes
from .safety import Limits

__all__ = ["CarConfiguration", "CarConfigurations", "Limits", "Mailboxes", "RealTime", "Wheel", "stability"]
