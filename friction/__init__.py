"""Friction laws behind one interface: ``available``, ``make``, ``response``."""

from friction import models
from friction.law import Law, available, law_of, make, register, resolve
from friction.response import response

__all__ = ["Law", "available", "law_of", "make", "models", "register", "resolve", "response"]
