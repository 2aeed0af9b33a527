from .env import TuneEnv
from .environments import TuneAllRound, TuneOnCentre

__all__ = ["TuneAllRound", "TuneEnv", "TuneOnCentre"]
