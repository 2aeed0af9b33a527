"""Manoeuvres as driven, and what the friction law changes in them."""

from dataclasses import replace

import numpy as np
import pytest

from steer_env import manoeuvres, metrics
from steer_env.manoeuvres.common import driving
from steer_env.vehicle import cars, plant
from tests.by_law import FEW, OTHERS

CAR = cars.load()
HANDS = (
    "weave",
    "hold",
    "parking",
    "step-steer",
    "sine",
    "frequency-response",
    "random-steer",
    "steady-circle-speed",
    "transition",
    "road",
)


@pytest.fixture(scope="module")
def weaves():
    return {law: manoeuvres.drive(CAR, manoeuvres.make("weave"), law) for law in FEW}


@pytest.mark.parametrize("hand", [manoeuvres.make(name).hand for name in HANDS])
def test_the_rate_is_the_derivative(hand):
    t = np.linspace(0.01, 9.0, 500)
    step = 1e-6
    difference = (hand(t + step, 0.2)[0] - hand(t - step, 0.2)[0]) / (2.0 * step)
    assert hand(t, 0.2)[1] == pytest.approx(difference, abs=1e-8)


def test_weave_reaches_its_acceleration(weaves):
    for recording in weaves.values():
        ay = recording["lateral_acceleration"]
        assert 0.5 * np.ptp(ay[len(ay) // 2 :]) == pytest.approx(2.0, rel=0.01)
        assert recording["vehicle_speed"][0] == pytest.approx(100 / 3.6)


def test_the_robot_keeps_the_handwheel_on_its_sine(weaves):
    recording = weaves["lugre"]
    angle, _ = manoeuvres.make("weave").hand(recording.time, recording.meta["amplitude_rad"])
    assert np.array_equal(recording["handwheel_angle"], angle)


def test_rig_carries_friction_alone():
    """Unloaded and unassisted, the column follows the hand and the hand feels the saturated friction and C2."""
    recording = manoeuvres.drive(CAR, manoeuvres.make("rig"), "coulomb")
    assert np.all(recording["rack_force"] == 0.0)
    assert np.all(recording["motor_torque"] == 0.0)
    middle = np.abs(recording["handwheel_angle"]) < 0.05
    settled = recording.time > 10.0
    speed = 0.35 * 2.0 * np.pi * 0.2
    torque = np.abs(recording["handwheel_torque"][middle & settled]).mean()
    assert torque == pytest.approx(0.9 + 0.6 * speed, rel=0.01)


@pytest.mark.parametrize("chassis", ["single_track", "two_track"])
def test_step_steer_reaches_its_acceleration(chassis):
    recording = manoeuvres.drive(CAR, replace(manoeuvres.make("step-steer"), chassis=chassis))
    late = (recording.time > 5.0) & (recording.time <= 6.0)
    assert recording["lateral_acceleration"][late].mean() == pytest.approx(4.0, rel=1e-3)
    right = (recording.time > 15.0) & (recording.time <= 16.0)
    assert recording["lateral_acceleration"][right].mean() == pytest.approx(-4.0, rel=0.02)  # friction remembers
    assert 200.0 < np.degrees(recording["handwheel_speed"].max()) < 500.0
    assert recording["vehicle_speed"][late].mean() == pytest.approx(80.0 / 3.6, rel=0.01)
    assert recording.meta["chassis"] == chassis


def test_parking_goes_from_lock_to_lock():
    recording = manoeuvres.drive(CAR, manoeuvres.make("parking", cycles=1))
    lock = CAR.steering["rack_limit"] / CAR.steering["pinion_radius"]
    assert np.abs(recording["handwheel_angle"]).max() == pytest.approx(lock, rel=1e-6)
    moving = (np.abs(recording["handwheel_angle"]) < 0.8 * lock) & (recording.time > 6.0)  # after the rise
    rate = np.degrees(np.abs(recording["handwheel_speed"][moving]))
    assert 60.0 < rate.min() < rate.max() < 90.0
    assert np.abs(recording["vehicle_speed"]).max() < 0.05


def test_hold_settles_to_its_torque():
    recording = manoeuvres.drive(CAR, manoeuvres.make("hold"), "lugre")
    assert np.all(recording["handwheel_torque"][1000:] == 2.0)
    late = recording.time > 4.5
    assert np.ptp(recording["torsion_bar_torque"][late]) < 0.05
    assert recording["yaw_rate"][-1] > 0.05


def test_mirror_image():
    """Steering right instead of left changes every sign and nothing else."""
    weave = manoeuvres.make("weave", cycles=1)
    p = manoeuvres.build_plant(CAR, weave, "masing")
    left, right = (driving.run(p, weave, manoeuvres.inputs(weave, a, 5.0)) for a in (0.2, -0.2))
    for name in ("handwheel_torque", "column_angle", "rack_force", "yaw_rate", "lateral_acceleration", "roll_angle"):
        i = plant.CHANNEL[name]
        assert np.array_equal(left[:, i], -right[:, i]), name
    loads = [plant.CHANNEL[f"wheel_load_front_{side}"] for side in ("left", "right")]
    assert np.array_equal(left[:, loads], right[:, loads[::-1]])


def test_unknown_manoeuvre():
    with pytest.raises(ValueError, match=r"unknown manoeuvre 'weav'.*weave"):
        manoeuvres.make("weav")


def test_a_spin_is_refused():
    with pytest.raises(ValueError, match="hold: the car spins; ask for less than 10"):
        manoeuvres.drive(CAR, replace(manoeuvres.make("hold", torque=10.0), speed=30.0, duration=10.0), "lugre")


def test_an_acceleration_out_of_reach_is_refused():
    with pytest.raises(ValueError, match="no handwheel amplitude reaches 30"):
        manoeuvres.drive(CAR, replace(manoeuvres.make("weave"), lateral_acceleration=30.0))


def test_laws_agree_where_they_must_and_differ_where_they_must(weaves):
    """Dry laws share one calibration, so on-centre torque agrees within 5 %; without dry friction the loop changes."""
    sets = {law: metrics.evaluate(recording) for law, recording in weaves.items()}
    dry = [law for law in FEW if law != "viscous"]
    for name in ("torque_at_0g", "steering_sensitivity_at_0p1g", "yaw_rate_gain"):
        values = [sets[law][name].value for law in dry]
        assert max(values) / min(values) - 1.0 < 0.05, name
    # The car's response to the wheel is not friction's business.
    gains = [sets[law]["yaw_rate_gain"].value for law in FEW]
    assert max(gains) / min(gains) - 1.0 < 0.02
    # Where the hand reverses, Masing's corner and LuGre's rounding part by more than a hand can miss, 20 mN m.
    parted = weaves["masing"]["handwheel_torque"] - weaves["lugre"]["handwheel_torque"]
    assert np.abs(parted[10_000:-10_000]).max() > 0.02
    # What the hand feels off the plateau of the loop is: at its tip, the dry torque remains while the motion stops.
    assert sets["lugre"]["peak_handwheel_torque"].value - sets["viscous"]["peak_handwheel_torque"].value > 0.1


@pytest.mark.whole
@pytest.mark.parametrize("law", OTHERS)
def test_the_other_laws_share_the_calibration(weaves, law):
    """A Stribeck effect and a branch that damps change the on-centre torque by a few per cent, and nothing else."""
    base = metrics.evaluate(weaves["lugre"])
    found = metrics.evaluate(manoeuvres.drive(CAR, manoeuvres.make("weave"), law))
    for name, share in (("torque_at_0g", 0.06), ("steering_sensitivity_at_0p1g", 0.05), ("yaw_rate_gain", 0.02)):
        assert found[name].value == pytest.approx(base[name].value, rel=share), name
