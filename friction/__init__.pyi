from . import level, models, records
from .identification.compare import Compared, compare
from .identification.fit import Fit, fit
from .identification.record import Record
from .law import Law, as_mapping, available, law_of, make, register, resolve
from .response import response

__all__ = [
    "Compared",
    "Fit",
    "Law",
    "Record",
    "as_mapping",
    "available",
    "compare",
    "fit",
    "law_of",
    "level",
    "make",
    "models",
    "records",
    "register",
    "resolve",
    "response",
]
