"""Sweeps: the same function on many cases, in this process, in processes of this machine, or on a Dask cluster."""

from steer_env.experiments.sweep.store import Store
from steer_env.experiments.sweep.sweep import Runner, run
from steer_env.experiments.sweep.where import SERIAL, Where
from steer_env.experiments.sweep.work import LostError

__all__ = ["SERIAL", "LostError", "Runner", "Store", "Where", "run"]
