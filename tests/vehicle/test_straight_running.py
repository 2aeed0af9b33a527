"""Straight running, in which a drive begins: nothing moves, left equals right, and what cannot run straight is told."""

from itertools import product

import numpy as np
import pytest

from steer_env.friction.numerics.kernel import plain
from steer_env.vehicle import cars, plant, road
from steer_env.vehicle.chassis import chassis_of, two_track
from steer_env.vehicle.chassis.common import equilibrium
from steer_env.vehicle.layout import plant_layout, state_size
from tests.by_law import pairs

MOVES = {"x", "distance"}  # and nothing else


def settled(car="compact", chassis="two_track", speed=25.0, **rest):
    p = cars.load(car).plant("lugre", speed=speed, chassis=chassis, **rest)
    return p, plant.initial_state(p)


def straight(p, state, seconds=5):
    """The state after so many seconds without any input."""
    state = state.copy()
    assert plant.run(p, state, np.zeros((1000 * seconds, len(plant.INPUTS))), np.zeros((1, len(plant.channels(p)))), 1)
    return state


def speed_of(p, state):
    return float(plain(chassis_of(p.chassis).speed)(p.chassis, state[plant_layout(p).chassis :]))


SPEEDS = (0.0, 3.0, 6.0, 12.0, 22.0, 27.7, 35.0)
DRIVEN = [
    row
    for row in product(cars.available(), ("single_track", "two_track"), SPEEDS, (1.0, 0.2))
    # A single track rolls, and the assist of the tuned compact is compiled for one chassis.
    if row[1] == "two_track" or (row[2] > 0.0 and row[0] != "compact_tuned")
]


@pytest.mark.parametrize(("car", "chassis", "speed", "grip"), pairs(DRIVEN))
def test_nothing_moves(car, chassis, speed, grip):
    """In the next five seconds, gear and shift included; the held speed is exact."""
    p, begun = settled(car, chassis, speed, road_friction=grip)
    moved = np.abs(straight(p, begun) - begun) / (1.0 + np.abs(begun))
    names = [name.split(".")[-1] for name, _ in plant.state_names(p)]
    assert {name: m for name, m in zip(names, moved.tolist()) if m > 1e-9 and name not in MOVES} == {}
    assert speed_of(p, begun) == pytest.approx(speed, abs=1e-9)
    assert plant.initial_speed(p) == pytest.approx(speed, abs=1e-9)


@pytest.mark.parametrize("car", cars.available())
@pytest.mark.parametrize(("speed", "grade", "grip"), [(70.0, 0.0, 1.0), (3.0, -0.2, 0.1), (20.0, 0.15, 0.1)])
def test_a_speed_that_no_car_holds_is_what_five_seconds_leave_of_it(car, speed, grade, grip):
    """Beyond the engine, and on slopes of ice."""
    p, begun = settled(car, speed=speed, road_friction=grip, road=road.make_road(grade=grade))
    assert plant.begin(p, np.zeros(state_size(p))) == plant.RUN_IN
    assert np.isfinite(begun).all()
    assert 0.1 < abs(speed_of(p, begun) - speed) < 25.0


def test_a_lower_gear_holds_the_speed_on_a_slope():
    p, begun = settled(speed=16.0, road=road.make_road(grade=0.15))
    assert plant.begin(p, np.zeros(state_size(p))) == plant.SETTLING
    assert speed_of(p, straight(p, begun)) == pytest.approx(16.0, abs=1e-9)


@pytest.mark.parametrize(
    ("ground", "runs"),
    [
        (road.make_road(grade=0.03), True),
        (road.make_road(bank=0.03), False),
        (road.make_road(friction=(0.4, 0.9)), False),
        (road.make_road(friction=(0.4, 0.4)), True),
    ],
)
def test_five_seconds_only_where_a_car_does_not_run_straight(ground, runs):
    p, begun = settled(road=ground)
    samples = plant.begin(p, np.zeros(state_size(p)))
    assert samples == (plant.SETTLING if runs else plant.RUN_IN)
    if runs:
        assert np.abs(straight(p, begun) - begun)[plant_layout(p).chassis + two_track.YAW] == 0.0


@pytest.mark.parametrize("n", [1, 5, equilibrium.MOST_UNKNOWNS])
def test_the_linear_equations_against_numpy(n):
    rng = np.random.default_rng(n)
    J, r = np.zeros((equilibrium.MOST_UNKNOWNS, equilibrium.MOST_UNKNOWNS)), np.zeros(equilibrium.MOST_UNKNOWNS)
    J[:n, :n], r[:n] = rng.normal(size=(n, n)), rng.normal(size=n)
    J[0, 0] = 0.0 if n > 1 else J[0, 0]  # which needs another row first
    expected, found = np.linalg.solve(J[:n, :n], r[:n]), r.copy()
    assert equilibrium.solve(J.copy().ravel(), found, n)
    assert found[:n] == pytest.approx(expected, rel=1e-9)
    J[:n, 0] = 0.0
    assert not equilibrium.solve(J.ravel(), r, n)
