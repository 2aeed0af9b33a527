from .drive import Drive, prepared
from .fit import Identified, identify
from .model import Model, Prior, predict

__all__ = ["Drive", "Identified", "Model", "Prior", "identify", "predict", "prepared"]
