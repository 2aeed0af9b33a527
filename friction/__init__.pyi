from . import level, models
from .identify import Fit, fit
from .law import Law, as_mapping, available, law_of, make, register, resolve
from .response import response

__all__ = [
    "Fit",
    "Law",
    "as_mapping",
    "available",
    "fit",
    "law_of",
    "level",
    "make",
    "models",
    "register",
    "resolve",
    "response",
]
