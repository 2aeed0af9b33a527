"""Swept sine and random steering of a car whose responses are second-order systems."""

from typing import Any

import numpy as np
from scipy import signal
from scipy.optimize import brentq

from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle.constants import GRAVITY as G
from tests.synthetic.recordings import Answers, Array, Example, recording

FINE = 1000.0  # rate at which the sweeps are computed [Hz]
YAW, AY = (0.28, 0.45, 1.3), (6.0, 0.8, 1.2)  # gain [SI], damping ratio [1], natural frequency [Hz]
TORQUE = 6.0, 0.15  # gain [N m/rad], lead [s]
SPEED = 80 / 3.6
BAND, DURATION = (0.1, 2.5), 240.0  # band [Hz] and duration [s] of random steering


def _response(of: tuple[float, float, float], f: Any) -> Any:
    """Frequency response of a second-order system."""
    gain, damping, natural = of
    s = f / natural
    return gain / (1 - s * s + 2j * damping * s)


def driven(angle: Array, rate: float, test: str) -> Recording:
    """The systems in steady state with an angle (T,) at ``rate`` [Hz] that repeats periodically."""
    f, spectrum = np.fft.rfftfreq(angle.size, 1 / rate), np.fft.rfft(angle)
    responses = {
        "yaw_rate": _response(YAW, f),
        "lateral_acceleration": _response(AY, f),
        "handwheel_torque": TORQUE[0] * (1 + 2j * np.pi * f * TORQUE[1]),
    }
    return recording(
        test,
        np.arange(angle.size) / rate,
        handwheel_angle=angle,
        vehicle_speed=np.full(angle.size, SPEED),
        **{name: np.fft.irfft(h * spectrum, angle.size) for name, h in responses.items()},
    )


def sweep_angle() -> Array:
    """Five sweeps of 30 s, 0.1 to 2.5 Hz, with three seconds of rest."""
    sweep = signal.chirp(np.arange(0, 30.0, 1 / FINE), 0.1, 30.0, 2.5, phi=-90)
    fade = np.clip(np.minimum(np.arange(sweep.size), np.arange(sweep.size)[::-1]) / (0.2 * FINE), 0, 1)
    rest = np.zeros(round(3 * FINE))
    return 0.25 * np.concatenate([rest, *[sweep * fade, rest] * 5])


def random_angle(rate: float, seed: int = 1) -> Array:
    """Gaussian noise with a flat spectrum from 0.1 to 2.5 Hz; the same steering at every rate."""
    lines = np.arange(round(BAND[0] * DURATION) + 1, round(BAND[1] * DURATION))
    rng = np.random.default_rng(seed)
    size = round(DURATION * rate)
    spectrum = np.zeros(size // 2 + 1, complex)
    spectrum[lines] = rng.standard_normal(lines.size) + 1j * rng.standard_normal(lines.size)
    return 0.25 * np.fft.irfft(spectrum * size / np.linalg.norm(spectrum) / np.sqrt(2.0), size)


def response_answers() -> Answers:
    """Closed forms in the reporting units, except for the coherence, which noise lowers."""

    h = _response

    def falls(of: tuple[float, float, float]) -> float:
        return float(brentq(lambda f: abs(h(of, f)) - abs(h(of, 0.2)) / np.sqrt(2), 0.5, 5.0))

    def t_eq(of: tuple[float, float, float]) -> float:
        return float(1 / (2 * np.pi * brentq(lambda f: np.angle(h(of, f)) + np.pi / 4, 0.1, of[2])))

    peak = YAW[2] * np.sqrt(1 - 2 * YAW[1] ** 2)
    torque = TORQUE[0] * DEGREE * np.abs(1 + 2j * np.pi * TORQUE[1] * np.array([0.2, 1.0]))
    return {
        "yaw_rate_steady_state_gain": abs(h(YAW, 0.2)),
        "yaw_rate_bandwidth": falls(YAW),
        "yaw_rate_resonance_frequency": peak,
        "yaw_rate_resonance_ratio": abs(h(YAW, peak) / h(YAW, 0.2)),
        "yaw_rate_phase_lag_at_1hz": -np.angle(h(YAW, 1.0)) / DEGREE,
        "yaw_rate_equivalent_time": t_eq(YAW),
        "lateral_acceleration_steady_state_gain": abs(h(AY, 0.2)) * 100 * DEGREE / G,
        "lateral_acceleration_bandwidth": falls(AY),
        "lateral_acceleration_phase_lag_at_1hz": -np.angle(h(AY, 1.0)) / DEGREE,
        "lateral_acceleration_equivalent_time": t_eq(AY),
        "torque_steady_state_gain": torque[0],
        "torque_gain_at_1hz": torque[1],
        "torque_phase_lead_at_1hz": np.arctan(2 * np.pi * TORQUE[1]) / DEGREE,
    }


def swept_sine(rate: float) -> Example:
    """A recording of five sweeps."""
    fine, every = driven(sweep_angle(), FINE, "frequency-response"), slice(None, None, round(FINE / rate))
    channels = {name: values[every] for name, values in fine.channels.items()}
    return recording("frequency-response", fine.time[every], **channels), response_answers()


def random_steer(rate: float, seed: int = 1) -> Example:
    """A recording of four minutes; every seed gives a different steering."""
    return driven(random_angle(rate, seed), rate, "random-steer"), response_answers()
