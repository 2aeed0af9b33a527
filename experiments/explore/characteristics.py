"""The characteristics of a friction law that the page shows: the displacements along which its torque follows.

The law alone is followed, as :func:`steer_env.friction.response` does, by the function ``steer_friction`` of the module
that also advances the car.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.experiments.explore.module import SAMPLES

Array = NDArray[np.float64]

# A loop in which the law slides, with a small loop inside it, in which it hardly does; assumed [rad].
TURNS = (0.0, 0.05, -0.05, 0.0, -0.006, 0.05)
PACE = 0.1  # speed in the loop; assumed [rad/s]
SPEEDS = 2.0 * (np.arange(-15.0, 16.0, 2.0) / 15.0) ** 3  # of steady sliding, closest where small; assumed [rad/s]
SLIDE = 0.2  # displacement after which sliding is steady; assumed [rad]


def loop() -> tuple[Array, float]:
    """Displacements (SAMPLES,) through the turning points [rad], and the time between them [s]."""
    way = np.append(0.0, np.cumsum(np.abs(np.diff(TURNS))))
    return np.interp(np.linspace(0.0, way[-1], SAMPLES), way, TURNS), float(way[-1] / (SAMPLES - 1) / PACE)


def slide(speed: float) -> tuple[Array, float]:
    """Displacements (SAMPLES,) of steady sliding [rad], and the time between them at a speed [rad/s] [s]."""
    return np.linspace(0.0, np.copysign(SLIDE, speed), SAMPLES), float(SLIDE / (SAMPLES - 1) / abs(speed))


def declared() -> dict[str, Any]:
    """What the page knows of them."""
    x, step = loop()
    return {
        "loop": {"x": x.tolist(), "step": step},
        "speeds": SPEEDS.tolist(),
        "slide": slide(1.0)[0].tolist(),
        "steps": [slide(speed)[1] for speed in SPEEDS],
    }
