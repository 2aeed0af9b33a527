"""``steer-env fit-friction``: what judges a law, and how the page and the terminal say it."""

import numpy as np
import pytest

from steer_env import friction
from steer_env.experiments.report import friction_fit, friction_fit_page
from steer_env.recording import friction_checks, friction_record

DT = 0.02  # [s]
DAHL = friction.make("dahl", sigma_0=120.0, F_c=0.9)
UNITS = {"displacement": "rad", "torque": "N m"}


def record_of(degrees, offset=0.0):
    x = np.radians(degrees)
    noise = np.random.default_rng(0).normal(0.0, 0.005, x.size)
    return friction_record.FrictionRecord(x, friction.response(DAHL, x, DT) + offset + noise, DT, UNITS)


def sine(size, hertz, seconds):
    return size * np.sin(2.0 * np.pi * hertz * np.arange(0.0, seconds, DT))


STROKES = record_of(np.concatenate([sine(6, 0.25, 20), sine(1, 0.5, 20), sine(3, 1.0, 20), sine(6, 0.5, 30)]))
GROWING = record_of(np.linspace(1.0, 6.0, 3000) * sine(1.0, 0.25, 60.0))
RESTS = record_of(np.interp(np.arange(0.0, 80.0, DT) % 8.0, [0.0, 2.0, 4.0, 6.0, 8.0], [0.0, 3.0, 3.0, 0.0, 0.0]))


def page(found):
    return friction_fit_page.render(found, {}, "out")


def test_only_periods_of_equal_strokes_tell_how_far_a_record_repeats():
    """Strokes of 3 deg are not compared with strokes of 6 deg that follow them."""
    own = friction_checks.repeatability(STROKES.motion, STROKES.friction, 2700)
    assert own == pytest.approx(0.005 * np.sqrt(2.0), rel=0.1)


def test_a_record_that_does_not_repeat_has_no_repeatability():
    assert friction_checks.repeatability(GROWING.motion, GROWING.friction) is None
    found = friction_fit.collect(GROWING, "growing", ["dahl"])
    text = page(found)
    assert found.repeats is None
    assert "does not repeat" in text
    assert "times the record" not in text
    assert "one period" not in friction_fit_page.verdict(found)


def test_laws_are_judged_while_moving_and_rests_are_told_apart():
    """A law without memory says nothing at rest: Coulomb is judged on the motion, and has no number for the rests."""
    found = friction_fit.collect(RESTS, "rests", ["dahl", "coulomb"])
    dahl, coulomb = found.laws
    moves = np.diff(RESTS.motion, prepend=RESTS.motion[0]) != 0.0
    moves[: found.first] = False
    left = (found.curves["coulomb"] - RESTS.friction)[moves]
    assert coulomb.residual == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-6)
    assert coulomb.resting is None
    assert dahl.resting == pytest.approx(0.005, rel=0.2)
    assert found.rests == pytest.approx(0.5, abs=0.02)
    text = page(found)
    assert "left at rest [%]" in text
    assert "left while moving, judging part [%]" in text
    assert "left at rest [%]" not in page(friction_fit.collect(STROKES, "strokes", ["dahl"]))
