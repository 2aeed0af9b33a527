from .haptics import Wheel, stability
from .loop import RealTime
from .mailbox import Mailboxes
from .safety import Limits

__all__ = ["Limits", "Mailboxes", "RealTime", "Wheel", "stability"]
