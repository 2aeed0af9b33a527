"""The design of the assist: the torque build-up, the tables of the packaged cars, and what they are for."""

import json
import math
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from steer_env import friction
from steer_env.friction import sites
from steer_env.friction.numerics import toml
from steer_env.vehicle import cars
from steer_env.vehicle.analysis import free_control
from steer_env.vehicle.constants import GRAVITY as G
from steer_env.vehicle.steering import margins
from steer_env.vehicle.steering.torque_build_up import torque_build_up
from tests.maintain.__main__ import run as maintain
from tests.tools import assist_design

KPH = 1.0 / 3.6


def test_build_up():
    """22 N m/g on centre, 4 N m/g far from it, odd; by hand at 0.11 g."""
    slope = [(torque_build_up(a + 1e-6) - torque_build_up(a - 1e-6)) / 2e-6 * G for a in (0.0, 10.0)]
    assert slope == pytest.approx([22.0, 4.0], abs=1e-6)
    assert torque_build_up(-0.11 * G) == pytest.approx(-(4.0 * 0.11 + 18.0 * 0.11 * math.tanh(1.0)))


@pytest.mark.whole
@pytest.mark.filterwarnings("ignore:rear_drive_saloon with free hands")  # -0.003 at 220 km/h, where 0 is wanted
@pytest.mark.parametrize(
    "name", [name for name in cars.available() if name not in ("compact_tuned", "compact_steer_by_wire")]
)
def test_packaged_cars_have_the_designed_assist(name):
    text = files("steer_env.vehicle").joinpath("data", "cars", f"{name}.json").read_text(encoding="utf-8")
    given, found = json.loads(text)["assist"], assist_design.design(cars.load(name))
    np.testing.assert_allclose(given["speeds"], found.speeds, atol=1e-4)
    np.testing.assert_array_equal(given["torques"], found.torques)
    np.testing.assert_allclose(given["boost"], found.boost, atol=0.0101)  # a last digit may round the other way
    np.testing.assert_array_equal(given["damping"], found.damping)


@pytest.mark.parametrize("name", cars.available())
def test_loops_keep_their_margins(name):
    """Also while the gear of that kind of steering slides, with its efficiency."""
    car = cars.load(name)
    passed = sites.transmissions(friction.resolve(f"lugre@{car.kind}"))
    for speed in car.assist.speeds:
        found = margins.worst_margins(car.column, car.assist, speed, passed)
        assert found.stable
        assert math.degrees(found.phase) >= 30.0
        assert 20.0 * math.log10(found.gain) >= 6.0


def test_a_slow_turn_takes_the_torque_of_the_build_up():
    """Torsion-bar torque of the whole car without friction, at 100 km/h, against the curve it is designed for."""
    car = cars.load()
    p = car.plant(friction.make("viscous", sigma_2=0.0), 100.0 * KPH)
    A, rack = assist_design.rack_torque(car, 100.0 * KPH)
    for wanted in (0.05, 0.1, 0.2, 0.3):
        torque = float(torque_build_up(wanted * G))
        boost = np.interp(torque, p.assist.torques, p.assist.boost[4])
        assert torque + boost == pytest.approx(float(np.interp(wanted * G, A, rack)), rel=0.025)


@pytest.mark.parametrize("chassis", ["single_track", "two_track"])
@pytest.mark.parametrize(("speed", "law"), [(50.0, "lugre"), (40.0, friction.make("viscous", sigma_2=0.0))])
def test_the_default_car_settles_with_the_hands_off(chassis, speed, law):
    """3 N m for 0.3 s: no spin, and within 6 s less than 0.5 deg/s of yaw remain and fall; so at half the step."""
    p = cars.load().plant(law, speed, chassis=chassis)
    assert [free_control.pulse(p, substeps=n).verdict for n in (1, 2)] == ["settles", "settles"]


def test_a_car_that_cannot_corner_is_refused():
    car = cars.load()
    slippery = replace(car.tyre, coefficients=car.tyre.coefficients._replace(PDY1=0.15))
    with pytest.raises(ValueError, match=r"^compact reaches only .* too little to design an assist$"):
        assist_design.rack_torque(car._replace(tyre=slippery), 100.0 * KPH)


def test_what_the_design_cannot_reach_is_told():
    """A loop without margins is refused, a free car that stays too little damped is warned about."""
    car = cars.load()
    with pytest.raises(ValueError, match=r"^the assist of compact has no margins"):
        assist_design.design(car._replace(assist=car.assist._replace(delay=4)))
    loose = car._replace(chassis={**car.chassis, "rear_cornering_stiffness_factor": 0.8})
    with pytest.warns(
        cars.UnusualCar, match=r"compact with free hands reaches a damping ratio of .* at 50 m/s, wanted"
    ):
        assert assist_design.least_damping(loose, 50.0, 0.5) == assist_design.MOST_DAMPING


@pytest.mark.parametrize(("options", "noted"), [([], False), (["--set", "assist.boost_scale=1.15"], True)])
def test_the_printed_section_replaces_a_scale(options, noted, capsys, monkeypatch):
    """It is TOML, resets the scale that the design does not know, and says how a file takes it."""
    few = assist_design.Design(np.array([0.0, 50.0]), np.array([0.0, 5.0]), np.eye(2), np.ones(2))
    monkeypatch.setattr(assist_design, "design", lambda car: few)
    assert maintain(["design-assist", *options]) == 0
    printed = capsys.readouterr().out
    assert toml.loads(printed)["assist"] == {
        **{"speeds": [0.0, 50.0], "torques": [0.0, 5.0]},
        **{"boost": [[1.0, 0.0], [0.0, 1.0]], "damping": [1.0, 1.0], "boost_scale": 1.0},
    }
    assert "in place of its own speeds, torques, boost, boost_scale" in printed
    assert ("The boost_scale of this car has no part in the design" in printed) is noted


def test_the_functions_stay_at_the_speeds_of_the_design():
    given = [8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0]
    assist = cars.load("compact", changes={"assist.return_gain": given}).assist
    found = assist_design.functions_at(assist.functions, np.array([0.0, 50.0]))
    assert found.active_return.gain.tolist() == [8.0, np.interp(50.0, assist.speeds, given)]
