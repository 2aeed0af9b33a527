"""Step metrics against a second-order system in closed form."""

import numpy as np
import pytest

from steer_env.metrics import evaluate
from steer_env.recording import DEGREE, Recording

G = 9.80665


def test_step_response_of_a_second_order_system():
    """Damping 0.6, 6 rad/s: overshoot, peak time and 90 % time in closed form, from the middle of a short ramp."""
    zeta, omega, gain, rise = 0.6, 6.0, 0.3, 0.002
    t = np.arange(1, 6001) * 1e-3
    s, damped = np.clip(t - 1.0, 0.0, None), omega * np.sqrt(1.0 - zeta**2)
    shape = 1.0 - np.exp(-zeta * omega * s) * (np.cos(damped * s) + zeta * omega / damped * np.sin(damped * s))
    angle = 0.5 * np.clip((t - 1.0) / rise, 0.0, 1.0)
    channels = {"handwheel_angle": angle, "yaw_rate": 0.5 * gain * shape, "lateral_acceleration": 3.0 * shape}
    units = {"handwheel_angle": "rad", "yaw_rate": "rad/s", "lateral_acceleration": "m/s2"}
    found = evaluate(Recording(t, channels, units, {"manoeuvre": "step-steer"}))
    assert found["yaw_rate_step_gain"].value == pytest.approx(gain, rel=1e-3)
    assert found["lateral_acceleration_step_gain"].value == pytest.approx(600 * DEGREE / G, rel=1e-3)
    assert found["yaw_rate_overshoot"].value == pytest.approx(np.exp(-np.pi * zeta / np.sqrt(1.0 - zeta**2)), abs=1e-3)
    assert found["yaw_rate_peak_time"].value == pytest.approx(np.pi / damped, abs=3e-3)
    assert found["yaw_rate_time_to_90"].value == pytest.approx(s[np.argmax(shape >= 0.9)], abs=3e-3)
    mirrored = {name: -x for name, x in channels.items()}
    assert evaluate(Recording(t, mirrored, units, {"manoeuvre": "step-steer"})) == found
