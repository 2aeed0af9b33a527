"""Steady circle at a constant radius, after ISO 4138."""

from functools import partial

from steer_env.metrics.common.definitions import register_evaluation
from steer_env.metrics.common.steady_circle import Circles

register_evaluation(
    "steady-circle",
    partial(Circles, constant="radius"),
    constant_speed=False,
    radius_m=100.0,
    wheelbase_m=None,
    steering_ratio=None,
)
