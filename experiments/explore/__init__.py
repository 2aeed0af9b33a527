"""The page in which a car is changed by sliders: WebAssembly modules of the kernels, declarations, and scripts."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
