"""Devices by which a person drives: one file each, between a Python thread and the mailboxes of the loop."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
