"""Other programs: the car as an FMU or over UDP, and foreign vehicles behind the project's own steering."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
