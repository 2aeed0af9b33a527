"""``steer-env fit-friction``: what judges a law, and how the page and the terminal say it."""

import re

import numpy as np
import pytest

from steer_env import friction
from steer_env.experiments.cli.common.tables import print_fits
from steer_env.experiments.cli.main import main
from steer_env.experiments.pages import friction_pictures
from steer_env.experiments.reports import friction_fit, friction_fit_page
from steer_env.friction.identification import periods
from steer_env.friction.identification.fit import INTERVALS
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


def page(found):
    return friction_fit_page.page_of(found, "out").html()


def test_only_periods_of_equal_strokes_tell_how_far_a_record_repeats():
    """Strokes of 3 deg are not compared with strokes of 6 deg that follow them."""
    own = periods.repeatability(STROKES.motion, STROKES.friction, 2700)
    assert own == pytest.approx(0.005 * np.sqrt(2.0), rel=0.1)


def test_a_record_that_does_not_repeat_has_no_repeatability():
    assert periods.repeatability(GROWING.motion, GROWING.friction) is None
    found = friction_fit.collect(GROWING, "growing", ["dahl"])
    text = page(found)
    assert found.repeats is None
    assert "does not repeat" in text
    assert "times the record" not in text
    assert "repeats" not in friction_fit_page.verdict(found)


def test_no_law_is_compared_with_a_record_that_repeats_exactly():
    """As a simulated one may."""
    found = friction_fit.collect(STROKES, "strokes", ["dahl"])
    assert "repeats to 0 %" in page(found._replace(repeats=0.0)).replace("\u00a0", " ")


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


def test_a_sign_that_contradicts_the_work_is_refused_with_the_remedy(tmp_path, capsys):
    file = tmp_path / "mine.csv"
    rows = np.column_stack([DT * np.arange(STROKES.x.size), np.degrees(STROKES.x), STROKES.friction])
    np.savetxt(file, rows, delimiter=",", header="time_s,displacement_deg,torque_Nm", comments="")
    assert main(["fit-friction", str(file), "--sign", "-1", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "--sign -1 contradicts the work" in said
    assert "leave --sign out" in said
    assert "pass -torque" not in said


def test_a_level_of_a_column_stands_beside_the_saturated_torque_of_the_law(capsys):
    """The level is the record's plateau; short strokes do not saturate, so that the law slides at more."""
    record = record_of(sine(0.5, 0.25, 60)).to_column(level=1.5)
    found = friction_fit.collect(record, "stretched", ["dahl"])
    (dahl,) = found.laws
    assert found.saturated["dahl"] == pytest.approx(dahl.fit.parameters.F_c, rel=1e-3)
    assert found.saturated["dahl"] > 1.55
    text = page(found)
    assert "saturated friction at the record’s speed" in text
    assert "the plateau of the record, not the saturated friction of a law" in text
    print_fits(found)
    printed = capsys.readouterr().out
    assert "saturated [N m]" in printed
    assert f"{found.saturated['dahl']:.3g}" in printed


def test_the_page_does_not_advise_what_it_has_done():
    found = friction_fit.collect(STROKES, "strokes", ["dahl", "coulomb"])
    text = page(found)
    assert "the law does not describe the record" in text  # Coulomb
    assert "friction.compare" not in text
    assert "times the record’s difference between periods" in text
    assert "times the record’s own<" not in text


@pytest.mark.parametrize(
    ("value", "low", "high"),
    [(1.09934, 1.09912, 1.09956), (120.0004, 119.98, 120.02), (0.5, 0.1, 0.9), (3.0, 3.0, 3.0), (0.0, 0.0, 157.613)],
)
def test_an_interval_as_printed_holds_its_value(value, low, high):
    shown, ends = friction_fit_page.beside(value, (low, high))
    a, b = map(float, ends.split(" to "))
    assert a <= float(shown) <= b
    assert (a < b) == (low < high)
    assert len(ends) < 22


def test_a_long_array_is_cut_on_the_terminal_only(capsys):
    found = friction_fit.collect(RESTS, "rests", ["masing"])
    (row,) = (row for row in friction_fit_page.rows(found.laws[0].fit, UNITS) if row.name == "k")
    assert row.value.count(",") > 4
    print_fits(found)
    printed = re.sub(r"\s+", " ", capsys.readouterr().out)
    assert ", ".join(row.value.split(", ")[:4]) + ", …" in printed
    assert row.value not in printed
    assert row.value in page(found)


def test_numbers_do_not_break_and_pictures_fit_a_narrow_screen():
    text = page(friction_fit.collect(STROKES, "strokes", ["dahl"]))
    own = text[: text.index("</style>")]
    assert re.search(r"td \{ white-space: nowrap", own)
    assert own.rindex("figure > img { width: 100%; }") > own.rindex("figure > img { width: 46rem; }")


NESTED_ON_DAHL = ("dahl", "lugre", "exponential_spring", "coulomb", "bouc_wen")


@pytest.fixture(scope="module")
def among_equals():
    return friction_fit.collect(STROKES, "strokes", NESTED_ON_DAHL)


def test_no_law_is_named_best_among_equals(among_equals):
    """On a record of Dahl, LuGre and the exponential spring are equal to it, and Coulomb is not."""
    equal = {each.law for each in among_equals.equals}
    assert {"dahl", "lugre", "exponential_spring"} <= equal
    assert "coulomb" not in equal
    found = friction_fit_page.as_json(among_equals)
    assert found["best"] is None
    assert set(found["equals"]) == equal
    values = friction_fit_page.page_of(among_equals, "out").values
    assert [each.law for each in values["first"]] == [each.law for each in among_equals.laws]
    assert set(values["equals"]) == equal


@pytest.mark.whole
@pytest.mark.parametrize("laws", [("dahl",), ("dahl", "coulomb"), ("dahl", "lugre", "coulomb"), NESTED_ON_DAHL])
@pytest.mark.parametrize("record", [STROKES, GROWING])
def test_the_first_sentence_is_short(record, laws):
    found = friction_fit.collect(record, "one", laws)
    said = friction_fit_page.verdict(found)
    assert len(said.split()) <= 25
    if len(found.equals) == 1:
        assert "apart" not in said


def test_the_first_sentence_with_a_long_name_is_short():
    found = friction_fit.collect(STROKES, "one", ("dahl", "coulomb"))
    laws = (found.laws[0]._replace(law="masing_position"), found.laws[1])
    said = friction_fit_page.verdict(found._replace(laws=laws))
    assert "Masing by position" in said
    assert len(said.split()) <= 25


def test_every_way_to_an_interval_has_its_words():
    found = friction_fit.collect(STROKES, "one", ("dahl",))
    assert len({page(found._replace(intervals=way)) for way in INTERVALS}) == len(INTERVALS)


def test_the_loops_of_many_laws_leave_room_for_the_table_and_have_numbers_below():
    found = friction_fit.collect(STROKES, "one", ("dahl",))
    shown = friction_fit_page.shown(found)
    for number in (4, 11, 12):
        curves = {f"law_{k}": found.curves["dahl"] for k in range(number)}
        figure = friction_pictures.fitted_loops.__wrapped__(shown, curves, {law: law for law in curves})
        assert figure.get_size_inches()[1] < 3.6
        lowest = {axes.get_subplotspec().colspan.start: axes for axes in figure.axes if axes.axison}
        assert all(axes.xaxis.get_tick_params()["labelbottom"] for axes in lowest.values())


def test_the_page_and_the_file_hold_the_intervals_of_sliders():
    """Stiffness, yield and saturated friction of Masing, and where an interval ends with the law."""
    found = friction_fit.collect(RESTS, "rests", ["masing", "bouc_wen"])
    values = friction_fit_page.page_of(found, "out").values
    laws = friction_fit_page.as_json(found)["laws"]
    for each in found.laws:
        assert laws[each.law]["saturated"] == list(each.fit.saturated)
        assert values["rows"][each.law][0].name.startswith("saturated friction")
        assert values["rows"][each.law][0].interval
    masing = next(each.fit for each in found.laws if each.law == "masing")
    assert [row["k"] for row in laws["masing"]["sets"]] == [each.k for each in masing.sets]
    assert len(values["sets"]["masing"]) == len(masing.sets)
    for row, each in zip(values["sets"]["masing"], masing.sets):
        assert bool(row[2]) == (each.k_interval is not None)
        assert bool(row[4]) == (each.y_interval is not None)
    limited = {row.name: row.limit for row in values["rows"]["masing"]}
    assert limited["sigma_1"] == "lower"
    assert laws["masing"]["limits"]["sigma_1"] == [True, False]
