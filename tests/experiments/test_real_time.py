"""The real-time table on a small scale: schemes that remain bounded have times, and schemes that diverge are marked."""

import json

import numpy as np
import pytest

from steer_env import friction
from steer_env.experiments.studies import real_time
from steer_env.experiments.studies.real_time import Row, accuracy, plant_samples, timed, usable_step
from steer_env.vehicle import cars

STEPS = (1e-3, 1e-2)


@pytest.fixture(scope="module")
def rows():
    p = friction.make("lugre")
    done = []
    table = timed({"lugre": (p, accuracy(p, STEPS))}, done.append)["lugre"]
    assert done[-1] == 1.0
    return table


def at(rows, scheme, step):
    return next(row for row in rows if (row.scheme, row.step) == (scheme, step))


def test_every_scheme_and_step_has_a_row(rows):
    assert [(row.scheme, row.step) for row in rows] == [(s, h) for s in real_time.SCHEMES for h in STEPS]
    json.dumps([row._asdict() for row in rows], allow_nan=False)


def test_the_frame_is_accurate_and_bounded(rows):
    assert at(rows, "midpoint", 1e-3).bounded
    assert at(rows, "midpoint", 1e-3).error < 1e-4  # 0.0017 %, of second order
    assert at(rows, "midpoint", 1e-2).error < 1e-2
    assert usable_step(rows, "midpoint") == 1e-2


def test_a_run_that_diverges_has_no_times(rows):
    lost = at(rows, "explicit Euler", 1e-2)
    assert (lost.bounded, lost.error, lost.ns_per_step, lost.worst_step_ns) == (False, None, None, None)
    assert usable_step(rows, "explicit Euler") == 1e-3


def test_times_are_of_a_plausible_size(rows):
    for row in rows:
        if row.bounded:
            assert 0.0 < row.ns_per_step < 1e5
            # call by call a step may hide behind the call, but the worst is no multiple of the mean unless it is real
            assert 0.0 <= row.worst_step_ns < 1e6


def test_usable_stops_at_the_first_step_that_is_not():
    rows = [Row("s", h, error, True, None, None) for h, error in ((1.0, 0.001), (2.0, 0.5), (3.0, 0.001))]
    assert usable_step(rows, "s") == 1.0
    assert usable_step([row._replace(bounded=False) for row in rows], "s") is None


def test_the_whole_car_is_far_quicker_than_real_time():
    times = plant_samples(cars.load(), {"lugre": friction.make("lugre")})
    assert 0.0 < times["lugre"] < 1e5  # of 1e6 ns


def test_a_law_without_memory_is_covered_too():
    table = accuracy(friction.make("viscous"), (1e-3,))
    assert all(row.bounded for row in table)
    assert np.all([row.error < 0.01 for row in table])
