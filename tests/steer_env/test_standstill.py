"""Parking, catch-up and hold against efforts in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from steer_env import manoeuvres, metrics
from steer_env.metrics.common import events, noise
from steer_env.metrics.common.filtered_channels import FilteredChannels
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle import cars
from tests.steer_env.checks import burst, check, check_alike, check_refused, refusals
from tests.synthetic.faults import noisy
from tests.synthetic.recordings import changed, mirrored, recording
from tests.synthetic.standstill import SLOW_TORQUE, catch_up, hold, parking


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_parking_in_closed_form(rate):
    """Within 0.03 %."""
    check(*parking(rate), {"rest": 3e-4})


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_catch_up_in_closed_form(rate):
    """Within 1 %: sweeps at 100 deg/s take 5 s, at 700 deg/s the middle half is 19 samples at 50 Hz."""
    check(*catch_up(rate), {"rest": 1e-2})


@pytest.mark.parametrize("rate", [200.0, 1000.0])
def test_hold_in_closed_form(rate):
    """Within 1 %: the low-pass at 40 Hz takes 0.2 % at 8 Hz; at 50 Hz there is none."""
    check(*hold(rate), {"rest": 1e-2})
    assert "record at 160 Hz or faster" in refusals(hold(50.0)[0])["torsion_bar_ripple"]


def test_a_ripple_stands_out_of_the_noise_or_is_refused():
    """At 1 kHz noise of 0.05 N m spans 0.09 N m in 40 Hz: a ripple of 0.3 is read, too high by a quarter at most."""
    clean = hold(1000.0)[0]
    for seed in range(10):
        assert 0.3 < metrics.evaluate(noisy(clean, np.random.default_rng(seed)))["torsion_bar_ripple"].value < 0.38
    small = changed(clean, torsion_bar_torque=0.5 * (clean["torsion_bar_torque"] + clean["handwheel_torque"]))
    found = metrics.evaluate(noisy(small, np.random.default_rng(0)))["torsion_bar_ripple"]
    assert "of which noise alone would make 0.0" in found.reason


def test_noise_does_not_add_to_the_ripple_of_parking():
    """White noise of 0.6 N m at 1 kHz has a third of the power of the ripple in its band; it is left out to 2.5 %."""
    clean, truth = parking(1000.0)
    torque, found = clean["handwheel_torque"], []
    for seed in range(20):
        white = 0.6 * np.random.default_rng(seed).standard_normal(torque.size)
        found.append(metrics.evaluate(changed(clean, handwheel_torque=torque + white))["handwheel_torque_ripple"].value)
    assert np.mean(found) == pytest.approx(truth["handwheel_torque_ripple"], rel=0.025)


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_noise_in_band_is_judged_from_above(rate):
    """White noise of 0.05 N m through a low-pass at 10 Hz, within 5 %; jumps do not count."""
    time = np.arange(round(200 * rate)) / rate
    white = 0.05 * np.random.default_rng(1).standard_normal(time.size) + np.where(time % 20 < 10, 0.0, 1.0)
    channels = FilteredChannels(recording("hold", time, handwheel_torque=white), 10.0)
    quiet = (time % 10 > 1) & (time % 10 < 9)
    truth = (channels["handwheel_torque"] - np.where(time % 20 < 10, 0.0, 1.0))[quiet].std()
    assert noise.in_band(channels, "handwheel_torque", 10.0) == pytest.approx(truth, rel=0.05)


def test_left_and_right_are_alike():
    for synthetic in (parking, catch_up, hold):
        clean = synthetic(200.0)[0]
        check_alike(clean, mirrored(clean), rel=1e-9)


def test_bad_parking_is_refused():
    clean = parking(100.0)[0]
    for reason, bad in {
        "no channel 'handwheel_angle'": clean.without("handwheel_angle"),
        "samples that are not finite": burst(clean, "handwheel_angle"),
        "vehicle_speed exceeds 0.3 m/s: let the car stand": changed(clean, vehicle_speed=1 + 0 * clean.time),
        "0 half sweeps from lock to lock": changed(clean, handwheel_angle=0 * clean.time),
        "1 half sweeps from lock to lock: steer 2 or more": clean.between(0.0, 26.0),
        "record at 40 Hz or faster": parking(30.0)[0],
    }.items():
        check_refused(bad, reason)
    for channel, count in (("handwheel_torque", 4), ("rack_force", 3), ("motor_torque", 3), ("column_speed", 1)):
        for bad in (clean.without(channel), burst(clean, channel)):
            assert len(refusals(bad)) == count, channel
    swapped = refusals(changed(clean, handwheel_torque=-clean["handwheel_torque"]))
    assert len(swapped) == 4
    assert all("check the signs" in text for text in swapped.values())


def test_catch_up_that_is_not_reached_or_cannot_be_read():
    slow = metrics.evaluate(catch_up(200.0, fastest=300.0)[0])
    assert slow["catch_up_rate"].reason.startswith("not reached up to 300 deg/s, where the excess is 1.9 of 2.5 N m")
    too_slow = "the fastest sweep is at 300 deg/s: steer at 500 deg/s or faster"
    assert slow["torque_excess_at_500_deg_s"].reason == too_slow
    assert slow["quasi_static_torque"].value == pytest.approx(SLOW_TORQUE, rel=1e-2)
    assert slow["motor_limit_rate"].reason.startswith("not reached up to 300 deg/s")
    assert slow["share_at_motor_limit"].value == 0.0
    clean = catch_up(200.0)[0]
    for limits in (None, {}, "20", {"limit": "20"}, {"limit": 20.0, "motor_speeds": [1.0]}, {"limit": 20.0, "x": 1}):
        found = refusals(replace(clean, meta={**clean.meta, "motor": limits}))
        assert found.keys() == {"share_at_motor_limit", "motor_limit_rate"}
        assert all("no limits of a motor in its meta motor" in text for text in found.values())
    for reason, bad in {
        "no sweep at 60 deg/s or slower to compare with": clean.between(55.0, clean.time[-1]),
        "check the signs": changed(clean, handwheel_torque=-clean["handwheel_torque"]),
        "samples that are not finite": burst(clean, "handwheel_torque"),
        "no channel 'handwheel_torque'": clean.without("handwheel_torque"),
    }.items():
        check_refused(bad, reason)


def test_bad_holds_are_refused():
    clean = hold(200.0)[0]
    for reason, bad in {
        "is held within 5% for 2.": clean.between(0.0, 5.0),
        "no channel 'torsion_bar_torque'": clean.without("torsion_bar_torque"),
        "no channel 'handwheel_torque'": clean.without("handwheel_torque"),
        "samples that are not finite": burst(clean, "torsion_bar_torque"),
        "is held within 5% for 0 s": changed(clean, handwheel_torque=0 * clean.time),
    }.items():
        assert reason in refusals(bad)["torsion_bar_ripple"], reason


def test_runs():
    assert events.true_runs(np.array([1, 1, 0, 1], bool)) == [(0, 2), (3, 4)]
    assert events.true_runs(np.zeros(3, bool)) == []


@pytest.fixture(scope="module")
def driven():
    car = cars.load()
    laws = ("lugre", "viscous")
    return {
        (test, law): manoeuvres.drive(car, manoeuvres.make(test), law)
        for test in ("parking", "catch-up")
        for law in laws
    }


@pytest.mark.parametrize("law", ["lugre", "viscous"])
def test_the_default_car_is_plausible(driven, law):
    """3 to 5 kN and 3 to 5 N m in parking; the assist keeps up, but not with a viscous friction of 3.5 N m s."""
    found = metrics.evaluate(driven["parking", law])
    assert not any(value.reason for value in found.values())
    assert all(len(value.repeats) == 3 for value in found.values())
    value = {name: entry.value for name, entry in found.items()}
    assert (
        2500 < value["rack_force_at_centre"] < value["rack_force_mean_towards_lock"] < value["rack_force_peak"] < 6000
    )
    assert 3.0 < value["handwheel_torque_mean"] < value["handwheel_torque_peak"] < 6.0
    assert value["handwheel_torque_ripple"] < 0.05
    assert 10.0 < value["motor_torque_mean"] < value["motor_torque_peak"] < 3.5 * 20.5
    fast = metrics.evaluate(driven["catch-up", law])
    if law == "lugre":
        assert "conclude that the assist keeps up" in fast["catch_up_rate"].reason
        assert 1.0 < fast["torque_excess_at_500_deg_s"].value < 2.5
    else:
        assert 100.0 < fast["catch_up_rate"].value < 500.0
        assert fast["torque_excess_at_500_deg_s"].value > 2.5


def test_less_motor_damping_and_less_speed_move_the_catch_up():
    """Without motor damping the assist keeps up for longer; slow sweeps alone never get there."""
    car = cars.load()
    a = car.assist
    light = car._replace(assist=a._replace(damping=0.0 * a.damping))
    quick = manoeuvres.make("catch-up", rates=tuple(np.radians([200.0, 550.0])))
    rate = {
        name: metrics.evaluate(manoeuvres.drive(c, quick))["torque_excess_at_500_deg_s"].value
        for name, c in (("heavy", car), ("light", light))
    }
    assert rate["light"] < 0.5 * rate["heavy"]
    slow = manoeuvres.drive(car, manoeuvres.make("catch-up", rates=(np.radians(100.0),)))
    assert metrics.evaluate(slow)["catch_up_rate"].reason.startswith("not reached up to 1")


@pytest.mark.parametrize("law", ["lugre", "viscous"])
def test_hold_reads_what_the_simulation_shows(law):
    """The peak to peak of the unfiltered torque from 2 s into the hold on, within 3 %."""
    run = manoeuvres.drive(cars.load(), manoeuvres.make("hold"), law)
    later = run["torsion_bar_torque"][run.time >= 2.5]
    found = metrics.evaluate(run)["torsion_bar_ripple"].value
    assert found == pytest.approx(np.ptp(later), rel=0.03)
    shifted = Recording(run.time + 7.0, run.channels, run.units, run.meta)
    assert metrics.evaluate(shifted)["torsion_bar_ripple"].value == pytest.approx(found, rel=1e-9)


def test_catch_up_sweeps_as_it_says():
    """Turns round at both ends, at rest; the mid-sweep speed is what was asked for."""
    manoeuvre = manoeuvres.make("catch-up", rates=(np.radians(100.0), np.radians(700.0)))
    time = np.arange(0, manoeuvre.duration, 1e-3)
    angle, speed = manoeuvre.hand(time, manoeuvre.amplitude)
    assert np.abs(angle).max() == pytest.approx(270 * DEGREE, rel=1e-4)
    assert np.abs(np.gradient(angle, 1e-3) - speed)[2:-2].max() < 0.1
    assert np.abs(speed).max() == pytest.approx(np.radians(700.0), rel=0.01)
