"""The car: tyre, strut, column, assist, chassis, and the plant that couples them."""

if __name__ != "steer_env.vehicle":
    raise ImportError("import this package as steer_env.vehicle; the bare name is no longer a package of its own")

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
