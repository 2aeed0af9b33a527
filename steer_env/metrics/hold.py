"""Held torque: what still moves while the hands pull with a constant torque."""

import numpy as np

from steer_env.metrics.definitions import RefusedError, metric, procedure
from steer_env.recording import Recording

RISE, SETTLING = 0.5, 2.0  # until the torque is held, and until what the rise excites has died out [s]


def held(recording: Recording, asked: object = None) -> Recording:
    """The part of a recording in which torque is held and the rise has died out."""
    if recording.time[-1] < RISE + SETTLING + 1.0:
        raise RefusedError(f"the torque is held for less than a second after {RISE + SETTLING:g} s: record longer")
    return recording.between(RISE + SETTLING, recording.time[-1])


procedure("hold", held, constant_speed=False)


@metric("N m", "hold", source="after JSME D&D 2021, paper 557")
def torsion_bar_ripple(recording: Recording) -> float:
    """Peak to peak of the torsion-bar torque from two seconds into the hold to its end."""
    return float(np.ptp(recording["torsion_bar_torque"]))
