"""``steer-env fit-friction``: what judges a law."""

import numpy as np
import pytest

from steer_env import friction
from steer_env.experiments.cli.main import main
from steer_env.experiments.reports import friction_fit, friction_fit_page
from steer_env.friction.identification import periods
from steer_env.recording import friction_record

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


def test_only_periods_of_equal_strokes_tell_how_far_a_record_repeats():
    """Strokes of 3 deg are not compared with strokes of 6 deg that follow them."""
    own = periods.repeatability(STROKES.motion, STROKES.friction, 2700)
    assert own == pytest.approx(0.005 * np.sqrt(2.0), rel=0.1)


def test_a_record_that_does_not_repeat_has_no_repeatability():
    assert periods.repeatability(GROWING.motion, GROWING.friction) is None
    assert friction_fit.collect(GROWING, "growing", ["dahl"]).repeats is None


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


def test_a_sign_that_contradicts_the_work_is_refused_with_the_remedy(tmp_path, capsys):
    file = tmp_path / "mine.csv"
    rows = np.column_stack([DT * np.arange(STROKES.x.size), np.degrees(STROKES.x), STROKES.friction])
    np.savetxt(file, rows, delimiter=",", header="time_s,displacement_deg,torque_Nm", comments="")
    assert main(["fit-friction", str(file), "--sign", "-1", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "--sign -1 contradicts the work" in said
    assert "leave --sign out" in said
    assert "pass -torque" not in said


def test_a_level_of_a_column_stands_beside_the_saturated_torque_of_the_law():
    """The level is the record's plateau; short strokes do not saturate, so that the law slides at more."""
    record = record_of(sine(0.5, 0.25, 60)).to_column(level=1.5)
    found = friction_fit.collect(record, "stretched", ["dahl"])
    (dahl,) = found.laws
    assert found.saturated["dahl"] == pytest.approx(dahl.fit.parameters.F_c, rel=1e-3)
    assert found.saturated["dahl"] > 1.55


@pytest.mark.parametrize(
    ("value", "low", "high"),
    [(1.09934, 1.09912, 1.09956), (120.0004, 119.98, 120.02), (0.5, 0.1, 0.9), (3.0, 3.0, 3.0), (0.0, 0.0, 157.613)],
)
def test_an_interval_as_printed_holds_its_value(value, low, high):
    shown, ends = friction_fit_page.value_with_interval(value, (low, high))
    a, b = map(float, ends.split(" to "))
    assert a <= float(shown) <= b
    assert (a < b) == (low < high)
    assert len(ends) < 22


def test_no_law_is_named_best_among_equals():
    """On a record of Dahl, LuGre and the exponential spring are equal to it, and Coulomb is not."""
    among_equals = friction_fit.collect(STROKES, "strokes", ("dahl", "lugre", "exponential_spring", "coulomb"))
    equal = {each.law for each in among_equals.equals}
    assert {"dahl", "lugre", "exponential_spring"} <= equal
    assert "coulomb" not in equal
    found = friction_fit_page.as_json(among_equals)
    assert found["best"] is None
    assert set(found["equals"]) == equal


def test_the_file_holds_the_intervals_of_sliders():
    """Stiffness and saturated friction of Masing, and where an interval ends with the law."""
    found = friction_fit.collect(RESTS, "rests", ["masing", "bouc_wen"])
    laws = friction_fit_page.as_json(found)["laws"]
    for each in found.laws:
        assert laws[each.law]["saturated"] == list(each.fit.saturated)
    masing = next(each.fit for each in found.laws if each.law == "masing")
    assert [row["k"] for row in laws["masing"]["sliders"]] == [each.k for each in masing.sliders]
    limits = {each.law: each.fit.limits for each in found.laws}
    assert limits["bouc_wen"]
    assert all(laws[name]["limits"] == {key: list(ends) for key, ends in each.items()} for name, each in limits.items())
