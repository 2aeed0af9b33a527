"""Frequency responses against second-order systems in closed form, by sweeps and by noise."""

import numpy as np
import pytest
from scipy import signal
from scipy.optimize import brentq

from steer_env import metrics
from steer_env.metrics.frequency_response import curve
from steer_env.recording import DEGREE
from tests.steer_env.trials import G, changed, check, covers, recording, refusals, with_gap

FINE = 1000.0  # rate at which the systems run [Hz]
YAW, AY = (0.28, 0.45, 1.3), (6.0, 0.8, 1.2)  # gain, damping, natural frequency [Hz]
TORQUE = 6.0, 0.15  # N m/rad, lead [s]
TESTS = ("frequency-response", "random-steer")


def sweep_angle():
    """Five sweeps of 30 s, 0.1 to 2.5 Hz, with three seconds of rest."""
    sweep = signal.chirp(np.arange(0, 30.0, 1 / FINE), 0.1, 30.0, 2.5, phi=-90)
    fade = np.clip(np.minimum(np.arange(sweep.size), np.arange(sweep.size)[::-1]) / (0.2 * FINE), 0, 1)
    rest = np.zeros(round(3 * FINE))
    return 0.25 * np.concatenate([rest, *[sweep * fade, rest] * 5])


def random_angle(seed=1, duration=240.0, fine=FINE):
    """Gaussian noise from 0.1 to 2.5 Hz."""
    noise = np.random.default_rng(seed).standard_normal(round(duration * fine))
    f = np.fft.rfftfreq(noise.size, 1 / fine)
    band = np.fft.irfft(np.where((f > 0.1) & (f < 2.5), np.fft.rfft(noise), 0), noise.size)
    return 0.25 * band / band.std()


def second_order(gain, damping, natural):
    """Transfer function of a second-order system."""
    omega = 2 * np.pi * natural
    return signal.TransferFunction([gain * omega**2], [1.0, 2 * damping * omega, omega**2])


def driven(angle, rate, test, fine=FINE):
    """The systems driven by an angle, at a lower rate."""
    time = np.arange(angle.size) / fine
    channels = {
        "handwheel_angle": angle,
        "yaw_rate": signal.lsim(second_order(*YAW), angle, time)[1],
        "lateral_acceleration": signal.lsim(second_order(*AY), angle, time)[1],
        "handwheel_torque": TORQUE[0] * (angle + TORQUE[1] * np.gradient(angle, time)),
        "vehicle_speed": np.full(angle.size, 80 / 3.6),
    }
    every = round(fine / rate)
    return recording(time[::every], {name: x[::every] for name, x in channels.items()}, manoeuvre=test)


def sweeps(rate):
    """Recording and answers of the swept sine."""
    return driven(sweep_angle(), rate, "frequency-response"), answers()


def random(rate):
    """Recording and answers of random steering."""
    return driven(random_angle(), rate, "random-steer"), answers()


def answers():
    """What the metrics must be, in their units."""

    def h(of, f):
        gain, damping, natural = of
        s = f / natural
        return gain / (1 - s * s + 2j * damping * s)

    def falls(of):
        return brentq(lambda f: abs(h(of, f)) - abs(h(of, 0.2)) / np.sqrt(2), 0.5, 5.0)

    def t_eq(of):
        return 1 / (2 * np.pi * brentq(lambda f: np.angle(h(of, f)) + np.pi / 4, 0.1, of[2]))

    peak = YAW[2] * np.sqrt(1 - 2 * YAW[1] ** 2)
    torque = TORQUE[0] * DEGREE * np.abs(1 + 2j * np.pi * TORQUE[1] * np.array([0.2, 1.0]))
    return {
        "yaw_rate_steady_state_gain": abs(h(YAW, 0.2)),
        "yaw_rate_bandwidth": falls(YAW),
        "yaw_rate_resonance_frequency": peak,
        "yaw_rate_resonance_ratio": abs(h(YAW, peak) / h(YAW, 0.2)),
        "yaw_rate_phase_lag_at_1hz": -np.angle(h(YAW, 1.0)) / DEGREE,
        "yaw_rate_equivalent_time": t_eq(YAW),
        "yaw_rate_lowest_coherence": 1.0,
        "lateral_acceleration_steady_state_gain": abs(h(AY, 0.2)) * 100 * DEGREE / G,
        "lateral_acceleration_bandwidth": falls(AY),
        "lateral_acceleration_phase_lag_at_1hz": -np.angle(h(AY, 1.0)) / DEGREE,
        "lateral_acceleration_equivalent_time": t_eq(AY),
        "lateral_acceleration_lowest_coherence": 1.0,
        "torque_steady_state_gain": torque[0],
        "torque_gain_at_1hz": torque[1],
        "torque_phase_lead_at_1hz": np.arctan(2 * np.pi * TORQUE[1]) / DEGREE,
        "torque_lowest_coherence": 1.0,
    }


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_sweeps_in_closed_form(rate):
    """Within 0.5 %; the coherence within 3 %, as the response turns within the band of the mean."""
    check(*sweeps(rate), 5e-3, {f"{n}_lowest_coherence": 0.03 for n in ("yaw_rate", "lateral_acceleration", "torque")})


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_noise_in_closed_form(rate):
    """Within 2 %: what the segments cut off at their ends is noise, less with a longer recording."""
    check(*random(rate), 0.02, {f"{n}_lowest_coherence": 0.03 for n in ("yaw_rate", "lateral_acceleration", "torque")})


def without_coherence(expected):
    """Noise does lower the coherence: it has no truth to hold."""
    return {name: value for name, value in expected.items() if "coherence" not in name}


def test_coverage_of_sweeps():
    clean, expected = sweeps(100.0)
    assert min(covers(clean, without_coherence(expected)).values()) >= 0.85


def test_coverage_of_noise():
    """Every trial steers anew, as it is the steering that scatters the most."""
    expected = without_coherence(answers())

    def trial(seed):
        return driven(random_angle(seed, duration=180.0, fine=200.0), 100.0, "random-steer", fine=200.0)

    assert min(covers(trial, expected).values()) >= 0.85


@pytest.mark.parametrize("record", [sweeps, random])
def test_curve(record):
    clean, expected = record(100.0)
    found = curve(clean, "yaw_rate")
    at_1 = np.argmin(np.abs(found.frequency - 1.0))
    assert found.frequency[[0, -1]] == pytest.approx([0.2, 2.0])
    assert -np.angle(found.response[at_1]) / DEGREE == pytest.approx(expected["yaw_rate_phase_lag_at_1hz"], rel=0.02)
    assert np.all(found.gain_low <= found.gain_high)
    assert np.all(found.phase_low <= found.phase_high)
    assert found.gain_low[at_1] == pytest.approx(abs(found.response[at_1]), rel=0.02)
    assert np.all((found.coherence > 0.95) & (found.coherence < 1 + 1e-9))
    with pytest.raises(ValueError, match="no frequency response from manoeuvre 'weave'; there is one from freq"):
        curve(clean, "yaw_rate", "weave")


def test_incoherence_is_refused():
    """Another input as strong as the handwheel: the metrics that rest on the band say at which frequency."""
    clean, _ = random(100.0)
    other = driven(random_angle(seed=2), 100.0, "random-steer")
    refused = refusals(changed(clean, yaw_rate=clean["yaw_rate"] + other["yaw_rate"]))
    assert refused.keys() == {n for n in metrics.available("random-steer") if n.startswith("yaw")} - {
        "yaw_rate_lowest_coherence"
    }
    assert all("coherence of yaw_rate is" in text and "below 0.9" in text for text in refused.values())


@pytest.mark.parametrize("test", TESTS)
def test_refused_altogether(test):
    clean = (sweeps if test == TESTS[0] else random)(100.0)[0]
    short = {"frequency-response": "2 sweeps with two seconds straight", "random-steer": "4 segments of 25 s"}[test]
    slow = changed(clean, handwheel_angle=np.where(clean.time < 12, clean["handwheel_angle"], 0) + 0.1)
    cases = [
        (clean.between(0.0, 68.0), short),
        (changed(clean, handwheel_angle=None), "no channel 'handwheel_angle'"),
        (with_gap(clean, "handwheel_angle"), "not finite"),
        (changed(clean, vehicle_speed=0 * clean.time + 30.0), "108 km/h in the mean, not 80"),
        (slow, "sweeps" if test == TESTS[0] else "is not excited at"),
    ]
    for bad, reason in cases[: 4 if test == TESTS[1] else 5]:
        refused = refusals(bad)
        assert refused.keys() == set(metrics.available(test))
        assert all(reason in text for text in refused.values()), (reason, refused)
    wide = refusals(clean, highest_hz=4.0)
    assert wide.keys() == set(metrics.available(test))
    assert all("is not excited at 2." in text for text in wide.values()), wide


def test_refused_one_by_one():
    clean, _ = sweeps(100.0)
    swapped = refusals(changed(clean, yaw_rate=-clean["yaw_rate"]))
    assert swapped.keys() == {n for n in metrics.available(TESTS[0]) if n.startswith("yaw")} - {
        "yaw_rate_lowest_coherence"
    }
    assert all("check the signs" in text for text in swapped.values())
    assert refusals(changed(clean, handwheel_torque=None)).keys() == {
        n for n in metrics.available(TESTS[0]) if n.startswith("torque")
    }
    assert not any(n.startswith("yaw") for n in refusals(with_gap(clean, "lateral_acceleration")))
    flat = refusals(changed(clean, yaw_rate=0.3 * clean["handwheel_angle"]))
    assert "does not fall by 3 dB up to 2 Hz" in flat["yaw_rate_bandwidth"]
    assert "does not pass -45 deg" in flat["yaw_rate_equivalent_time"]
    damped = refusals(changed(clean, yaw_rate=0.05 * clean["lateral_acceleration"]))
    assert "no resonance" in damped["yaw_rate_resonance_frequency"]
    assert "yaw_rate_phase_lag_at_1hz" not in damped
