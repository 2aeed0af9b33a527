"""The plant in real time: a compiled loop at 1 kHz, its devices, and what keeps a motor from running away."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
