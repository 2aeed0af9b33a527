"""Slow ramp: the on-centre loops without the lag of the car.

The widths of the loops are caused by friction; in a weave at 0.2 Hz they need not be.
"""

from functools import partial

from steer_env.metrics.common.definitions import register_evaluation
from steer_env.metrics.common.loops import Loops
from steer_env.metrics.common.on_centre import PLOTS

# Two cycles are enough, with a wide interval.
register_evaluation(
    "slow-ramp", partial(Loops, fewest=2), plots=PLOTS, steered=True, speed_m_s=50 / 3.6, frequency_hz=0.02
)
