"""Real time: the loop with its limits and watchdog, devices to steer with, and the drive at the wheel."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
