from . import level, models, records
from .identification.compare import Compared, compare
from .identification.fit import Fit, fit
from .identification.record import Record
from .law import Law, available, law_of, make, register
from .mujoco import JointFriction
from .response import response
from .sites import as_mapping, resolve, varied

__all__ = [
    "Compared",
    "Fit",
    "JointFriction",
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
    "varied",
]
