"""The WebAssembly module of the car against the native plant."""

import numpy as np
import pytest

from steer_env import friction, manoeuvres
from steer_env.experiments.explore import module, parameters
from steer_env.manoeuvres.common import driving
from steer_env.vehicle import cars, chassis, plant
from tests.experiments.explore.running import Running

QUICK = [("lugre", "single_track"), ("masing", "two_track")]
EACH = [
    *QUICK,
    *(
        pytest.param(law, body, marks=pytest.mark.whole)
        for law in friction.available()
        for body in chassis.available()
        if (law, body) not in QUICK
    ),
]
SECONDS, AMPLITUDE = 10.0, 0.3


@pytest.mark.parametrize(("law", "body"), EACH)
def test_a_weave_is_that_of_the_native_plant(law, body):
    car = cars.load("compact")
    p = car.plant(law, robot=True, chassis=body)
    own, begun = (parameters.plant(car, each, body, {}) for each in (law, module.BEGINNING))
    running = Running(module.advancing(own), module.beginning(begun), own, begun)
    u = driving.inputs(manoeuvres.make("weave"), AMPLITUDE, SECONDS)
    native = driving.run(p, manoeuvres.make("weave"), u)
    found = running.run(u)
    span = np.ptp(native, axis=0)
    for (name, unit), one, other, most in zip(plant.channels(p), found.T, native.T, span):
        assert np.abs(one - other).max() <= 1e-10 * most, f"{name} [{unit}]"
    assert span[plant.CHANNEL["handwheel_torque"]] > 1.0
    assert running.imports == []
