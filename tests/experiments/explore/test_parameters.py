"""The fields of the page against the constructors, and packed numbers against those of Python's plants."""

import numpy as np
import pytest

from steer_env import friction
from steer_env.experiments.explore import packing, parameters
from steer_env.friction import gear
from steer_env.friction.numerics.packing import numbers
from steer_env.vehicle import cars, chassis
from tests.experiments.explore.cases import QUICK

FEW = [*QUICK, ("stribeck", "single_track")]  # whose torque falls with the speed


def test_a_changed_car_is_that_of_a_car_file():
    """Every key of the page, as a car file takes it; a share of the friction turns the functions of the assist on."""
    car = cars.load("compact")
    changes = {"column.K_tb": 150.0, "column.I1": 0.05, "column.I2": 0.06, "column.C2": 0.8}
    changes |= {"steering.pinion_radius": 0.0071, "steering.friction_load": 0.05}
    changes |= {"chassis.front_cornering_stiffness_factor": 1.3, "chassis.rear_cornering_stiffness_factor": 1.1}
    by_speed = {"assist.boost_scale": 0.9, "assist.friction_share": 0.4, "assist.handwheel_damping": 0.3}
    by_speed |= {"assist.return_gain": 2.0}
    given = cars.load("compact", changes={**changes, **{key: [value] for key, value in by_speed.items()}})
    values = {**changes, **by_speed, "load": 120.0, "speed_kph": 90.0, "friction.F_c": 1.1}
    for body in chassis.available():
        law = friction.make("lugre", F_c=1.1)
        expected = given.loaded(120.0).plant(law, 90.0 / 3.6, robot=True, chassis=body)
        found = parameters.plant(car, "lugre", body, values)
        np.testing.assert_array_equal(numbers(found), numbers(expected))


def test_a_car_without_changes_is_the_car_with_its_functions_off():
    car = cars.load("compact")
    found = parameters.plant(car, "lugre", "single_track", {})
    own = car.plant("lugre", robot=True)
    assert not any(np.any(getattr(function, "gain", 0.0)) for function in found.assist.functions)
    assert found._replace(assist=None, chassis=None, strut=None, tyre=None) == own._replace(
        assist=None, chassis=None, strut=None, tyre=None
    )
    np.testing.assert_array_equal(found.assist.boost, own.assist.boost)
    np.testing.assert_array_equal(found.assist.damping, own.assist.damping)


def test_a_car_with_functions_that_change_with_the_speed_is_itself():
    car = cars.load("compact_tuned")
    own = car.plant("lugre", robot=True)
    np.testing.assert_array_equal(numbers(parameters.plant(car, "lugre", "single_track", {})), numbers(own))


@pytest.mark.parametrize("law", ["masing,efficiency=0.88@gear", "lugre@column_eps"])
def test_an_efficiency_is_that_of_a_gear_that_does_not_lock_itself(law):
    (q,) = (q for q in parameters.every(cars.load("compact"), law, "single_track") if q.name.endswith(".efficiency"))
    assert (q.least, q.most, q.above) == (gear.LEAST_EFFICIENCY, 1.0, False)
    for value in (0.9 * q.least, 1.01):
        with pytest.raises(ValueError, match=r"efficiency must be finite and at least 0\.01 and at most 1"):
            friction.varied(law, {q.name.removeprefix("friction."): value})


@pytest.mark.parametrize(("law", "body"), FEW)
def test_the_limits_of_a_field_are_those_of_python(law, body):
    car = cars.load("compact")
    for q in parameters.every(car, law, body):
        assert q.least <= q.low <= q.value <= q.high <= q.most, q.name
        assert "{}" in q.refusal
        for limit, beyond in ((q.least, -1.0), (q.most, 1.0)):
            if np.isfinite(limit):
                key = q.refusal.partition(" must be")[0].split()[-1]
                with pytest.raises(ValueError, match=f"{key} must be"):
                    parameters.plant(car, law, body, {q.name: limit + beyond * max(1e-6 * abs(limit), 1e-6)})


def test_a_number_that_no_polynomial_follows_is_refused():
    one = parameters.Parameter("x", "", "x", "1", -1.0, 1.0, 0.5, "{}", -1.0, 1.0, False)
    with pytest.raises(ValueError, match="follows no polynomial"):
        packing.dependences([one], lambda values: np.array([abs(values["x"])]))
