from .common.commands import COMMANDS
from .common.device import Device, DeviceError, Reading, available, make, options, register

__all__ = ["COMMANDS", "Device", "DeviceError", "Reading", "available", "make", "options", "register"]
