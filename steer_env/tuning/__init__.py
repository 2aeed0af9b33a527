"""Environments that tune the assist: one step tries one set of parameters."""

from steer_env.tuning.env import TuneEnv
from steer_env.tuning.ids import TuneAllRound, TuneOnCentre

__all__ = ["TuneAllRound", "TuneEnv", "TuneOnCentre"]
