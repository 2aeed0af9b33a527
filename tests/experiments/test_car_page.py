"""The page of a car: its quantities with their ranges, its files, and one line for every mistake."""

import json
import math

import numpy as np
import pytest

from steer_env.experiments.cli.main import main
from steer_env.experiments.reports import car_page, car_quantities, car_simulated, car_suspension
from steer_env.experiments.reports.car_quantities import PUBLISHED, Quantity
from steer_env.recording.recording import DEGREE
from steer_env.vehicle import cars
from steer_env.vehicle.analysis import free_control, understeer
from steer_env.vehicle.constants import GRAVITY

OWN = """
base = "ford_escort"
[chassis]
rear_lateral_compliance = 5e-6
[steering]
compliance = 5000.0
"""

UNSTABLE = """
base = "ford_escort"
[chassis]
front_axle = 1.509
rear_axle = 0.884
front_cornering_stiffness_factor = 1.7
rear_cornering_stiffness_factor = 0.8
"""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The folder of the page of an own car whose axles yield more than those of any car."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "soft.toml").write_text(OWN, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["car", "soft.toml", "--page"]) == 0
    return folder / "car_soft"


@pytest.mark.whole
def test_every_range_has_its_quantity_and_what_is_published_its_source(page):
    quantities = json.loads((page / "car.json").read_text(encoding="utf-8"))["quantities"]
    assert set(car_quantities.ranges()) <= set(quantities)
    for name, q in quantities.items():
        assert q["value"] is not None or q["note"], name
        assert q["source"] or q["basis"] != PUBLISHED, name


def test_an_implausible_number_is_marked(page):
    data = json.loads((page / "car.json").read_text(encoding="utf-8"))
    expected = {"rear_lateral_steer", "front_aligning_steer", "front_cornering_compliance"}
    assert expected <= set(data["outside"])
    q = data["quantities"]["rear_lateral_steer"]
    assert q["value"] == pytest.approx(5e-6 * 1e3 * 180.0 / math.pi)


def test_a_quantity_without_range_or_value_is_not_rated():
    assert Quantity("G", "a", "a", 1.0, "m").plausible is None
    assert Quantity("G", "a", "a", math.nan, "m", 0.0, 1.0, PUBLISHED).plausible is None


@pytest.mark.parametrize("name", ["compact", "bmw_320i"])
def test_steady_turn_and_lag_agree_with_the_linear_model(name):
    car = cars.load(name)
    for chassis in ("single_track", "two_track"):
        linear = sum(understeer.budget(car, car_simulated.SPEED, chassis).values())
        assert car_simulated.steady(car, chassis).understeer == pytest.approx(linear, rel=0.05)
        lag = car_simulated.yaw_lag(car, chassis, free_control.FRICTIONLESS, car_simulated.SPEED)
        expected = understeer.yaw_lag(car, car_simulated.SPEED, chassis=chassis)
        assert lag == pytest.approx(expected, abs=5e-3)


@pytest.mark.whole
def test_an_unstable_car_has_a_page(tmp_path):
    """Values that need a steady turn are missing, with the reason."""
    (tmp_path / "car.toml").write_text(UNSTABLE, encoding="utf-8")
    car = cars.load(tmp_path / "car.toml")
    found = {q.name: q for q in car_page.write_car_page(tmp_path / "out", car)}
    for name in ("understeer_gradient_single_track", "yaw_lag_two_track", "yaw_frequency"):
        assert math.isnan(found[name].value)
        assert found[name].plausible is None
        assert "no steady turn" in found[name].note or "unstable" in found[name].note
    assert found["understeer_gradient"].value < 0.0
    assert found["critical_speed"].value < 100.0
    assert found["hands_off_damping_single_track"].plausible is False
    assert json.loads((tmp_path / "out" / "car.json").read_text())["quantities"]["yaw_frequency"]["value"] is None


def test_slopes_of_the_suspension_are_those_of_the_chassis():
    """Toe and camber of the packaged strut, and roll understeer as the linear model has it."""
    car = cars.load("ford_escort")
    car = car._replace(chassis={**car.chassis, "rear_bump_steer": -0.05, "rear_lateral_compliance": 1e-6})
    slopes = car_suspension.slopes(car)
    assert 0.02 * slopes.toe[0] / DEGREE == pytest.approx(-0.058, abs=2e-3)  # of the strut's data at 20 mm
    terms, roll = understeer.budget(car, 25.0), car_simulated.steady(car, "single_track", 25.0).roll
    assert terms["front roll steer"] == pytest.approx(slopes.roll_steer[0] * roll, rel=0.02)
    assert terms["rear roll steer"] == pytest.approx(slopes.roll_steer[1] * roll, rel=0.02)
    a, b, m = (car.chassis[key] for key in ("front_axle", "rear_axle", "mass"))
    force = 0.5 * m * a / (a + b)  # of a rear wheel over lateral acceleration, but for aligning torques
    assert terms["rear lateral compliance"] == pytest.approx(slopes.lateral_steer[1] * force, rel=0.05)
    curves = car_suspension.curves(car)
    assert np.gradient(curves.toe["front"], curves.travel)[30] == pytest.approx(slopes.toe[0], rel=0.01)
    wheelbase, apart = a + b, car.chassis["front_track"] - 2.0 * float(car.strut.solve(0.0, 0.0).scrub)
    turned = np.abs(curves.rack) > 1e-3
    cotangents = 1.0 / np.tan(curves.ideal_right[turned]) - 1.0 / np.tan(curves.left[turned])
    np.testing.assert_allclose(cotangents, apart / wheelbase, rtol=1e-9)
    assert curves.ratio[30] == pytest.approx(car.steering_ratio(), rel=1e-6)


def test_characteristic_speed_is_that_of_the_gradient_at_the_handwheel(page):
    q = json.loads((page / "car.json").read_text(encoding="utf-8"))["quantities"]
    gradient = math.radians(q["understeer_gradient"]["value"] + q["torsion_bar_understeer"]["value"]) / GRAVITY
    car = cars.load("ford_escort")
    speed = 3.6 * math.sqrt((car.chassis["front_axle"] + car.chassis["rear_axle"]) / gradient)
    assert q["characteristic_speed"]["value"] == pytest.approx(speed, rel=1e-3)
