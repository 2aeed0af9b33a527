from . import (
    assists,
    connect,
    drivers,
    experiments,
    friction,
    hand_torque,
    live,
    manoeuvres,
    metrics,
    recording,
    targets,
    tasks,
    tuning,
    vehicle,
)
from .engine.row_wrapper import RowWrapper
from .env import SteerEnv
from .experiments.calibration.population import population
from .hand_torque import identify
from .registration import REGISTERED
from .vector import SteerVectorEnv

__version__: str

__all__ = [
    "REGISTERED",
    "RowWrapper",
    "SteerEnv",
    "SteerVectorEnv",
    "assists",
    "connect",
    "drivers",
    "experiments",
    "friction",
    "hand_torque",
    "identify",
    "live",
    "manoeuvres",
    "metrics",
    "population",
    "recording",
    "targets",
    "tasks",
    "tuning",
    "vehicle",
]
