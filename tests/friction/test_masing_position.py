"""Masing with levels that depend on the position: contracts, closed forms, and what a fit makes of a record."""

import numpy as np
import pytest

from steer_env import friction
from steer_env.experiments.studies.common.friction_records import rig
from steer_env.testing import CHECKS, check_plain_python
from steer_env.testing.friction_law import check_odd_symmetry, check_torque_scale
from tests.friction.test_identification import DT, LOOPS, SIGMA, noise

# Strokes within the moves that the checks draw.
SETS = {
    "two sets": friction.make("masing_position", slope=[1.0, -1.0] * 5, stroke=[-0.1, 0.013]),
    "one element": friction.make("masing_position", k=[100.0], y=[0.009], slope=[1.0], stroke=[-0.01, 0.009]),
    "steep": friction.make("masing_position", k=[50.0, 80.0], y=[0.01, 0.04], slope=[0.5, 1.0], stroke=[-0.04, 0.05]),
}
SIDED = (check_odd_symmetry, check_torque_scale)  # a stroke prefers a side, and does not stretch with the friction
KEPT = [check for check in CHECKS if check not in SIDED]


@pytest.mark.parametrize("check", KEPT, ids=lambda check: check.__name__)
@pytest.mark.parametrize("name", SETS)
def test_contract(name, check):
    check(SETS[name])


def test_plain_python_equals_compiled():
    check_plain_python(list(SETS.values()))


def test_without_slopes_it_is_masing():
    x = np.cumsum(np.random.default_rng(0).normal(0.0, 2e-3, 2000))
    found = friction.response("masing_position", x, 1e-3)
    np.testing.assert_allclose(found, friction.response("masing", x, 1e-3), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("scale", [1.0, 0.3, 3.0])
def test_a_slider_follows_its_level(scale):
    """To and fro far beyond the stroke: sliding, the torque is k L y (1 + m u) to either side, and never negative."""
    k, y, m, low, high = 100.0, 0.01, -1.0, -0.05, 0.07
    p = friction.make("masing_position", k=[k], y=[y], slope=[m], stroke=[low, high])
    x = np.concatenate([np.linspace(0.0, 0.2, 401), np.linspace(0.2, -0.2, 801)[1:], np.linspace(-0.2, 0.2, 801)[1:]])
    found = friction.response(p, x, 1e-3, scale)
    level = k * y * scale * (1.0 + m * np.clip((2.0 * x - low - high) / (high - low), -1.0, 1.0))
    slides = np.r_[np.zeros(120, bool), np.ones(281, bool), np.zeros(120, bool), np.ones(679, bool)]
    sliding = np.sign(np.gradient(x)) * level
    np.testing.assert_allclose(found[:1200][slides], sliding[:1200][slides], rtol=1e-12, atol=1e-12)
    assert np.all(np.abs(found) <= level + 1e-12)


def test_the_mirrored_stroke_gives_the_mirrored_torque():
    p = SETS["steep"]
    mirrored = friction.make("masing_position", k=p.k, y=p.y, slope=-p.slope, stroke=-p.stroke[::-1])
    x = np.cumsum(np.random.default_rng(1).normal(0.0, 5e-3, 2000))
    np.testing.assert_array_equal(friction.response(mirrored, -x, 1e-3), -friction.response(p, x, 1e-3))


def test_elements_are_put_in_order_with_their_slopes():
    p = friction.make("masing_position", k=[1.0, 2.0], y=[0.2, 0.1], slope=[1.0, -0.5])
    assert (p.k.tolist(), p.y.tolist(), p.slope.tolist()) == ([2.0, 1.0], [0.1, 0.2], [-0.5, 1.0])


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"slope": [0.1]}, "slope must hold one value for each of the 10 elements, got 1"),
        ({"stroke": [1.0, 1.0]}, "stroke must hold its low and its high end"),
        ({"k": [1.0], "y": [0.3], "slope": [1.0], "stroke": [0.0, 0.5]}, "at most half the stroke, 0.25 rad, got 0.3"),
    ],
)
def test_bad_values(given, text):
    with pytest.raises(ValueError, match=text):
        friction.make("masing_position", **given)


def test_own_record():
    """Levels at the ends and in the middle of the stroke within 2 %; what is left is the noise."""
    y = [0.004, 0.008]
    stroke = [float(LOOPS.min() - LOOPS[0]), float(LOOPS.max() - LOOPS[0])]
    p = friction.make("masing_position", k=[150.0, 60.0], y=y, slope=[0.5, 0.0], stroke=stroke)
    clean = friction.response(p, LOOPS, DT)
    found = friction.fit(LOOPS, clean + 0.1 + noise(0, LOOPS.size), "masing_position", dt=DT)
    q = found.parameters
    for end in (-1.0, 0.0, 1.0):
        level, true = (float(np.sum(each.k * each.y * (1.0 + end * each.slope))) for each in (q, p))
        assert level == pytest.approx(true, rel=0.02)
    low, high = found.intervals["F_c"]
    assert low <= float(np.sum(p.k * p.y)) <= high
    assert found.saturated[0] == pytest.approx(float(np.sum(p.k * p.y)), rel=0.02)
    assert found.residual < 1.05 * SIGMA
    assert not any("does not describe" in text for text in found.warnings)


def test_yields_at_the_end_of_the_grid_are_told():
    """A contact of which the most does not yield within the travel; a saturated loop has no such remark."""
    for y, expected in ((0.06, 1), (0.01, 0)):
        p = friction.make("masing_position", k=[40.0, 20.0], y=[0.004, y])
        found = friction.fit(LOOPS, friction.response(p, LOOPS, DT) + noise(0, LOOPS.size), "masing_position", dt=DT)
        assert sum("the largest yield of the search" in text for text in found.warnings) == expected
        assert (found.intervals["F_c"][1] == np.inf) == bool(expected)


@pytest.mark.parametrize("displacement", ["measured", "mean period"])
def test_the_measured_rig(displacement):
    """60 s fit, 40 s judge: at most 4.2 % of the mean friction, rests included. Masing leaves 4.7 %.

    At rest the recorded displacement follows the force, by the compliance of the rig; that of the mean period does not.
    """
    record, n = rig(), 12000
    x, period = record.x, 800
    if displacement == "mean period":
        x = np.tile(x.reshape(-1, period).mean(axis=0), x.size // period)
    mean, left = float(np.mean(np.abs(record.friction[n:]))), {}
    for name in ("masing", "masing_position"):
        found = friction.fit(x[:n], record.friction[:n], name, dt=record.dt)
        e = friction.response(found.parameters, x, record.dt) + found.offset - record.friction
        left[name] = float(np.sqrt(np.mean(e[n:] ** 2))) / mean
    assert left["masing_position"] < 0.034 < 0.045 < left["masing"] < 0.05
