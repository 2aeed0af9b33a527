"""Drives whose hand torque is known, with the spectra of the packaged drive: angle, and what is left of the torque."""

from functools import cache

import numpy as np

from steer_env.experiments.studies.common.friction_records import road_drive
from steer_env.friction import response
from steer_env.hand_torque import Model, identify, predict
from steer_env.hand_torque.model import lateral_acceleration, smoothed, stretched
from steer_env.recording import Recording

TORQUE_STEP, ANGLE_STEP = 0.0625, np.radians(0.1)  # of the sensors [N m, rad]
RATE = 200.0  # at which friction is simulated [Hz]
DISTANCE = float(np.radians(0.3))  # pre-sliding distance [rad]
UNITS = {"handwheel_angle": "rad", "torsion_bar_torque": "N m", "vehicle_speed": "m/s"}


@cache
def packaged():
    """The packaged drive, as a recording."""
    return road_drive()


@cache
def fitted():
    """What is identified from the packaged drive with Dahl friction."""
    return identify(packaged(), laws=["dahl"])


def of_spectrum(values, rng):
    """A history (T,) with the spectrum of ``values`` and random phases."""
    spectrum = np.fft.rfft(values - values.mean())
    spectrum *= np.exp(2j * np.pi * rng.random(spectrum.size))
    return values.mean() + np.fft.irfft(spectrum, values.size)


def drive(seed, law=None, level=0.0, distance=DISTANCE, damping=1.2, noise=1.0, steps=True, load=0.0):
    """A drive with a friction law (None: without), and its parameters.

    Parameters
    ----------
    seed : int
    law : str or None
    level, distance : float
        Of the law [N m, rad].
    damping : float
        C of (H1) [N m s/rad].
    noise : float
        Factor on what is left of the packaged drive, whose spectrum the noise has [1].
    steps : bool
        Whether the sensors have steps.
    load : float
        Growth of the level with the lateral acceleration [N m s2/m].
    """
    rng = np.random.default_rng(seed)
    recording, found = packaged(), fitted().best.model
    time = np.arange(recording.time[0], recording.time[-1], 1.0 / RATE)
    angle = smoothed(of_spectrum(np.interp(time, recording.time, recording["handwheel_angle"]), rng), 1.0 / RATE)
    speed = np.interp(time, recording.time, recording["vehicle_speed"])
    left = recording["torsion_bar_torque"] - predict(found, *of(recording))
    model = Model(found.shape, found.a_c, {**found.terms, "C": damping}, None, found.prior)
    torque = predict(model, time, angle, speed) + noise * of_spectrum(np.interp(time, recording.time, left), rng)
    if law is not None:
        grown = level + load * np.abs(lateral_acceleration(found.prior, angle, speed))
        torque += response(stretched(law, level, distance), angle, 1.0 / RATE, grown / level)
    made = {"handwheel_angle": angle, "torsion_bar_torque": torque, "vehicle_speed": speed}
    made = {name: np.interp(recording.time, time, values) for name, values in made.items()}
    if steps:
        for name, step in (("handwheel_angle", ANGLE_STEP), ("torsion_bar_torque", TORQUE_STEP)):
            made[name] = step * np.rint(made[name] / step)
    return Recording(recording.time, made, UNITS, recording.meta)


def of(recording):
    """Time, angle and speed of a recording."""
    return recording.time, recording["handwheel_angle"], recording["vehicle_speed"]
