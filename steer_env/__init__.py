"""Gymnasium environments for steering feel; importing the package registers their ids and little more."""

import lazy_loader

from steer_env.registration import register

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

register()
