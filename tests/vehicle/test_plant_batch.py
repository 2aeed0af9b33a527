"""Batches of plants: each row has exactly the numbers of its plant, for every law and chassis."""

import numpy as np
import pytest

from steer_env import friction
from steer_env.friction import level, sites
from steer_env.friction.law import LAWS
from steer_env.friction.numerics import packing
from steer_env.friction.numerics.kernel import COMPILED
from steer_env.vehicle import cars, plant, road
from tests.by_law import in_turn

CAR = cars.load("compact")


def same(one, other):
    """Whether two nested tuples hold the same numbers."""
    if isinstance(one, tuple):
        return type(one) is type(other) and all(map(same, one, other))
    return np.array_equal(np.asarray(one), np.asarray(other)) and np.asarray(one).dtype == np.asarray(other).dtype


@pytest.mark.parametrize(("law", "chassis"), in_turn(cars.SPEEDS))
def test_a_plant_comes_back_from_its_numbers(law, chassis):
    template = CAR.plant(law, chassis=chassis)
    loaded = CAR.loaded(200.0).plant(law, speed=20.0, chassis=chassis)
    rows = np.array([packing.numbers(template), packing.numbers(loaded)])
    assert same(packing.of_row(template, rows, 0), template)
    assert same(packing.of_row(packing.structure(template), rows, 0), template)
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


@pytest.mark.parametrize(("law", "chassis"), [("lugre", "two_track"), ("masing", "single_track")])
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
    third, outline = states[2].copy(), packing.structure(plant.bound(plants[0]))
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


WIDE = [
    *("lugre", "lugre@column_eps"),
    *[
        pytest.param(law, marks=pytest.mark.whole)
        for law in (*friction.available(), "coulomb@column_eps")
        if law != "lugre" and LAWS[law.partition("@")[0]].wide
    ],
]


def seven_rows(friction_text):
    """Plants that differ in what a row may have of its own; two are led by robots, which no group holds with others."""
    kinds = [
        (0.0, {"F_c": 0.9}, 27.0, 1.0, {}),
        (250.0, {"F_c": 0.5}, 20.0, 0.7, {}),
        (
            100.0,
            {"F_c": 1.4, **({"F_s": 1.6, "sigma_2": 0.5} if friction_text.startswith("lugre") else {})},
            33.0,
            0.9,
            {},
        ),
        (0.0, {"F_c": 0.9}, 9.0, 0.3, {"asymmetry": 0.3, "load": 1e-4, "position": 0.2, "temperature_rate": 0.01}),
        (50.0, {"F_c": 1.1}, 25.0, 1.0, {}),
        (0.0, {"F_c": 0.2}, 60.0, 1.1, {"asymmetry": -0.2, "temperature_rise": 20.0}),
        (120.0, {"F_c": 2.0}, 30.0, 0.8, {}),
    ]
    for i, (load, keys, speed, mu, conditions) in enumerate(kinds):
        law, _, site = friction_text.partition("@")
        keys = {"sigma_2": keys["F_c"]} if law == "viscous" else keys
        made = sites.resolve({site: {"law": law, **keys}} if site else {"law": law, **keys})
        p = CAR.loaded(load).plant(made, speed=speed, road_friction=mu)
        yield p._replace(level=level.Level(**conditions), robot=float(i in (0, 3)))


@pytest.mark.skipif(not COMPILED, reason="rows run side by side in compiled code alone")
@pytest.mark.parametrize("law", WIDE)
def test_four_rows_side_by_side_have_the_bits_of_each_alone(law):
    """Whatever the others are: groups begin at any row, one fails, two have a robot, one sticks, one slides fast."""
    rng = np.random.default_rng(0)
    plants = list(seven_rows(law))
    states = np.array([plant.initial_state(p) for p in plants])
    rows, common = np.array([packing.numbers(p) for p in plants]), packing.common_columns(plants[0])
    channels = np.zeros((7, len(plant.channels(plants[0]))))
    outline, wide = (packing.structure(plant.bound(plants[0], lanes)) for lanes in (False, True))
    kept = np.zeros(7, bool)
    one, four = (tuple(map(np.copy, (states, channels, kept))) for _ in range(2))
    plant.begin_rows(outline, rows, one[0], np.zeros(7, int), 0, 7)
    plant.begin_fours(wide, rows, four[0], np.zeros(7, int), 0, 7)
    np.testing.assert_array_equal(four[0], one[0])
    for k in range(40):
        inputs = rng.uniform(-1.0, 1.0, (7, 10, len(plant.INPUTS)))
        inputs[:, :, plant.HAND] *= np.array([1e-3, 6.0, 3.0, 1e-2, 1e-3, 20.0, 4.0])[:, None]
        inputs[[0, 3], :, plant.HAND_SPEED] = 0.0
        if k == 20:
            inputs[6, 3, plant.HAND] = np.nan
        plant.run_rows(outline, rows, one[0], inputs, *one[1:], 0, 7)
        for low, high in ((0, 3), (3, 7)) if k % 2 else ((0, 1), (1, 7)):
            plant.run_fours(wide, common, rows, four[0], inputs, *four[1:], low, high)
        for alone, beside in zip(one, four):
            np.testing.assert_array_equal(beside, alone)
    assert one[2].tolist() == [True] * 6 + [False]
