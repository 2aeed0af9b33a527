"""Steady circle at a constant speed, after ISO 4138."""

from functools import partial

from steer_env.metrics.common.definitions import register_evaluation
from steer_env.metrics.common.steady_circle import Circles

register_evaluation(
    "steady-circle-speed",
    partial(Circles, constant="speed"),
    steered=True,
    speed_m_s=80 / 3.6,
    wheelbase_m=None,
    steering_ratio=None,
)
