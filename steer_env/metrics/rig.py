"""Steering on a rig: the loop of torque over handwheel angle. The car stands, so its motion is not evaluated."""

from functools import partial

from steer_env.metrics.common.definitions import register_evaluation
from steer_env.metrics.common.loops import Loops
from steer_env.metrics.common.on_centre import PLOTS

register_evaluation("rig", partial(Loops, fewest=3), plots=PLOTS[:1], constant_speed=False, frequency_hz=0.2)
