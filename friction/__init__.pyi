from . import level, models
from .identification.fit import Fit, fit
from .identification.record import Record
from .law import Law, as_mapping, available, law_of, make, register, resolve
from .response import response

__all__ = [
    "Fit",
    "Law",
    "Record",
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
