"""Chassis models, one file or folder each; the class of the parameters selects the model."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
