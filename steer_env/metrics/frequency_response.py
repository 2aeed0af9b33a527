"""Swept sine: frequency responses from whole sweeps of the handwheel."""

from functools import partial

from steer_env.metrics.common.frequency_response import register_frequency_response
from steer_env.metrics.common.spectra import STILL, Spectra, sweeps

register_frequency_response(
    "frequency-response",
    partial(
        Spectra,
        segments=sweeps,
        window="boxcar",
        fewest=3,
        shortage="sweeps with two seconds straight between: drive 3",
        still=STILL,
    ),
)
