"""The level over the position and the direction in ``friction.fit``: found, not determined, or not there."""

import math

import numpy as np
import pytest

from steer_env import friction
from steer_env.friction.identification.compare import remainder
from steer_env.friction.level import Level, by_sample
from tests.friction.test_bad_input import refused
from tests.friction.test_identification import DT, noise, path

# Loops in travels of 0.1 rad, with nested ones.
LOOPS = path(*[0.05, -0.05] * 3, 0.004, -0.004, 0.01, -0.01, 0.03, -0.03, 0.05, -0.05, 0.0)
TRUE = Level(position=0.1, order=100.0, peak=0.01)  # a period of 0.63 travels
LAWS = {
    "coulomb": friction.make("coulomb", F_c=1.3),
    "dahl": friction.make("dahl", F_c=1.3, sigma_0=300.0),
    "lugre": friction.make("lugre", F_c=1.3, sigma_0=300.0),
    "masing": friction.make("masing", F_c=1.3, x_c=0.002),
}


def torque(law, level, x=LOOPS):
    return friction.response(LAWS[law], x, DT, by_sample(level, np.zeros(x.size), x))


def held(found, true):
    """Whether each interval of the level holds its true value; a peak repeats with the period."""
    values = true._asdict()
    low, high = found.intervals["peak"]
    period = 2.0 * math.pi / true.order
    values["peak"] += period * round((0.5 * (low + high) - values["peak"]) / period)
    names = [name for name in ("position", "order", "peak") if name in found.intervals]
    return [found.intervals[name][0] <= values[name] <= found.intervals[name][1] for name in names]


@pytest.mark.parametrize(("law", "order"), [("dahl", "fitted"), ("coulomb", 100.0)])
def test_a_level_over_the_position_is_found(law, order):
    clean = torque(law, TRUE)
    found = friction.fit(LOOPS, clean + 0.1 + noise(0, LOOPS.size), law, dt=DT, order=order)
    assert found.level.position == pytest.approx(0.1, rel=0.02)
    assert found.level.order == pytest.approx(100.0, rel=0.005)
    assert found.parameters == pytest.approx(LAWS[law], rel=0.02)
    assert ("order" in found.intervals) == (order == "fitted")
    assert np.mean(held(found, TRUE)) > 0.5
    assert found.undetermined == ()
    assert found.warnings == ()
    left = remainder(friction.Record(LOOPS, clean + 0.1, DT), found)
    assert np.sqrt(np.mean(left**2)) < 0.003


@pytest.mark.whole
@pytest.mark.parametrize(("law", "seeds"), [("coulomb", 40), ("dahl", 40), ("masing", 20)])
def test_intervals_of_the_level_hold_the_truth(law, seeds):
    """In nine of ten records at least, together and each by itself within chance."""
    x = LOOPS[::4]
    clean = friction.response(LAWS[law], x, 4.0 * DT, by_sample(TRUE, np.zeros(x.size), x))
    records = [clean + noise(seed, x.size) for seed in range(seeds)]
    found = [held(friction.fit(x, each, law, dt=4.0 * DT, order="fitted"), TRUE) for each in records]
    assert np.mean(found) >= 0.9
    assert np.min(np.mean(found, axis=0)) >= 0.85


@pytest.mark.parametrize("law", ["coulomb", "dahl"])
def test_none_is_shown_where_there_is_none(law):
    for seed in range(5):
        found = friction.fit(LOOPS, torque(law, Level()) + noise(seed, LOOPS.size), law, dt=DT, order="fitted")
        assert found.level is None
        assert "position" not in found.intervals
        assert any("shows no influence of the position" in text for text in found.warnings)


@pytest.mark.parametrize("part", ["all", "saturated"])
def test_a_travel_within_a_period_determines_no_order(part):
    """A tenth of a period: the level along the travel is told, and by no seed an order of it."""
    true, x = Level(position=0.3, order=2.0 * math.pi, peak=0.2), LOOPS
    if part == "saturated":
        x = path(*[0.05, -0.05] * 4)
    for seed in range(2):
        found = friction.fit(x, torque("dahl", true, x) + noise(seed, x.size), "dahl", dt=DT, order="fitted")
        assert {"position", "order", "peak"} <= set(found.undetermined)
        assert not {"position", "order", "peak"} & set(found.intervals)
        assert sum("does not determine position" in text for text in found.warnings) == 1
        ends = np.array([-0.05, 0.0, 0.05])
        here, there = (by_sample(each, np.zeros(3), ends)[:, 0] for each in (found.level, true))
        assert here * found.parameters.F_c == pytest.approx(1.3 * there, rel=0.01)


@pytest.mark.parametrize("periods", [6.0, pytest.param(3.0, marks=pytest.mark.whole)])
def test_no_seed_determines_an_order_by_chance(periods):
    """A period of some travels, where the profile about another level than the mean one would show one in some."""
    x, true = LOOPS[::4], Level(position=0.2, order=20.0 * math.pi / periods, peak=0.01)
    clean = friction.response(LAWS["dahl"], x, 4.0 * DT, by_sample(true, np.zeros(x.size), x))
    for seed in range(8):
        found = friction.fit(x, clean + noise(seed, x.size), "dahl", dt=4.0 * DT, order="fitted")
        assert {"position", "order", "peak"} <= set(found.undetermined)


def test_a_given_order_of_a_long_period_is_not_determined_either():
    """Level and curvature take each other's place within a hundredth of a period."""
    true = Level(position=0.3, order=0.6, peak=0.2)
    found = friction.fit(LOOPS, torque("dahl", true) + noise(0, LOOPS.size), "dahl", dt=DT, order=0.6)
    assert found.level is None or {"position", "peak"} <= set(found.undetermined)


def test_the_level_is_never_negative():
    """A contact that is free of friction at one end; b stays below 1, so that it is so at every position."""
    level = 1.0 + 0.98 * np.cos(62.8 * (LOOPS - 0.05))
    found = friction.fit(LOOPS, friction.response(LAWS["dahl"], LOOPS, DT, level), "dahl", dt=DT, order=62.8)
    assert found.level.position == pytest.approx(0.9, rel=1e-6)
    assert any("largest value of the search" in text for text in found.warnings)


def test_by_default_nothing_changes():
    T = torque("dahl", TRUE) + noise(0, LOOPS.size)
    assert friction.fit(LOOPS, T, "dahl", dt=DT).level is None
    with_own = friction.fit(LOOPS[::4], T[::4], "masing_position", dt=4.0 * DT, order="fitted")
    assert with_own.level is None  # its own levels depend on the position


def test_what_cannot_be_sought_is_refused():
    T = torque("dahl", TRUE)
    with refused(["order", "greater than 0", "-1"]):
        friction.fit(LOOPS, T, "dahl", dt=DT, order=-1.0)
    with refused(["order and load", "leave one of them out"]):
        friction.fit(LOOPS, T, "dahl", dt=DT, order=2.0, load=np.full(T.size, 5.0))


@pytest.mark.parametrize("law", ["coulomb", "masing"])
def test_an_asymmetry_is_an_offset(law):
    """While it slides, and with Masing before: what is left says nothing of either, and the fit tells both."""
    x = path(*[0.05, -0.05] * 4)
    T = torque(law, Level(asymmetry=0.1), x) + noise(0, x.size)
    found = friction.fit(x, T, law, dt=DT)
    assert found.residual == pytest.approx(0.013, rel=0.05)
    value, low, high = found.asymmetry
    assert value == pytest.approx(0.1, rel=0.02)
    assert low < value < high
    assert found.offset == pytest.approx(value * found.saturated[0])
