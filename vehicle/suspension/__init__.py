"""The MacPherson strut: solved from its hard points, and as a table for simulation."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
