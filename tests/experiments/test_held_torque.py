"""The page on the held torque: its comparison follows from the numbers."""

import pytest

from steer_env import friction
from steer_env.experiments.studies import friction_laws, held_torque
from steer_env.vehicle import cars


@pytest.fixture(scope="module")
def results():
    return held_torque.collect(cars.load(), ("masing", "dahl"))


def test_the_comparison_is_repeated_and_its_cause_named(results):
    found = held_torque.compare(results)
    assert found.vibrates
    assert found.damper_is_cause
    assert not found.fed  # the lighter damper ends what the assist feeds
    assert found.step_is_small


def test_a_vibration_that_outlasts_the_lighter_damper_is_told(results):
    lasting = results._replace(tests=[test._replace(lasting=1.0) for test in results.tests])
    assert {each.masing.assist for each in held_torque.compare(lasting).fed} == {"on", "off"}


def test_without_a_difference_the_comparison_says_so(results):
    calm = [test._replace(ripple=1e-3, ripple_fine=2e-3, lasting=0.1) for test in results.tests]
    found = held_torque.compare(results._replace(tests=calm))
    assert not found.vibrates
    assert not found.fed
    assert not found.step_is_small
    assert found.step_change == pytest.approx(1.0)


def test_a_law_with_its_own_damper_is_the_one_of_the_comparison(results):
    """Masing has no damper by default, so that both parts of the page hold the same test."""
    bare = {test.calibration: test for test in results.tests if test[0] == "on" and test[2:4] == ("masing", 0.0)}
    own = {each.calibration: each for each in results.laws if each.law == "masing"}
    assert friction.make("masing").sigma_1 == 0.0
    for calibration in friction_laws.CALIBRATIONS:
        expected = bare[calibration.title].ripple
        assert own[calibration.title].ripple == pytest.approx(expected, rel=0.02, abs=2e-5)


def test_the_file_holds_every_number(results):
    _, data = held_torque.build_page(results, "compact")
    assert len(data["tests"]) == 24
    assert {row["law"] for row in data["laws"]} == {"masing", "dahl"}
