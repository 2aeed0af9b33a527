"""Crosswind against motions in closed form."""

import numpy as np
import pytest

from steer_env import manoeuvres, metrics
from steer_env.manoeuvres import crosswind as wind
from steer_env.recording.recording import DEGREE
from steer_env.vehicle import cars
from steer_env.vehicle.chassis.common.interface import WIND_FORCE, WIND_MOMENT
from tests.steer_env.checks import burst, check, check_alike, check_refused, refusals
from tests.synthetic.crosswind import SPEED, free, gusts
from tests.synthetic.faults import noisy
from tests.synthetic.recordings import changed, mirrored, recording


def constant(rate):
    """A steady sine of yaw rate, as random wind that is the same in each 10 s."""
    time = np.arange(round(60 * rate)) / rate
    yaw = DEGREE * np.sin(2 * np.pi * 0.3 * time)
    return recording("crosswind-free", time, yaw_rate=yaw, vehicle_speed=np.full(time.size, SPEED))


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
@pytest.mark.parametrize("synthetic", [gusts, free])
def test_closed_forms(synthetic, rate):
    """Within 1 %: the low-pass takes 0.2 % of 1 - cos at 1 Hz, the parabola 0.1 % of its top."""
    check(*synthetic(rate), {"rest": 1e-2})


def test_left_and_right_are_alike():
    clean = gusts(200.0)[0]
    check_alike(clean, mirrored(clean), rel=1e-9)


def test_random_wind_has_an_rms_and_no_events():
    found = metrics.evaluate(constant(100.0))
    assert found["crosswind_yaw_rate_rms"].value == pytest.approx(np.sqrt(0.5), rel=2e-3)
    assert len(found["crosswind_yaw_rate_rms"].repeats) == 6
    others = [value.reason for name, value in found.items() if name != "crosswind_yaw_rate_rms"]
    assert all("say when the gust began" in text for text in others)
    assert "less than 20 s of random wind" in refusals(constant(100.0).between(0, 15))["crosswind_yaw_rate_rms"]


def test_bad_recordings_are_refused():
    clean = gusts(100.0)[0]
    every = set(metrics.available("crosswind"))
    turned = changed(clean, handwheel_angle=10 * DEGREE * np.sin(clean.time))
    for reason, bad in {
        "check gust_start_s, gust_interval_s and gust_count": clean.between(1.5, 60.0),
        "on average, not 100 km/h": changed(clean, vehicle_speed=0.8 * clean["vehicle_speed"]),
        "handwheel_angle is not held: keep it within 3 deg": turned,
    }.items():
        check_refused(bad, reason)
    assert not metrics.evaluate(turned, "crosswind-free")["crosswind_yaw_rate_peak"].reason
    assert refusals(clean, gust_start_s=0.1).keys() == every
    without = refusals(clean.without("handwheel_torque"))
    assert without.keys() == {"crosswind_handwheel_torque_peak"}
    assert refusals(burst(clean, "yaw_rate")).keys() == {
        "crosswind_yaw_rate_peak",
        "crosswind_yaw_rate_rms",
    }
    assert refusals(clean.without("lateral_acceleration")).keys() == every - {"crosswind_yaw_rate_rms"}
    weak = changed(clean, yaw_rate=0.02 * clean["yaw_rate"])
    assert (
        "does not stand out of its noise" in refusals(noisy(weak, np.random.default_rng(0)))["crosswind_yaw_rate_peak"]
    )


def test_the_side_force():
    """At 20 m/s on 100 km/h 2 kN; odd in the wind; a strip's force lasts its length."""
    beta, squared = np.arctan(20 / SPEED), SPEED**2 + 400
    assert wind.side_force(np.array(20.0), SPEED) == pytest.approx(0.5 * 1.2 * 2.0 * 2.3 * beta * squared)
    gust = manoeuvres.make("crosswind", length=30.0)
    t = np.arange(0, gust.duration, 1e-3)
    force, moment = gust.others[WIND_FORCE](t), gust.others[WIND_MOMENT](t)
    assert np.abs(force).max() == pytest.approx(wind.side_force(np.array(20.0), SPEED))
    assert np.trapezoid(force[t < 10], t[t < 10]) == pytest.approx(force.max() * 30.0 / SPEED, rel=1e-6)
    assert np.trapezoid(force, t) == pytest.approx(0.0, abs=1e-6)
    assert moment == pytest.approx(0.3 * force)
    assert gust.meta["gust_start_s"] == t[np.flatnonzero(force)[0] - 1]
    with pytest.raises(ValueError, match="length is 500 m: at 100 km/h a gust must be over in 4 s"):
        manoeuvres.make("crosswind", length=500.0)


def test_random_wind_is_seeded():
    t = np.arange(1, 60001) * 1e-3
    one, same, other = (manoeuvres.make("crosswind", seed=seed).others[WIND_FORCE](t) for seed in (1, 1, 2))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)
    assert 0.5 < one.std() / wind.side_force(np.array(5.0), SPEED) < 1.5


@pytest.mark.parametrize(("law", "test"), [("lugre", "crosswind"), ("masing", "crosswind-free")])
def test_the_default_car_is_plausible(law, test):
    """2 kN on 1400 kg: 1.4 m/s2 and more, with the yaw that it brings; the deviation is that of the path, to 5 %."""
    run = manoeuvres.drive(cars.load(), manoeuvres.make(test, events=2), law)
    found = metrics.evaluate(run)
    assert not any(value.reason for value in found.values())
    assert 1.4 < found["crosswind_lateral_acceleration_peak"].value < 2.0
    assert 3.0 < found["crosswind_yaw_rate_peak"].value < 5.0
    path = run["y"][3999]
    assert found["crosswind_lateral_deviation"].repeats[0] == pytest.approx(path, rel=0.05)
    last = "torque" if test == "crosswind" else "angle"
    assert 0.1 < found[f"crosswind_handwheel_{last}_peak"].value < 5.0


def test_random_wind_on_the_default_car():
    run = manoeuvres.drive(cars.load(), manoeuvres.make("crosswind", seed=3, duration=30.0))
    found = metrics.evaluate(run)
    assert run.meta["wind_seed"] == 3
    assert 0.1 < found["crosswind_yaw_rate_rms"].value < 2.0
