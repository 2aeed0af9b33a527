"""Gymnasium environments for steering feel; importing the package registers their ids and little more."""

from importlib import metadata
from typing import Any

import lazy_loader

from steer_env.registration import register

_lazy, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """The version, which only an installed package has, or what the stub names."""
    return metadata.version("steer-env") if name == "__version__" else _lazy(name)


register()
