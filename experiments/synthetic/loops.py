"""Recordings with answers in closed form, and whether the metrics find them behind what a measurement does to them.

A case gives a recording at a rate and its answers in reporting units; a fault turns a recording into what a logger
would have stored. Each trial adds fresh noise, and asks whether the truth lies in the metric's own 95 % interval.
"""

import multiprocessing
import zlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from steer_env import metrics
from steer_env.metrics.reading import AY, TORQUE, YAW
from steer_env.recording import DEGREE, Recording
from vehicle.single_track import GRAVITY as G

Array = NDArray[np.float64]
Answers = dict[str, float]

# A linear car: every channel a sine, so that every loop is an ellipse.
ANGLE_PEAK, TORQUE_PEAK, AY_PEAK, YAW_PEAK = 17 * DEGREE, 3.2, 2.0, 0.075  # rad, N m, m/s2, rad/s
LEAD, AY_LAG, YAW_LAG = 0.25, 0.150, 0.080  # of the torque [rad], of the responses at 0.2 Hz [s]
# A car without lag: torque, lateral acceleration and yaw rate by handwheel angle [N m/rad, m/s2/rad, 1/s].
STIFFNESS, AY_GAIN, YAW_GAIN = 8.0, 7.0, 0.25

# Standard deviation of a sensor's noise, each sample its own [SI].
NOISE = {
    "handwheel_angle": 0.05 * DEGREE,
    "handwheel_torque": 0.05,
    "lateral_acceleration": 0.02,
    "yaw_rate": 0.1 * DEGREE,
    "vehicle_speed": 0.05,
}
# What a sensor reads at rest, and what that moves by from the first to the last sample [SI].
OFFSETS = {TORQUE: 0.1, AY: 0.05, YAW: 0.2 * DEGREE}
DRIFT = {TORQUE: 0.1, AY: 0.05}
DELAY = 0.010  # [s]


def recording(
    time: Array, angle: Array, torque: Array, ay: Array, yaw: Array, speed: float = 100 / 3.6, **meta: Any
) -> Recording:
    """The channels that the loops need, all (T,) in SI."""
    channels = {
        "handwheel_angle": angle,
        "handwheel_torque": torque,
        "lateral_acceleration": ay,
        "yaw_rate": yaw,
        "vehicle_speed": np.full(time.size, speed),
    }
    return Recording(time, channels, {name: metrics.CHANNELS[name] for name in channels}, meta)


def linear_car(frequency: float = 0.2, cycles: int = 10, size: float = 1.0, rate: float = 100.0) -> Recording:
    """``cycles`` of an elliptical weave; ``size`` scales its amplitude."""
    omega = 2 * np.pi * frequency
    time = np.arange(round(cycles / frequency * rate) + 1) / rate
    return recording(
        time,
        size * ANGLE_PEAK * np.sin(omega * time),
        size * TORQUE_PEAK * np.sin(omega * time + LEAD),
        size * AY_PEAK * np.sin(omega * (time - AY_LAG)),
        size * YAW_PEAK * np.sin(omega * (time - YAW_LAG)),
    )


def linear_car_answers(frequency: float = 0.2, size: float = 1.0) -> Answers:
    """Closed forms for the ellipses, in the reporting units.

    With y = B sin(p + b) over x = A sin(p): width 2 B sin(b) at x = 0, 2 A sin(b) at y = 0; mean branch (B/A) cos(b) x.
    """
    ay_lag, yaw_lag = 2 * np.pi * frequency * AY_LAG, 2 * np.pi * frequency * YAW_LAG
    angle, torque, ay = size * ANGLE_PEAK / DEGREE, size * TORQUE_PEAK, size * AY_PEAK / G  # deg, N m, g
    gradient = torque / ay * np.cos(LEAD + ay_lag)
    sensitivity = 100 * ay / angle / np.cos(ay_lag)
    return {
        "torque_at_0g": torque * np.sin(LEAD + ay_lag),
        "torque_at_0p1g": 0.1 * gradient,
        "torque_gradient_at_0g": gradient,
        "torque_gradient_at_0p1g": gradient,
        "torque_gradient_ratio": 1.0,
        "lateral_acceleration_at_0nm": ay * np.sin(LEAD + ay_lag),
        "angle_hysteresis": 2 * angle * np.sin(ay_lag),
        "angle_deadband": 2 * angle * np.sin(LEAD),
        "torque_deadband": 2 * torque * np.sin(LEAD),
        "steering_stiffness": torque / angle * np.cos(LEAD),
        "steering_sensitivity_at_0p1g": sensitivity,
        "minimum_steering_sensitivity": sensitivity,
        "yaw_rate_gain": YAW_PEAK / ANGLE_PEAK * np.cos(yaw_lag),
        "yaw_lag": 1e3 * YAW_LAG,
        "lateral_acceleration_lag": 1e3 * AY_LAG,
        "work_sensitivity": sensitivity / (0.1 * gradient),
        "peak_handwheel_torque": torque,
        "peak_handwheel_angle": angle,
        "loop_area": np.pi * torque * angle * DEGREE * np.sin(LEAD),
    }


def rough_car(
    friction: float = 0.6,
    slip: float = 0.4 * DEGREE,
    frequency: float = 0.02,
    cycles: int = 5,
    triangle: bool = True,
    rate: float = 100.0,
) -> Recording:
    """Torque k angle plus a spring that slips at ``friction`` [N m] after ``slip`` [rad]; no lag anywhere."""
    time = np.arange(round(cycles / frequency * rate) + 1) / rate
    phase = frequency * time
    wave = np.abs((4 * phase + 3) % 4 - 2) - 1 if triangle else np.sin(2 * np.pi * phase)
    angle = ANGLE_PEAK * wave
    torque, spring = np.empty_like(angle), 0.0
    for k in range(angle.size):
        spring += friction / slip * (angle[k] - angle[max(k - 1, 0)])
        spring = min(max(spring, -friction), friction)
        torque[k] = STIFFNESS * angle[k] + spring
    return recording(time, angle, torque, AY_GAIN * angle, YAW_GAIN * angle)


def rough_car_answers(friction: float = 0.6, slip: float = 0.4 * DEGREE) -> Answers:
    """Branches are k angle +- friction away from the turning points; the loop is a parallelogram."""
    gradient, sensitivity = STIFFNESS / AY_GAIN * G, 100 * AY_GAIN * DEGREE / G
    return {
        "torque_at_0g": friction,
        "torque_at_0p1g": 0.1 * gradient,
        "torque_gradient_at_0g": gradient,
        "torque_gradient_at_0p1g": gradient,
        "torque_gradient_ratio": 1.0,
        "lateral_acceleration_at_0nm": friction / STIFFNESS * AY_GAIN / G,
        "angle_hysteresis": 0.0,
        "angle_deadband": 2 * friction / STIFFNESS / DEGREE,
        "torque_deadband": 2 * friction,
        "steering_stiffness": STIFFNESS * DEGREE,
        "steering_sensitivity_at_0p1g": sensitivity,
        "minimum_steering_sensitivity": sensitivity,
        "yaw_rate_gain": YAW_GAIN,
        "yaw_lag": 0.0,
        "lateral_acceleration_lag": 0.0,
        "work_sensitivity": sensitivity / (0.1 * gradient),
        "peak_handwheel_torque": STIFFNESS * ANGLE_PEAK + friction,
        "peak_handwheel_angle": ANGLE_PEAK / DEGREE,
        "loop_area": 4 * friction * (ANGLE_PEAK - slip),
    }


def _as(test: str, clean: Recording, answers: Answers) -> tuple[Recording, Answers]:
    """A case of a test: the recording says which, and the answers are those that the test reports."""
    named = replace(clean, meta={"manoeuvre": test, "speed_m_s": 100 / 3.6})
    return named, {name: answers[name] for name in metrics.available(test) if name in answers}


def weave_of_a_linear_car(rate: float) -> tuple[Recording, Answers]:
    """Ellipses at 0.2 Hz, ten settled cycles."""
    return _as("weave", linear_car(cycles=12, rate=rate), linear_car_answers())


def weave_of_a_rough_car(rate: float) -> tuple[Recording, Answers]:
    """Parallelograms at 0.2 Hz, ten settled cycles."""
    return _as("weave", rough_car(frequency=0.2, cycles=12, triangle=False, rate=rate), rough_car_answers())


def slow_ramp_of_a_linear_car(rate: float) -> tuple[Recording, Answers]:
    """Ellipses at 0.02 Hz, three settled cycles."""
    return _as("slow-ramp", linear_car(0.02, cycles=5, rate=rate), linear_car_answers(0.02))


def slow_ramp_of_a_rough_car(rate: float) -> tuple[Recording, Answers]:
    """Parallelograms at 0.02 Hz by a triangle wave, three settled cycles."""
    return _as("slow-ramp", rough_car(rate=rate), rough_car_answers())


# Every one of them is in the mark; a test's cases join by a line each.
CASES: dict[str, Callable[[float], tuple[Recording, Answers]]] = {
    "weave, linear car": weave_of_a_linear_car,
    "weave, rough car": weave_of_a_rough_car,
    "slow ramp, linear car": slow_ramp_of_a_linear_car,
    "slow ramp, rough car": slow_ramp_of_a_rough_car,
}


def changed(given: Recording, **channels: Array) -> Recording:
    """A recording with other values (T,) in some channels."""
    return replace(given, channels={**given.channels, **channels})


def noisy(given: Recording, rng: np.random.Generator) -> Recording:
    """White noise of every sensor."""
    known = {name: size for name, size in NOISE.items() if name in given.channels}
    return changed(given, **{n: given[n] + size * rng.standard_normal(given.time.size) for n, size in known.items()})


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


def _dropping_out(given: Recording, rng: np.random.Generator, longest: float, count: int) -> Recording:
    """``count`` gaps in each channel, somewhere in the middle eight tenths; lengths up to ``longest``, one of it."""
    channels = {}
    for name, values in given.channels.items():
        holes = values.copy()
        for length in longest * np.append(rng.random(count - 1), 1.0):
            begin = given.time[0] + (0.1 + 0.8 * rng.random()) * (given.time[-1] - given.time[0])
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
    """What goes wrong between the car and the file, and what the evaluation is told of it."""

    rate: float = 100.0  # of the clean recording [Hz]
    before: tuple[Callable[[Recording, np.random.Generator], Recording], ...] = ()  # in the sensors and the logger
    after: tuple[Callable[[Recording, np.random.Generator], Recording], ...] = ()  # on the way to the file
    declared: str = ""  # channel that is late, and said to be
    timing: float = 0.0  # to which the channels' relative timing is known [s]
    refused: str = ""  # what every reason says, where there must be no value


def _late_lateral_acceleration(given: Recording, rng: np.random.Generator) -> Recording:
    return given.delayed(AY, DELAY)


FAULTS: dict[str, Fault] = {
    "offset": Fault(before=(offset,)),
    "drift": Fault(before=(drifting,)),
    "drop-outs": Fault(before=(_late_lateral_acceleration,), after=(drop_outs,), declared=AY),
    "delay": Fault(50.0, before=(late,), timing=DELAY),
    "50 Hz": Fault(200.0, before=(logged_at_50_hz,)),
    "1 kHz": Fault(1000.0),
    "long": Fault(after=(long_drop_out,), refused="cut the recording there with between(t0, t1)"),
}


class Coverage(NamedTuple):
    """What became of the trials of one metric under one fault."""

    covered: float  # share of the trials whose interval holds the truth
    refused: float  # share that was refused
    reasons: tuple[str, ...]  # of the refusals, the most frequent first


def _trial(clean: Recording, fault: Fault, seed: Sequence[int]) -> dict[str, metrics.Value] | str:
    """Metrics of one trial, or why there are none."""
    rng = np.random.default_rng(seed)
    found = clean
    for spoil in fault.before:
        found = spoil(found, rng)
    found = noisy(found, rng)
    for spoil in fault.after:
        found = spoil(found, rng)
    try:
        found = found.bridged()
    except ValueError as error:
        return str(error)
    if fault.declared:
        found = found.delayed(fault.declared, -DELAY)
    return metrics.evaluate(found, timing=fault.timing)


def coverage(
    clean: Recording, answers: Mapping[str, float], fault: Fault, trials: int, stream: int = 0
) -> dict[str, Coverage]:
    """Every metric with an answer, over seeded trials of one fault; another ``stream`` draws other noise."""
    held: Counter[str] = Counter()
    reasons: dict[str, Counter[str]] = {name: Counter() for name in answers}
    for seed in range(trials):
        values = _trial(clean, fault, (stream, seed))
        for name, truth in answers.items():
            reason = values if isinstance(values, str) else values[name].reason
            if reason:
                reasons[name][reason] += 1
            elif not isinstance(values, str):
                held[name] += values[name].low <= truth <= values[name].high
    return {
        name: Coverage(
            held[name] / trials, sum(reasons[name].values()) / trials, tuple(r for r, _ in reasons[name].most_common())
        )
        for name in answers
    }


def _job(job: tuple[str, str, int]) -> dict[str, Coverage]:
    case, name, trials = job
    fault = FAULTS[name]
    stream = zlib.crc32(f"{case}, {name}".encode())  # no luck is shared between faults
    return coverage(*CASES[case](fault.rate), fault, trials, stream)


def collect(trials: int, workers: int | None = None) -> dict[str, dict[str, dict[str, Coverage]]]:
    """Case, fault, metric: everything, side by side in processes."""
    jobs = [(case, fault, trials) for case in CASES for fault in FAULTS]
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        found = list(pool.map(_job, jobs))
    result: dict[str, dict[str, dict[str, Coverage]]] = {case: {} for case in CASES}
    for (case, fault, _), metrics_of in zip(jobs, found):
        result[case][fault] = metrics_of
    return result
