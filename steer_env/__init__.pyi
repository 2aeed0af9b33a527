from . import (
    assists,
    drivers,
    experiments,
    fmu,
    friction,
    manoeuvres,
    metrics,
    recording,
    targets,
    tasks,
    tuning,
    vehicle,
)
from .env import SteerEnv
from .registration import REGISTERED
from .vector import SteerVectorEnv

__version__: str

__all__ = [
    "REGISTERED",
    "SteerEnv",
    "SteerVectorEnv",
    "assists",
    "drivers",
    "experiments",
    "fmu",
    "friction",
    "manoeuvres",
    "metrics",
    "recording",
    "targets",
    "tasks",
    "tuning",
    "vehicle",
]
