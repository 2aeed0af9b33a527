"""Friction laws behind one interface: ``available``, ``make``, ``response``, ``fit``."""

from friction import models
from friction.identify import Fit, fit
from friction.law import Law, available, law_of, make, register, resolve
from friction.response import response

__all__ = ["Fit", "Law", "available", "fit", "law_of", "make", "models", "register", "resolve", "response"]
