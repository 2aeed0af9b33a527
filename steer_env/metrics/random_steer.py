"""Random steering: frequency responses from overlapping segments."""

from functools import partial

from steer_env.metrics.common.frequency_response import register_frequency_response
from steer_env.metrics.common.spectra import Spectra, welch

register_frequency_response(
    "random-steer",
    partial(
        Spectra,
        segments=welch,
        window="hann",
        fewest=8,
        shortage="segments of 25 s, half overlapping: record 113 s",
        together=2,
    ),
)
