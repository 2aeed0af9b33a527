"""Synthetic recordings with noise, and how often the intervals of their metrics hold the truth."""

import numpy as np
import pytest

from steer_env import metrics
from steer_env.recording import DEGREE, Recording

G = 9.80665
NOISE = {
    "handwheel_angle": 0.05 * DEGREE,
    "handwheel_speed": 1.0 * DEGREE,
    "handwheel_torque": 0.05,
    "lateral_acceleration": 0.02,
    "yaw_rate": 0.1 * DEGREE,
    "roll_angle": 0.05 * DEGREE,
    "sideslip_angle": 0.05 * DEGREE,
    "vehicle_speed": 0.05,
    "rack_force": 20.0,
}
TRIALS = 40


def recording(time, channels, **meta):
    """A recording of channels in SI."""
    return Recording(time, channels, {name: metrics.CHANNELS[name] for name in channels}, meta)


def noisy(clean, seed):
    """The recording with the noise of common sensors."""
    rng = np.random.default_rng(seed)
    channels = {name: clean[name] + NOISE[name] * rng.standard_normal(clean.time.size) for name in clean.channels}
    return Recording(clean.time, channels, clean.units, clean.meta)


def changed(clean, **channels):
    """The recording with other channels; None leaves one out."""
    merged = {name: values for name, values in {**clean.channels, **channels}.items() if values is not None}
    return Recording(clean.time, merged, {name: metrics.CHANNELS[name] for name in merged}, clean.meta)


def with_gap(clean, name):
    """The recording with a burst of NaN in one channel."""
    values = clean[name].copy()
    values[values.size // 2 : values.size // 2 + 5] = np.nan
    return changed(clean, **{name: values})


def mirrored(clean):
    """The recording to the other side."""
    return changed(clean, **{n: v if n == "vehicle_speed" else -v for n, v in clean.channels.items()})


def check(clean, answers, rel, loose=None):
    """Every answer within ``rel``, or what ``loose`` says for a name; every metric of the test has an answer."""
    found = metrics.evaluate(clean)
    assert found.keys() == answers.keys()
    for name, expected in answers.items():
        if expected is None:
            assert found[name].reason, name
            continue
        assert found[name].reason == "", (name, found[name].reason)
        assert found[name].value == pytest.approx(expected, rel=(loose or {}).get(name, rel)), name


def covers(clean, answers):
    """Print and return how often the interval of each metric that has repeats holds the truth.

    ``clean`` is a recording, or a function of the seed that gives one.
    """
    trials = [metrics.evaluate(noisy(clean(k) if callable(clean) else clean, k)) for k in range(TRIALS)]
    covered = {}
    for name, expected in answers.items():
        if expected is None or np.isnan(trials[0][name].low):
            continue
        covered[name] = np.mean([trial[name].low <= expected <= trial[name].high for trial in trials])
        print(f"{name:45} {expected:9.4f} {trials[0][name].value:9.4f} covered {covered[name]:4.0%}")
    assert covered
    return covered


def refusals(clean, **options):
    """Reasons by name."""
    return {name: value.reason for name, value in metrics.evaluate(clean, **options).items() if value.reason}
