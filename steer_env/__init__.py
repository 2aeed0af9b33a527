"""Gymnasium environments for steering feel; importing the package registers them."""

from steer_env.ids import REGISTERED, register

__all__ = ["REGISTERED"]

register()
