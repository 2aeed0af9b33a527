"""Loop width over friction: the split adds up, and what the default car's widths say."""

import math
from dataclasses import replace

import pytest

from steer_env import manoeuvres
from steer_env.experiments.studies import loop_width
from steer_env.experiments.studies.loop_width import AT_0G, DEADBAND, SLOW_TITLE, WEAVE_TITLE, Key, Width, verdict
from steer_env.friction import defaults
from steer_env.metrics.common.filtered_channels import AY, TORQUE
from steer_env.metrics.common.loops import Loops
from steer_env.vehicle import cars


@pytest.fixture(scope="module")
def curves():
    return loop_width.collect(["compact"], ["lugre"], (WEAVE_TITLE, SLOW_TITLE), (0.0, 0.125, 0.25, 0.5, 1.0, 2.0, 4.0))


def test_levels_change_torques_and_no_displacement():
    lugre, masing = loop_width.law_at("lugre", 2.0), loop_width.law_at("masing", 2.0)
    assert (lugre.F_c, lugre.F_c / lugre.sigma_0) == (2 * defaults.F_C, defaults.F_C / defaults.SIGMA_0)
    assert masing.y == pytest.approx(loop_width.law_at("masing", 1.0).y)
    assert (masing.k * masing.y).sum() == pytest.approx(2 * defaults.F_C)


def test_lag_and_damping_over_acceleration_do_not_depend_on_friction(curves):
    """Within 5 %: the car moves nearly the same. So the split is of causes, and not of one number at will.

    At four times the default friction 7 %: the column waits longer for the torsion bar to wind up where the handwheel
    reverses, and is 10 % faster at 0 g, which the motor damps.
    """
    for test in (WEAVE_TITLE, SLOW_TITLE):
        *usual, most = (w.rest for w in curves[Key("compact", "lugre", test, AT_0G)])
        assert usual == pytest.approx([usual[0]] * len(usual), rel=0.05)
        assert most == pytest.approx(usual[0], rel=0.07)


def test_the_rest_is_what_a_car_without_friction_shows():
    """Another motion, another law: the weave with no friction to speak of and with a linear damper for it."""
    car, weave = cars.load(), manoeuvres.make("weave", cycles=4)
    dry = manoeuvres.drive(car, weave, loop_width.law_at("masing", 1.0))
    free = manoeuvres.drive(car, replace(weave, amplitude=dry.meta["amplitude_rad"]), loop_width.law_at("masing", 0.0))
    rest = loop_width.without_friction(dry, car.assist)
    widths = [Loops(r, r.meta, fewest=1).width(TORQUE, AY).mean() for r in (rest, free)]
    assert widths[0] == pytest.approx(widths[1], rel=0.05)


def test_verdict_of_the_default_car(curves):
    """Both parts have one sign over lateral acceleration, and so has the whole over the angle: no width folds."""
    at_0g, deadband = (curves[Key("compact", "lugre", WEAVE_TITLE, metric)] for metric in (AT_0G, DEADBAND))
    found = verdict(at_0g)
    assert (found.signed, found.unsigned) == (True, True)
    assert math.isnan(found.zero)
    assert found.rest == pytest.approx(0.768, abs=0.005)
    assert at_0g[-1].total == pytest.approx(2.384, abs=0.02)
    found = verdict(deadband)
    assert (found.signed, found.unsigned) == (True, True)
    assert math.isnan(found.zero)
    assert found.rest == pytest.approx(0.159, abs=0.005)
    for metric in (AT_0G, DEADBAND):
        slow = verdict(curves[Key("compact", "lugre", SLOW_TITLE, metric)])
        assert (slow.signed, slow.unsigned) == (True, True)
        assert 0 < slow.rest < 0.25


@pytest.mark.parametrize(
    ("totals", "signed", "unsigned", "zero"),
    [((1, 2, 3), True, True, math.nan), ((-1, 1, 3), True, False, 0.5), ((1, 0.5, 2), False, False, math.nan)],
)
def test_verdict(totals, signed, unsigned, zero):
    found = verdict([Width(float(k), float(total), 0.0) for k, total in enumerate(totals)])
    assert (found.signed, found.unsigned) == (signed, unsigned)
    assert found.zero == pytest.approx(zero, abs=0.1, nan_ok=True)
