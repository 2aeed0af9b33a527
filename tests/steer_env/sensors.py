"""What sensors make of a recording whose answers are known, and how often a metric's interval then holds the truth."""

import numpy as np
import pytest

from steer_env import metrics
from steer_env.recording import DEGREE, Recording

NOISE = {
    "handwheel_angle": 0.05 * DEGREE,
    "handwheel_speed": 1.0 * DEGREE,
    "handwheel_torque": 0.05,
    "torsion_bar_torque": 0.05,
    "lateral_acceleration": 0.02,
    "yaw_rate": 0.1 * DEGREE,
    "vehicle_speed": 0.05,
    "rack_force": 20.0,
    "motor_torque": 0.2,
    "column_speed": 1.0 * DEGREE,
}
TRIALS = 40


def recording(test, time, meta=None, **channels):
    return Recording(
        time, channels, {name: metrics.CHANNELS[name] for name in channels}, {"manoeuvre": test, **(meta or {})}
    )


def noisy(clean, seed):
    rng = np.random.default_rng(seed)
    channels = {name: clean[name] + NOISE[name] * rng.standard_normal(clean.time.size) for name in clean.channels}
    return Recording(clean.time, channels, clean.units, clean.meta)


def changed(clean, **channels):
    return Recording(clean.time, {**clean.channels, **channels}, clean.units, clean.meta)


def without(clean, name):
    units = {key: unit for key, unit in clean.units.items() if key != name}
    return Recording(clean.time, {key: clean[key] for key in units}, units, clean.meta)


def burst(clean, name):
    values = clean[name].copy()
    values[values.size // 2 : values.size // 2 + 5] = np.nan
    return changed(clean, **{name: values})


def mirrored(clean):
    same = ("vehicle_speed",)
    return changed(clean, **{name: -clean[name] for name in clean.channels if name not in same})


def check_clean(synthetic, rate, tolerance):
    """Every metric of the test is answered, and within a relative tolerance (one a name, or of all)."""
    clean, answers = synthetic(rate)
    found = metrics.evaluate(clean)
    assert found.keys() == answers.keys()
    for name, value in found.items():
        assert (value.reason, value.unit) == ("", metrics.definition(name).unit), name
        allowed = tolerance.get(name, tolerance["rest"])
        assert value.value == pytest.approx(answers[name], rel=allowed, abs=allowed * 1e-2), name
    return found


def check_coverage(synthetic, rate):
    """The 95 % interval holds the truth in at least 85 % of the trials (a true one fails once in 200 such checks)."""
    clean, answers = synthetic(rate)
    trials = [metrics.evaluate(noisy(clean, seed)) for seed in range(TRIALS)]
    covered = {}
    for name, answer in answers.items():
        assert not any(trial[name].reason for trial in trials), (name, trials[0][name].reason)
        covered[name] = np.mean([trial[name].low <= answer <= trial[name].high for trial in trials])
        spread = np.std([trial[name].value for trial in trials])
        print(f"{name:36} {answer:10.4f} {trials[0][name].unit:6} covered {covered[name]:4.0%}, scatter {spread:.2g}")
    assert min(covered.values()) >= 0.85, covered


def reasons(clean, **given):
    return {name: value.reason for name, value in metrics.evaluate(clean, **given).items() if value.reason}
