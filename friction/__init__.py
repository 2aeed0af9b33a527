"""Friction laws behind one interface: ``available``, ``make``, ``response``, ``fit``."""

if __name__ != "steer_env.friction":
    raise ImportError("import this package as steer_env.friction; the bare name is no longer a package of its own")

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
