"""Driver models, one file each."""

import lazy_loader

from steer_env.friction.numerics.renamed import renamed

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
_OLD_NAMES = {
    "Crew": "steer_env.drivers:DriverBatch",
    "gripped": "steer_env.drivers:with_arms",
    "register_eyes": "steer_env.drivers:register_preview_model",
}
__getattr__ = renamed(__name__, _OLD_NAMES, __getattr__)
