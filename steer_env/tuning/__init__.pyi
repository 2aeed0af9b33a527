from .env import TuneEnv
from .environments import TuneAllRound, TuneOnCentre
from .vector import TuneVectorEnv

__all__ = ["TuneAllRound", "TuneEnv", "TuneOnCentre", "TuneVectorEnv"]
