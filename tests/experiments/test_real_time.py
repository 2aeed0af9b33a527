"""The table of errors on a small scale: schemes that diverge are marked."""

import json

import numpy as np
import pytest

from steer_env import friction
from steer_env.experiments.studies import real_time
from steer_env.experiments.studies.real_time import Row, accuracy, usable_step

STEPS = (1e-3, 1e-2)


@pytest.fixture(scope="module")
def rows():
    return accuracy(friction.make("lugre"), STEPS)


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


def test_a_run_that_diverges_has_no_error(rows):
    lost = at(rows, "explicit Euler", 1e-2)
    assert (lost.bounded, lost.error) == (False, None)
    assert usable_step(rows, "explicit Euler") == 1e-3


def test_usable_stops_at_the_first_step_that_is_not():
    rows = [Row("s", h, error, True) for h, error in ((1.0, 0.001), (2.0, 0.5), (3.0, 0.001))]
    assert usable_step(rows, "s") == 1.0
    assert usable_step([row._replace(bounded=False) for row in rows], "s") is None


def test_a_law_without_memory_is_covered_too():
    table = accuracy(friction.make("viscous"), (1e-3,))
    assert all(row.bounded for row in table)
    assert np.all([row.error < 0.01 for row in table])
