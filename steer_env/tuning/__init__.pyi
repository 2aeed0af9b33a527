from .env import TuneEnv
from .registration import TuneAllRound, TuneOnCentre

__all__ = ["TuneAllRound", "TuneEnv", "TuneOnCentre"]
