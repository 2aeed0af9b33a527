"""What goes wrong between the car and the file: noise and offsets of sensors, delays, slow logging, gaps."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import signal

from steer_env.metrics.common.filtered_channels import AY, TORQUE, YAW
from steer_env.recording.recording import DEGREE, Recording
from steer_env.synthetic.recordings import changed

# Standard deviation of a sensor's noise, each sample its own [SI].
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
# What a sensor reads at rest, and what that moves by from the first to the last sample [SI].
OFFSETS = {TORQUE: 0.1, AY: 0.05, YAW: 0.2 * DEGREE}
DRIFT = {TORQUE: 0.1, AY: 0.05}
DELAY = 0.010  # [s]


def noisy(given: Recording, rng: np.random.Generator) -> Recording:
    """White noise of every sensor."""
    return changed(given, **{n: v + NOISE[n] * rng.standard_normal(given.time.size) for n, v in given.channels.items()})


def offset(given: Recording, rng: np.random.Generator) -> Recording:
    """Sensors that do not read zero at rest, of either sign."""
    known = {name: size for name, size in OFFSETS.items() if name in given.channels}
    return changed(given, **{name: given[name] + size * rng.choice([-1, 1]) for name, size in known.items()})


def drifting(given: Recording, rng: np.random.Generator) -> Recording:
    """Offsets that move evenly from the first to the last sample, in either direction."""
    share = np.linspace(-0.5, 0.5, given.time.size)
    known = {name: size for name, size in DRIFT.items() if name in given.channels}
    return changed(given, **{name: given[name] + size * rng.choice([-1, 1]) * share for name, size in known.items()})


def late(given: Recording, rng: np.random.Generator) -> Recording:
    """One channel behind the others by 10 ms: which one, changes."""
    known = [name for name in (TORQUE, AY, YAW) if name in given.channels]
    return given.delayed(str(rng.choice(known)), DELAY)


def logged_at_50_hz(given: Recording, rng: np.random.Generator) -> Recording:
    """What a logger stores at 50 Hz: each channel through the same causal low-pass at 20 Hz, then every n-th sample."""
    step = round(given.rate / 50.0)
    low_pass = signal.butter(4, 20.0, fs=given.rate, output="sos")
    start = signal.sosfilt_zi(low_pass)
    smooth = {n: signal.sosfilt(low_pass, v, zi=start * v[0])[0][::step] for n, v in given.channels.items()}
    return replace(given, time=given.time[::step], channels=smooth)


def thinned_to_50_hz(given: Recording, rng: np.random.Generator) -> Recording:
    """Every n-th sample."""
    step = slice(None, None, round(given.rate / 50.0))
    return replace(given, time=given.time[step], channels={n: v[step] for n, v in given.channels.items()})


def _dropping_out(given: Recording, rng: np.random.Generator, longest: float, count: int) -> Recording:
    """``count`` gaps in each channel, somewhere in the middle eight tenths; lengths up to ``longest``, one of it."""
    channels = {}
    for name, values in given.channels.items():
        holes = values.copy()
        for length in longest * np.append(rng.random(count - 1), 1.0):
            begin = given.time[0] + (0.1 + 0.8 * rng.random()) * (given.time[-1] - given.time[0] - length)
            holes[(given.time >= begin) & (given.time < begin + length)] = np.nan
        channels[name] = holes
    return replace(given, channels=channels)


def drop_outs(given: Recording, rng: np.random.Generator) -> Recording:
    """Six gaps of up to 50 ms in each channel."""
    return _dropping_out(given, rng, 0.050, 6)


def long_drop_out(given: Recording, rng: np.random.Generator) -> Recording:
    """A gap of 2 s in each channel."""
    return _dropping_out(given, rng, 2.0, 1)


class Fault(NamedTuple):
    """What goes wrong, and what the evaluation is told of it."""

    rate: float = 100.0  # of the clean recording [Hz]
    before: tuple[Callable[[Recording, np.random.Generator], Recording], ...] = ()  # in the sensors and the logger
    after: tuple[Callable[[Recording, np.random.Generator], Recording], ...] = ()  # on the way to the file
    declared: bool = False  # whether one channel is late, and said to be
    timing: float = 0.0  # to which the channels' relative timing is known [s]
    refused: str = ""  # what every reason says, where there must be no value

    def spoil(self, clean: Recording, rng: np.random.Generator) -> Recording:
        """The recording as it is evaluated; ValueError where its gaps are too long."""
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
    "long": Fault(after=(long_drop_out,), refused="cut the recording there with between(t0, t1)"),
}
