"""Gymnasium environments for steering feel; importing the package registers them."""

from steer_env.env import SteerEnv
from steer_env.ids import REGISTERED, register
from steer_env.vector import SteerVectorEnv

__all__ = ["REGISTERED", "SteerEnv", "SteerVectorEnv"]

register()
