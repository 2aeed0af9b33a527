"""The highest speed at which the driver passes a lane-change course."""

from dataclasses import replace

import pytest

from steer_env import manoeuvres
from steer_env.experiments.studies import entry_speed
from steer_env.vehicle import cars

CAR = cars.load()
KPH = 1.0 / 3.6


def test_a_hopeless_speed_is_lost_control_or_cones():
    assert not entry_speed.passes(CAR, "lugre", replace(manoeuvres.make("double-lane-change"), speed=150.0 * KPH))


@pytest.mark.whole
def test_maximum_entry_speed():
    """The driver passes at what is returned and not a tolerance above; the speed is that of a passenger car."""
    speed = entry_speed.maximum_entry_speed(CAR, "lugre", tolerance=1.0)
    assert 80.0 * KPH < speed < 130.0 * KPH
    test = manoeuvres.make("double-lane-change")
    assert entry_speed.passes(CAR, "lugre", replace(test, speed=speed))
    assert not entry_speed.passes(CAR, "lugre", replace(test, speed=speed + 1.0))


def test_maximum_entry_speed_refuses():
    with pytest.raises(ValueError, match="weave has no driver"):
        entry_speed.maximum_entry_speed(CAR, "lugre", "weave")
    blind = replace(manoeuvres.make("double-lane-change"), driver=lambda car, p: lambda time, row: (0.0, 0.0))
    with pytest.raises(ValueError, match="a cone falls at 30 km/h already"):
        entry_speed.maximum_entry_speed(CAR, "lugre", blind)
