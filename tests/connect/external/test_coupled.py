"""A steering with a vehicle in Python that turns round, and drives backwards."""

import math

import numpy as np
import pytest

from steer_env.connect.external import Coupled, Coupling, CouplingError
from steer_env.vehicle import cars, plant

RATE = 20.0  # of the yaw angle [rad/s]


class Turning:
    """A vehicle that turns at a constant rate and wraps its yaw angle; its speed changes its sign at a time [s]."""

    name, takes, meta = "turning", ("rack_travel", "rack_speed"), {}
    gives = ("rack_force", "vehicle_speed", "yaw_angle")

    def __init__(self, turns_back):
        self.turns_back = turns_back

    def start(self, speed):
        self.time = 0.0
        return self.step(np.zeros(2), 0)

    def step(self, taken, samples):
        self.time += 1e-3 * samples
        speed = -20.0 if self.time >= self.turns_back else 20.0
        yaw = 3.0 + RATE * self.time
        return np.array([0.0, speed, math.atan2(math.sin(yaw), math.cos(yaw))])


def driven(turns_back=math.inf, samples=1000):
    """Channels of a run with the hands off."""
    p = cars.load("compact").plant(speed=20.0)
    coupled = Coupled(Turning(turns_back), 20.0, Coupling())
    state, _ = coupled.settled(p)
    record = np.zeros((samples, len(coupled.channels(p))))
    coupled.run(p, state, np.zeros((samples, len(plant.INPUTS))), record, 1)
    return dict(zip([name for name, _ in coupled.channels(p)], record.T))


def test_a_yaw_angle_that_wraps_goes_on():
    expected = RATE * 1e-3 * np.arange(1, 1001)  # three turns
    np.testing.assert_allclose(driven()["yaw_angle"], expected, atol=1e-9)


@pytest.mark.parametrize("time", [0.0, 0.5])
def test_a_vehicle_that_drives_backwards_is_told(time):
    with pytest.raises(CouplingError, match=rf"turning gives vehicle_speed = -20 m/s at {time:g} s, .* other sign"):
        driven(turns_back=time - 1e-9)
