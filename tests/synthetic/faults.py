"""Faults between the car and the file: noise, zeros, scales, units, delays and clocks of sensors, gaps, a slow log."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import signal

from steer_env import metrics
from steer_env.metrics.common.filtered_channels import ANGLE, AY, TORQUE, YAW
from steer_env.recording.recording import DEGREE, Recording
from tests.synthetic.recordings import changed

# Standard deviation of a sensor's noise, which is independent from sample to sample [SI].
NOISE = {
    "handwheel_angle": 0.05 * DEGREE,
    "handwheel_speed": 1.0 * DEGREE,
    "handwheel_torque": 0.05,
    "torsion_bar_torque": 0.05,
    "motor_torque": 0.2,
    "rack_force": 20.0,
    "column_speed": 1.0 * DEGREE,
    "lateral_acceleration": 0.02,
    "yaw_rate": 0.1 * DEGREE,
    "roll_angle": 0.05 * DEGREE,
    "sideslip_angle": 0.05 * DEGREE,
    "vehicle_speed": 0.05,
    "x": 0.02,  # a good satellite receiver
    "y": 0.02,
    "yaw_angle": 0.05 * DEGREE,
}
# Reading of a sensor at rest, and its change from the first to the last sample [SI].
OFFSETS = {TORQUE: 0.1, AY: 0.05, YAW: 0.2 * DEGREE}
DRIFT = {TORQUE: 0.1, AY: 0.05}
ANGLE_DRIFT = 1.0 * DEGREE  # of a handwheel angle, from the first to the last sample [rad]
DELAY = 0.010  # [s]
ANGLE_OFFSET = 2.0 * DEGREE  # of a handwheel angle whose zero was not set [rad]
TORQUE_SCALE = 0.02  # error of the torque's scale, as a fraction of the torque [1]
CLOCKS = 200e-6  # by how much two clocks drift apart, each being off by up to 100 ppm (a plain quartz; assumed) [1]


def noisy(given: Recording, rng: np.random.Generator) -> Recording:
    """The recording with white noise of every sensor."""
    return changed(given, **{n: v + NOISE[n] * rng.standard_normal(given.time.size) for n, v in given.channels.items()})


def offset(given: Recording, rng: np.random.Generator) -> Recording:
    """The recording with offsets of the sensors, of random sign."""
    known = {name: size for name, size in OFFSETS.items() if name in given.channels}
    return changed(given, **{name: given[name] + size * rng.choice([-1, 1]) for name, size in known.items()})


def drifting(given: Recording, rng: np.random.Generator) -> Recording:
    """The recording with offsets that change linearly from the first to the last sample, with random sign."""
    share = np.linspace(-0.5, 0.5, given.time.size)
    known = {name: size for name, size in DRIFT.items() if name in given.channels}
    return changed(given, **{name: given[name] + size * rng.choice([-1, 1]) * share for name, size in known.items()})


def angle_offset(given: Recording, rng: np.random.Generator) -> Recording:
    """The recording with an offset of the handwheel angle, of random sign."""
    if ANGLE not in given.channels:
        return given
    return changed(given, **{ANGLE: given[ANGLE] + ANGLE_OFFSET * rng.choice([-1, 1])})


def angle_drifting(given: Recording, rng: np.random.Generator) -> Recording:
    """The recording with a zero of the handwheel angle that changes linearly, with random sign."""
    share = np.linspace(-0.5, 0.5, given.time.size)
    return changed(given, **{ANGLE: given[ANGLE] + ANGLE_DRIFT * rng.choice([-1, 1]) * share})


def torque_scaled(given: Recording, rng: np.random.Generator) -> Recording:
    """The recording with a hand torque of the wrong scale, too large or too small, whose error is declared."""
    found = changed(given, **{TORQUE: given[TORQUE] * (1.0 + TORQUE_SCALE * rng.choice([-1, 1]))})
    return replace(found, meta={**found.meta, "torque_scale_error": TORQUE_SCALE})


def clocks_apart(given: Recording, rng: np.random.Generator) -> Recording:
    """The recording with the motion of the car on another clock, which is in step with that of the rest at its start.

    The clock is fast or slow, by chance.
    """
    at = given.time[0] + (given.time - given.time[0]) * (1.0 + CLOCKS * rng.choice([-1, 1]))
    known = [name for name in (AY, YAW) if name in given.channels]
    return changed(given, **{name: np.interp(at, given.time, given[name]) for name in known})


def radians_as_degrees(given: Recording, rng: np.random.Generator) -> Recording:
    """The recording of a file that has the handwheel angle in radians and calls them degrees."""
    return changed(given, **{ANGLE: given[ANGLE] * DEGREE})


def late(given: Recording, rng: np.random.Generator) -> Recording:
    """The recording with one channel, chosen at random, 10 ms later than the others."""
    known = [name for name in (TORQUE, AY, YAW) if name in given.channels]
    return given.delayed(str(rng.choice(known)), DELAY)


def logged_at_50_hz(given: Recording, rng: np.random.Generator) -> Recording:
    """The recording of a logger at 50 Hz: every n-th sample after the same causal low-pass at 20 Hz."""
    step = round(given.rate / 50.0)
    low_pass = signal.butter(4, 20.0, fs=given.rate, output="sos")
    start = signal.sosfilt_zi(low_pass)
    smooth = {n: signal.sosfilt(low_pass, v, zi=start * v[0])[0][::step] for n, v in given.channels.items()}
    return replace(given, time=given.time[::step], channels=smooth)


def thinned_to_50_hz(given: Recording, rng: np.random.Generator) -> Recording:
    """The recording with every n-th sample."""
    step = slice(None, None, round(given.rate / 50.0))
    return replace(given, time=given.time[step], channels={n: v[step] for n, v in given.channels.items()})


def _dropping_out(given: Recording, rng: np.random.Generator, longest: float, count: int) -> Recording:
    """The recording with ``count`` gaps in each channel, at random places in the middle 80 %.

    The gaps have random lengths up to ``longest`` [s]; one of them has that length.
    """
    channels = {}
    for name, values in given.channels.items():
        holes = values.copy()
        for length in longest * np.append(rng.random(count - 1), 1.0):
            begin = given.time[0] + (0.1 + 0.8 * rng.random()) * (given.time[-1] - given.time[0] - length)
            holes[(given.time >= begin) & (given.time < begin + length)] = np.nan
        channels[name] = holes
    return replace(given, channels=channels)


def drop_outs(given: Recording, rng: np.random.Generator) -> Recording:
    """The recording with six gaps of up to 50 ms in each channel."""
    return _dropping_out(given, rng, 0.050, 6)


def long_drop_out(given: Recording, rng: np.random.Generator) -> Recording:
    """The recording with a gap of 2 s in each channel."""
    return _dropping_out(given, rng, 2.0, 1)


PERIODIC = ("weave", "slow-ramp", "rig")  # tests that show how clocks go
TOGETHER = "measured"  # the fault that is all faults of a measurement at once
STEERED = tuple(test for test in metrics.tests() if metrics.evaluation_by_name(test).steered)


class Fault(NamedTuple):
    """A fault, and what the evaluation knows of it."""

    rate: float = 100.0  # sampling rate of the clean recording [Hz]
    before: tuple[
        Callable[[Recording, np.random.Generator], Recording], ...
    ] = ()  # changes in the sensors and the logger
    after: tuple[Callable[[Recording, np.random.Generator], Recording], ...] = ()  # changes on the way to the file
    declared: bool = False  # whether one channel is late and its delay is known
    timing: float = 0.0  # error of the channels' relative timing that the evaluation assumes [s]
    tests: tuple[str, ...] = ()  # the tests for whose recordings the fault is meant; empty: every test
    refused: str = ""  # part of the reason for which every metric must be refused; empty if none must

    def apply(self, clean: Recording, rng: np.random.Generator) -> Recording:
        """The recording that is evaluated; ValueError where its gaps are too long."""
        found, behind = clean, AY if AY in clean.channels else TORQUE
        if self.declared:
            found = found.delayed(behind, DELAY)
        for change in (*self.before, noisy, *self.after):
            found = change(found, rng)
        found = found.bridged()
        return found.delayed(behind, -DELAY) if self.declared else found


FAULTS: dict[str, Fault] = {
    "offset": Fault(before=(offset,)),
    "drift": Fault(before=(drifting,)),
    "drop-outs": Fault(after=(drop_outs,), declared=True),
    "delay": Fault(200.0, before=(late, thinned_to_50_hz), timing=DELAY),
    "50 Hz": Fault(200.0, before=(logged_at_50_hz,)),
    "1 kHz": Fault(1000.0),
    "angle offset": Fault(before=(angle_offset,)),
    "angle drift": Fault(before=(angle_drifting,), tests=PERIODIC),
    "torque scale": Fault(before=(torque_scaled,)),
    "clocks": Fault(before=(clocks_apart,), tests=PERIODIC),
    TOGETHER: Fault(before=(angle_offset, angle_drifting, torque_scaled, clocks_apart, drifting), tests=PERIODIC),
    "unit": Fault(before=(radians_as_degrees,), tests=STEERED, refused="check the unit"),
    "long": Fault(after=(long_drop_out,), refused="cut the recording there with between(t0, t1)"),
}
