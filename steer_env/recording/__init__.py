"""Recordings, simulated or measured: channels in SI units over time, their files, units and channel mappings."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
