from . import devices, drive, real_time

__all__ = ["devices", "drive", "real_time"]
