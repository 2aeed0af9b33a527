from .channel_mapping import Mapping
from .files import read, write
from .recording import Recording

__all__ = ["Mapping", "Recording", "read", "write"]
