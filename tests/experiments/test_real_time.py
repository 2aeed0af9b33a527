"""The table of errors on a small scale, where schemes that diverge are marked; and what simple schemes make of laws."""

import numpy as np
import pytest

from steer_env import friction
from steer_env.experiments.studies.common.column_schemes import integrate
from steer_env.experiments.studies.real_time import SchemeRow, accuracy, usable_step
from tests.verification.column import MOST, TWELVE, relative_error, twelve_cases, twelve_references

STEPS = (1e-3, 1e-2)


@pytest.fixture(scope="module")
def rows():
    return accuracy(friction.make("lugre"), STEPS)


def at(rows, scheme, step):
    return next(row for row in rows if (row.scheme, row.step) == (scheme, step))


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
    rows = [SchemeRow("s", h, error, True) for h, error in ((1.0, 0.001), (2.0, 0.5), (3.0, 0.001))]
    assert usable_step(rows, "s") == 1.0
    assert usable_step([row._replace(bounded=False) for row in rows], "s") is None


def test_a_law_without_memory_is_covered_too():
    table = accuracy(friction.make("viscous"), (1e-3,))
    assert all(row.bounded for row in table)
    assert np.all([row.error < 0.01 for row in table])


def test_masing_never_exceeds_its_saturated_torque():
    for (F_c, _, _), case in zip(TWELVE, twelve_cases("masing"), strict=True):
        assert np.abs(integrate(case, "midpoint", 1e-2)[0]).max() <= F_c * (1.0 + 1e-9)


def test_explicit_euler_diverges_for_lugre_between_2_and_10_ms():
    """The literature's complaint holds for explicit steps: every case is well behaved at 2 ms, none is at 10 ms."""
    for case in twelve_cases("lugre"):
        peak = np.abs(integrate(case, "midpoint", 1e-4)[0]).max()
        assert np.abs(integrate(case, "explicit Euler", 2e-3)[0]).max() < 2.0 * peak
        with np.errstate(over="ignore", invalid="ignore"):
            worst = np.abs(integrate(case, "explicit Euler", 1e-2)[0]).max()
        assert not worst < 10.0 * peak  # NaN where it has overflown


@pytest.mark.whole
@pytest.mark.parametrize("law", MOST)
def test_backward_euler_is_bounded_but_only_good_to_per_cents(law):
    found = zip(twelve_cases(law), twelve_references(law), TWELVE, strict=True)
    worst = max(relative_error(case, "backward Euler", exact, F_c) for case, exact, (F_c, *_) in found)
    assert 0.015 < worst < 0.04
    assert worst > 10.0 * MOST[law]
