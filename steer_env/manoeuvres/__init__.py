"""Manoeuvres, one file each: the motion of the hands, defined once for the environments and for the test battery."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
