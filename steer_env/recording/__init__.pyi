from . import column_balance, friction_record
from .channel_mapping import Mapping
from .files import read, write
from .recording import Recording

__all__ = ["Mapping", "Recording", "column_balance", "friction_record", "read", "write"]
