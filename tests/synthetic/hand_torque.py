"""Drives whose hand torque is known, with the spectra of the packaged drives: angle, and what is left of the torque."""

from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline

from steer_env import friction
from steer_env.experiments.studies.common.friction_records import road_drive
from steer_env.hand_torque import Prior, identify, predict
from steer_env.hand_torque.model import bends, lateral_acceleration, smoothed, stretched
from steer_env.manoeuvres import Manoeuvre
from steer_env.manoeuvres.common.driving import drive as driven
from steer_env.manoeuvres.common.shapes import ramp_and_hold
from steer_env.recording import Recording
from steer_env.vehicle import cars
from steer_env.vehicle.chassis.common.interface import TARGET_SPEED, WIND_FORCE

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
        C of (H1), beside which nothing but a law dissipates [N m s/rad].
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
    model = found._replace(terms={**found.terms, "C": damping, "k_s": 0.0}, friction=None)
    torque = predict(model, time, angle, speed) + noise * of_spectrum(np.interp(time, recording.time, left), rng)
    if law is not None:
        grown = level + load * np.abs(lateral_acceleration(found.prior, angle, speed))
        torque += friction.response(stretched(law, level, distance), angle, 1.0 / RATE, grown / level)
    made = {"handwheel_angle": angle, "torsion_bar_torque": torque, "vehicle_speed": speed}
    made = {name: np.interp(recording.time, time, values) for name, values in made.items()}
    if steps:
        for name, step in (("handwheel_angle", ANGLE_STEP), ("torsion_bar_torque", TORQUE_STEP)):
            made[name] = step * np.rint(made[name] / step)
    return Recording(recording.time, made, UNITS, recording.meta)


def of(recording):
    """Time, angle and speed of a recording."""
    return recording.time, recording["handwheel_angle"], recording["vehicle_speed"]


def traffic(seed, law=None, level=0.0, distance=DISTANCE, *, above=True, car="compact", noise=1.0, duration=240.0):
    """A drive in stop-and-go of a packaged car on two tracks, as its logger would keep it.

    The angle has the spectrum of the packaged drive in traffic, the speed is its, from a random instant on. Tyres
    scrub, the assist amplifies, the road is banked in its bends and rough. Friction is above the torsion bar, where the
    hands feel all of it, or at the column below it. ``noise`` is a factor on roughness and sensors.
    """
    rng, recording = np.random.default_rng(seed), road_drive("mkz_2016_traffic")
    time = np.arange(0.0, duration, 0.01)
    angle = of_spectrum(np.interp(time, recording.time, recording["handwheel_angle"]), rng)
    angle = CubicSpline(time, smoothed(angle, 0.01))
    speed = np.roll(np.interp(time, recording.time, recording["vehicle_speed"]), rng.integers(time.size))
    window = np.hanning(401) / np.hanning(401).sum()  # where the end meets the start, no car jumps
    speed = np.convolve(np.pad(speed, 200, "edge"), window, "valid")
    base = cars.load(car, {"steering.friction_load": 0.0})
    pull = rng.uniform(100.0, 400.0) * bends(Prior(), angle(time), speed, 0.01) * base.chassis["mass"]

    def hand(t, amplitude):
        on, change = ramp_and_hold(t, 1.0, 2.0)
        return amplitude * on * angle(t), amplitude * (change * angle(t) + on * angle(t, 1))

    manoeuvre = Manoeuvre(
        name="traffic", hands="an angle", source="made", speed=float(speed[0]), duration=duration - 0.01, hand=hand,
        amplitude=1.0, chassis="two_track",
        others={
            TARGET_SPEED: lambda t: np.interp(t, time, speed) - speed[0],
            WIND_FORCE: lambda t: np.interp(t, time, pull),
        },
    )  # fmt: skip
    none = friction.make("viscous", sigma_2=0.0)
    there = stretched(law, level, distance) if law else none
    made = driven(base, manoeuvre, none if above else there)
    torque = made["torsion_bar_torque"]
    if above and law:
        torque = torque + friction.response(there, made["handwheel_angle"], 1e-3)
    rough = np.convolve(rng.standard_normal(made.time.size + 5000), np.exp(-np.arange(5001) / 1000.0), "valid")
    torque = torque + noise * 0.15 * rough / rough.std()
    at = np.arange(made.time[0], made.time[-1], 0.02)
    kept = {"handwheel_angle": made["handwheel_angle"], "torsion_bar_torque": torque}
    kept = {name: np.interp(at, made.time, values) for name, values in kept.items()}
    kept["torsion_bar_torque"] += noise * 0.05 * rng.standard_normal(at.size)
    for name, step in (("handwheel_angle", ANGLE_STEP), ("torsion_bar_torque", TORQUE_STEP)) if noise else ():
        kept[name] = step * np.rint(kept[name] / step)
    return Recording(at, {**kept, "vehicle_speed": np.interp(at, made.time, made["vehicle_speed"])}, UNITS)
