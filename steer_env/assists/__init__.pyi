from .common.definition import Baseline, available, make, register

__all__ = ["Baseline", "available", "make", "register"]
