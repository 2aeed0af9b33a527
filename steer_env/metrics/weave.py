"""On-centre weave, after ISO 13674-1."""

from functools import partial

from steer_env.metrics.common.definitions import register_evaluation
from steer_env.metrics.common.loops import Loops
from steer_env.metrics.common.on_centre import PLOTS

register_evaluation("weave", partial(Loops, fewest=3), plots=PLOTS, steered=True, speed_m_s=100 / 3.6, frequency_hz=0.2)
