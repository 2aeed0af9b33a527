"""Gymnasium environments for steering feel; importing the package registers their ids and little more."""

from importlib import metadata
from typing import Any

import lazy_loader

from steer_env.friction.numerics.renamed import renamed
from steer_env.registration import register

_lazy, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
_OLD_NAMES = {
    "bands": "steer_env.targets",
    "canvas": "steer_env.rendering.canvas",
    "ids": "steer_env.registration",
    "lane_change": "steer_env.courses.iso3888",
    "lanes": "steer_env.batch",
    "mapping": "steer_env.recording.channel_mapping",
    "path": "steer_env.courses.path",
    "recording_files": "steer_env.recording.files",
    "render": "steer_env.rendering.renderer",
    "units": "steer_env.recording.units",
}


def _attribute(name: str) -> Any:
    """The version, which only an installed package has, or what the stub names."""
    return metadata.version("steer-env") if name == "__version__" else _lazy(name)


__getattr__ = renamed(__name__, _OLD_NAMES, _attribute)

register()
