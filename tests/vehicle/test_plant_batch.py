"""Batches of plants: each row has exactly the numbers of its plant, for every law and chassis."""

import numpy as np
import pytest

from steer_env import friction
from steer_env.friction.numerics import packing
from steer_env.vehicle import cars, plant, road
from tests.by_law import EACH_LAW

CAR = cars.load("compact")


def same(one, other):
    """Whether two nested tuples hold the same numbers."""
    if isinstance(one, tuple):
        return type(one) is type(other) and all(map(same, one, other))
    return np.array_equal(np.asarray(one), np.asarray(other)) and np.asarray(one).dtype == np.asarray(other).dtype


@pytest.mark.parametrize("chassis", cars.SPEEDS)
@pytest.mark.parametrize("law", EACH_LAW)
def test_a_plant_comes_back_from_its_numbers(law, chassis):
    template = CAR.plant(law, chassis=chassis)
    loaded = CAR.loaded(200.0).plant(law, speed=20.0, chassis=chassis)
    rows = np.array([packing.numbers(template), packing.numbers(loaded)])
    assert same(packing.of_row(template, rows, 0), template)
    assert same(packing.of_row(packing.outline(template), rows, 0), template)
    other = packing.of_row(template, rows, 1)
    assert same(other._replace(tyre=template.tyre), loaded)


def test_slices_are_those_of_the_numbers():
    p = CAR.plant("masing", chassis="two_track", road=road.iso8608(1, "C"))
    numbers, tables = packing.pack(p)
    places = packing.slices(p)
    assert np.array_equal(numbers, packing.numbers(p))
    assert [numbers.size, tables.size] == [
        sum(e.size for e in packing.leaves(p) if e.table == t) for t in (False, True)
    ]
    assert numbers[places["column.K_tb"]] == p.column.K_tb
    assert numbers[places["robot"]] == p.robot
    assert np.array_equal(numbers[places["friction.k"]], p.friction.k)
    assert np.array_equal(numbers[places["assist.boost"]], p.assist.boost.ravel())
    assert max(place.stop for place in places.values()) == numbers.size
    assert not any(name.startswith(("strut", "chassis.road")) for name in places)


@pytest.mark.parametrize("chassis", cars.SPEEDS)
@pytest.mark.parametrize("law", ["lugre", "masing"])
def test_rows_run_as_their_plants_alone(law, chassis):
    """Three cars of different load, speed and friction are equal to the bit; rows outside the range do not change."""
    rng = np.random.default_rng(0)
    plants = [
        CAR.loaded(load).plant(friction.make(law, F_c=F_c), speed=speed, road_friction=mu, chassis=chassis)
        for load, F_c, speed, mu in ((0.0, 0.9, 27.0, 1.0), (250.0, 0.5, 20.0, 0.7), (100.0, 1.4, 33.0, 0.9))
    ]
    settled = [plant.settled(p) for p in plants]
    states, channels = (np.array([pair[k] for pair in settled]) for k in (0, 1))
    rows, finite = np.array([packing.numbers(p) for p in plants]), np.zeros(3, bool)
    inputs = np.zeros((3, 40, len(plant.INPUTS)))
    inputs[:, :, plant.HAND] = rng.uniform(-3.0, 3.0, (3, 40))
    third, outline = states[2].copy(), packing.outline(plants[0])
    for _ in range(10):
        plant.run_rows(outline, rows, states, inputs, channels, finite, 0, 2)
    assert finite.tolist() == [True, True, False]
    assert np.array_equal(states[2], third)
    for i in range(2):
        state, row = settled[i][0].copy(), np.zeros((1, channels.shape[1]))
        for _ in range(10):
            plant.run(plants[i], state, inputs[i], row, 1)
        assert np.array_equal(state, states[i])
        assert np.array_equal(row[0], channels[i])
