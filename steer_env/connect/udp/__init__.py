"""Co-simulation over UDP: a subsystem of the plant behind a port, for tools that speak no FMI."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
