from . import devices, drive, real_time, telemetry

__all__ = ["devices", "drive", "real_time", "telemetry"]
