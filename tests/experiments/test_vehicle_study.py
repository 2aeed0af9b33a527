"""The study of the full vehicle, and the readings of step steer and parking, against closed forms."""

import numpy as np
import pytest

from steer_env.experiments.studies import vehicle
from steer_env.vehicle import cars


@pytest.fixture(scope="module")
def study():
    return vehicle.collect(cars.load(), "lugre")


def test_what_two_tracks_add_explains_the_difference(study):
    """With all of it off, the single track's weave is left: lateral motion and hand torque within 1 %."""
    single, two, *_, none = (row.values for row in study.peaks)
    for name in ("lateral_acceleration", "yaw_rate", "handwheel_torque"):
        assert none[name] == pytest.approx(single[name], rel=0.01), name
        # the hand torques of both differ by 0.2 %, so that there is nothing to explain
        most = 0.2 * abs(two[name] - single[name]) if name != "handwheel_torque" else 0.003 * single[name]
        assert abs(none[name] - single[name]) < most, name
    assert len(study.peaks) == 3 + len(vehicle.SWITCHES)


def test_parking_of_the_default_car(study):
    """3 to 4.5 kN between the locks; about 2 Gough moments over the arm of 0.115 m at centre."""
    assisted, unassisted = study.parking["assisted"].values, study.parking["unassisted"].values
    for found in (assisted, unassisted):
        assert 2800.0 < found["rack_force_at_centre"].value < found["rack_force_peak"].value < 4500.0
    load = 0.5 * 1400.0 * 9.80665 * 1.62 / 2.70
    gough = 0.9 * load**1.5 / (3.0 * np.sqrt(220e3))
    assert assisted["rack_force_at_centre"].value == pytest.approx(2.0 * gough / 0.1149, rel=0.05)
    # without assist the hands carry the rack force through the pinion, the friction and the damping of the column
    rate = np.radians(unassisted["parking_handwheel_rate"].value)
    expected = unassisted["rack_force_at_centre"].value * 0.00686 * 1.03 + 0.9 + 0.6 * rate
    assert unassisted["handwheel_torque_at_centre"].value == pytest.approx(expected, rel=0.01)
    assert assisted["handwheel_torque_peak"].value < 6.0
    assert unassisted["motor_torque_peak"].value == 0.0
