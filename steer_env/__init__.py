"""Gymnasium environments for steering feel; importing the package registers them."""

from steer_env.env import SteerEnv
from steer_env.ids import REGISTERED, register

__all__ = ["REGISTERED", "SteerEnv"]

register()
