from . import external, fmu, udp

__all__ = ["external", "fmu", "udp"]
