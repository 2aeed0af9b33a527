"""The default tolerances of ``validate``: they pass a second measurement of a car and fail another friction."""

import numpy as np
import pytest

from steer_env import manoeuvres
from steer_env.experiments.studies.common import simulation_vs_measurement
from steer_env.vehicle import cars
from tests.synthetic import faults
from tests.synthetic.recordings import recording

LOGGED = ("handwheel_angle", "handwheel_torque", "lateral_acceleration", "yaw_rate", "vehicle_speed")


def logged(law):
    """A weave at the 100 Hz of a logger."""
    given = manoeuvres.drive(cars.load(), manoeuvres.make("weave"), law)
    every = slice(None, None, round(given.rate / 100.0))
    return recording("weave", given.time[every], given.meta, **{name: given[name][every] for name in LOGGED})


@pytest.fixture(scope="module")
def weaves():
    return {law: logged(law) for law in ("lugre", "viscous")}


def measured(clean, seed):
    """What sensors with offsets, drift and noise would have stored."""
    rng = np.random.default_rng(seed)
    for change in (faults.offset, faults.angle_offset, faults.drifting, faults.noisy):
        clean = change(clean, rng)
    return clean


def passing(weaves, law, seeds, tolerances="default"):
    """Share of the measurements of a car with LuGre friction that agree with a simulation with this law."""
    allowed = simulation_vs_measurement.tolerances(tolerances)
    found = [
        simulation_vs_measurement.passes(
            simulation_vs_measurement.compare(measured(weaves["lugre"], seed), weaves[law], allowed=allowed)
        )
        for seed in seeds
    ]
    return np.mean(found)


def test_dry_friction_is_told_from_a_damper(weaves):
    assert passing(weaves, "lugre", range(2)) == 1.0
    assert passing(weaves, "viscous", range(2)) == 0.0
    assert passing(weaves, "viscous", range(1), "wide") == 1.0
