"""What every device keeps to: names, options, and the sentences of what cannot be."""

import pytest

from steer_env.live import devices


@pytest.mark.parametrize("name", devices.available())
def test_every_option_has_a_default_and_a_name_that_is_told(name):
    known = devices.options(name)
    assert "clock" not in known
    device = devices.make(name)
    assert device.name == name
    assert device.hands in ("angle", "torque")
    assert device.about
    with pytest.raises(ValueError, match=f"the device {name} has no option 'colour'; it has "):
        devices.make(name, colour="red")


def test_unknown_devices_are_told():
    with pytest.raises(ValueError, match=r"unknown device 'hovercraft'; available: .*fake, .*keyboard"):
        devices.make("hovercraft")


def test_options_are_taken_as_text():
    made = devices.make("fake", max_torque="3.5", bits="14")
    assert made.max_torque == 3.5
    with pytest.raises(ValueError, match="max_torque must be a number, got 'much'"):
        devices.make("fake", max_torque="much")
    with pytest.raises(ValueError, match="bits must be"):
        devices.make("fake", bits="14.5")
