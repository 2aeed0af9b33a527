"""What the page shows besides a manoeuvre: the friction law alone, and the response to sines of the handwheel.

The law alone is followed, as :func:`steer_env.friction.response` does, by the function ``steer_friction`` of the module
that also advances the car. The responses are those of :func:`steer_env.manoeuvres.common.driving.sine_response`.
"""

from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.experiments.explore.drives import pieces
from steer_env.experiments.explore.module import SAMPLES
from steer_env.manoeuvres.common.driving import HOLD, sine_hands
from steer_env.recording.recording import DEGREE
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]

# A loop in which the law slides, with a small loop inside it, in which it hardly does; assumed [rad].
LOOP_TURNS = (0.0, 0.05, -0.05, 0.0, -0.006, 0.05)
PACE = 0.1  # speed in the loop; assumed [rad/s]
SPEEDS = 2.0 * (np.arange(-15.0, 16.0, 2.0) / 15.0) ** 3  # of steady sliding, closest where small; assumed [rad/s]
SLIDE = 0.2  # displacement after which sliding is steady; assumed [rad]

# Of the sines of the handwheel; assumed.
FREQUENCIES = (0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.25, 1.6, 2.0, 2.5, 3.2, 4.0)  # [Hz]
AMPLITUDE = 5.0 * DEGREE  # [rad]
PERIODS = 3  # of each sine, the last of which is read


def loop() -> tuple[Array, float]:
    """Displacements (SAMPLES,) through the turning points [rad], and the time between them [s]."""
    way = np.append(0.0, np.cumsum(np.abs(np.diff(LOOP_TURNS))))
    return np.interp(np.linspace(0.0, way[-1], SAMPLES), way, LOOP_TURNS), float(way[-1] / (SAMPLES - 1) / PACE)


def slide(speed: float) -> tuple[Array, float]:
    """Displacements (SAMPLES,) of steady sliding [rad], and the time between them at a speed [rad/s] [s]."""
    return np.linspace(0.0, np.copysign(SLIDE, speed), SAMPLES), float(SLIDE / (SAMPLES - 1) / abs(speed))


@cache
def _sines() -> list[dict[str, Any]]:
    """The hands of each sine, as the courses of :mod:`steer_env.experiments.explore.drives`."""
    found = []
    for frequency in FREQUENCIES:
        samples = PERIODS * HOLD * round(1.0 / (frequency * SAMPLE_TIME * HOLD))
        hand = partial(sine_hands, frequency=frequency)
        course = {"pieces": list(pieces(hand, samples)), "samples": samples, "released": [], "fewest": 0}
        found.append(course | {"frequency": frequency})
    return found


def declared() -> dict[str, Any]:
    """What the page knows of them."""
    x, step = loop()
    return {
        "loop": {"x": x.tolist(), "step": step},
        "speeds": SPEEDS.tolist(),
        "slide": slide(1.0)[0].tolist(),
        "steps": [slide(speed)[1] for speed in SPEEDS],
        "sines": _sines(),
        "amplitude": AMPLITUDE,
        "periods": PERIODS,
        "hold": HOLD,
    }
