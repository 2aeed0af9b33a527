"""Our steering coupled to an external vehicle, such as an FMU: the car is split at the rack."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
