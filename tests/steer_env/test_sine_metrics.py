"""Sine metrics against a car that answers with a gain and a delay."""

import numpy as np
import pytest

from steer_env import metrics
from steer_env.recording import DEGREE
from tests.steer_env.trials import G, changed, check, covers, mirrored, recording, refusals, with_gap

ANGLE, FREQUENCY = 0.65, 0.5  # rad, Hz
YAW, AY, TORQUE = (0.2, 0.05), (4.0, 0.15), (3.1, 0.02)  # peak, delay [s]
FIRST = 1.1  # of the first half wave over the others


def sines(rate, bursts=3, cycles=3, size=1.0, frequency=FREQUENCY):
    """Bursts of a sine with rests; the responses are delayed, their first half wave is higher."""
    each = cycles / frequency + 3.0
    time = np.arange(round((1.0 + bursts * each) * rate) + 1) / rate

    def wave(delay, first=1.0):
        s = np.mod(time - 1.0 - delay, each)
        on = (time > 1.0 + delay) & (s < cycles / frequency)
        return np.where(on, np.where(s < 0.5 / frequency, first, 1.0) * np.sin(2 * np.pi * frequency * s), 0.0)

    channels = {
        "handwheel_angle": size * ANGLE * wave(0.0),
        "yaw_rate": size * YAW[0] * wave(YAW[1], FIRST),
        "lateral_acceleration": size * AY[0] * wave(AY[1], FIRST),
        "handwheel_torque": size * TORQUE[0] * wave(TORQUE[1]),
        "vehicle_speed": np.full(time.size, 80 / 3.6),
    }
    return recording(time, channels, manoeuvre="sine")


def sine_answers():
    """What the metrics must be, in their units."""
    omega = 2 * np.pi * FREQUENCY
    return {
        "yaw_rate_sine_gain": YAW[0] / ANGLE,
        "yaw_rate_sine_lag": 1e3 * YAW[1],
        "yaw_rate_first_peak_ratio": FIRST,
        "lateral_acceleration_sine_gain": AY[0] / ANGLE * 100 * DEGREE / G,
        "lateral_acceleration_sine_lag": 1e3 * AY[1],
        "lateral_acceleration_first_peak_ratio": FIRST,
        "lateral_acceleration_sine_hysteresis": 2 * ANGLE / DEGREE * np.sin(omega * AY[1]),
        "yaw_rate_sine_hysteresis": 2 * ANGLE / DEGREE * np.sin(omega * YAW[1]),
        "torque_sine_gain": TORQUE[0] / ANGLE * DEGREE,
    }


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_sines_in_closed_form(rate):
    """Within 0.5 %: the low-pass at the bursts' ends, and a cubic for a sine's top."""
    check(sines(rate), sine_answers(), 5e-3)


def test_coverage():
    assert min(covers(sines(200.0), sine_answers()).values()) >= 0.85


def test_repeats_are_the_half_waves_from_the_second_cycle_on():
    found = metrics.evaluate(sines(100.0))
    assert len(found["yaw_rate_sine_lag"].repeats) == 3 * 4
    assert len(found["yaw_rate_first_peak_ratio"].repeats) == 3
    assert len(metrics.evaluate(sines(100.0, bursts=1))["yaw_rate_sine_lag"].repeats) == 4


def test_sides_and_offsets():
    clean = sines(100.0)
    plain, right = metrics.evaluate(clean), metrics.evaluate(mirrored(clean))
    offset = changed(clean, **{n: clean[n] + 0.01 for n in clean.channels if n != "vehicle_speed"})
    shifted = metrics.evaluate(offset)
    for name, value in plain.items():
        assert right[name].value == pytest.approx(value.value, rel=1e-3), name
        if "first" not in name:  # one side only
            assert shifted[name].value == pytest.approx(value.value, rel=1e-2), name


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (sines(100.0, cycles=1), "in a row: steer two cycles or more"),
        (sines(100.0).between(0.0, 2.6), "half waves of handwheel_angle with alike amplitude: steer 4 or more"),
        (sines(100.0, frequency=0.7), "say frequency_hz=0.7"),
        (changed(sines(100.0), handwheel_angle=None), "no channel 'handwheel_angle'"),
        (with_gap(sines(100.0), "handwheel_angle"), "not finite"),
        (changed(sines(100.0), vehicle_speed=0 * sines(100.0).time + 30.0), "108 km/h in the mean, not 80"),
    ],
)
def test_refused_altogether(bad, reason):
    refused = refusals(bad)
    assert refused.keys() == set(metrics.available("sine"))
    assert all(reason in text for text in refused.values()), refused


def test_refused_one_by_one():
    clean = sines(100.0)
    swapped = refusals(changed(clean, yaw_rate=-clean["yaw_rate"]))
    assert {"yaw_rate_sine_gain", "yaw_rate_sine_lag", "yaw_rate_first_peak_ratio"} <= swapped.keys()
    assert "check the signs" in swapped["yaw_rate_sine_gain"]
    assert not any(name.startswith(("lateral", "torque")) for name in swapped)
    assert refusals(changed(clean, handwheel_torque=None)).keys() == {"torque_sine_gain"}
    assert not any(name.startswith("yaw") for name in refusals(with_gap(clean, "lateral_acceleration")))
    clean = sines(100.0, cycles=4)
    ends = refusals(clean.between(0.0, clean.time[-1] - 2.9))
    assert ends["yaw_rate_sine_lag"] == "the recording ends with the sine: record a second more"
