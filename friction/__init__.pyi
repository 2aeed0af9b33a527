from . import models
from .identify import Fit, fit
from .law import Law, available, law_of, make, register, resolve
from .response import response

__all__ = ["Fit", "Law", "available", "fit", "law_of", "make", "models", "register", "resolve", "response"]
