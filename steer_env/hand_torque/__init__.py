"""The torque of the hands in a free drive, from handwheel angle and speed, with a friction law: ``identify``."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
