"""The friction study: its cases, its records, and that its findings follow from the numbers."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from steer_env import friction, manoeuvres
from steer_env.experiments.cli.main import main
from steer_env.experiments.pages import traces
from steer_env.experiments.studies import friction as friction_study
from steer_env.experiments.studies.common import friction_cases as cases
from steer_env.experiments.studies.common import friction_distinction as distinction
from steer_env.experiments.studies.common import friction_records as records
from steer_env.experiments.studies.common import friction_results
from steer_env.experiments.studies.common.friction_results import Scope
from steer_env.experiments.studies.common.scaling import powers, scale_record
from steer_env.experiments.studies.real_time import SchemeRow
from steer_env.metrics import Value
from steer_env.metrics.common.filtered_channels import ANGLE, TORQUE
from steer_env.recording.friction_record import FrictionRecord
from steer_env.vehicle import cars
from tests.experiments.faked_times import NONE, faked
from tests.synthetic.hand_torque import fitted

LAWS = ("lugre", "dahl", "coulomb")


@pytest.mark.parametrize("name", friction.available())
def test_a_scaled_law_has_the_scaled_torque_at_the_scaled_displacement(name):
    p, a, b = friction.make(name), 3.0, 0.25
    x = np.radians(3.0) * np.sin(np.linspace(0.0, 12.0, 2001))
    torque = friction.response(p, x, 1e-2)
    if name == "viscous":  # a law of the speed alone
        b = 1.0
    np.testing.assert_allclose(friction.response(scale_record(p, a, b), b * x, 1e-2), a * torque, rtol=0.0, atol=2e-7)


def test_powers_of_a_unit_are_read():
    assert powers("N m s/rad") == (1, -1)
    assert powers("1/s") == (0, 0)
    assert powers("rad/s") == (0, 1)
    with pytest.raises(ValueError, match="furlong"):
        powers("N furlong")


@pytest.fixture(scope="module")
def every():
    return cases.cases({name: friction.make(name) for name in LAWS}, {"dahl": friction.make("dahl")})


def test_a_split_keeps_the_whole_friction(every):
    x = np.radians(5.0) * np.sin(np.linspace(0.0, 12.0, 2001))
    whole = friction.response("lugre", x, 1e-2)
    split = [case for case in every if case.factor == cases.SITE_FACTOR]
    assert len(split) == 2
    for case in split:
        parts = friction.response(case.friction, x, 1e-2) + friction.response(case.above, x, 1e-2)
        np.testing.assert_allclose(parts, whole, atol=1e-12)


def test_friction_above_the_torsion_bar_adds_to_the_hand_torque_and_to_nothing_else(every):
    car, rig = cars.load(), manoeuvres.make("rig")
    case = next(case for case in every if case.factor == cases.SITE_FACTOR)
    with_it = cases.recording(case, car, rig, case.friction)
    without = cases.recording(case._replace(above=None), car, rig, case.friction)
    extra = with_it[TORQUE] - without[TORQUE]
    np.testing.assert_allclose(extra, friction.response(case.above, with_it[ANGLE], 1e-3), atol=1e-14)
    assert extra.max() == pytest.approx(cases.COLUMN_FRICTION, rel=1e-3)
    for name in set(with_it.channels) - {TORQUE}:
        np.testing.assert_array_equal(with_it[name], without[name])
    with pytest.raises(ValueError, match="robot holds"):
        cases.recording(case, car, manoeuvres.make("release"), case.friction)


def test_half_the_step_changes_little_and_a_level_much(every):
    car, tests = cars.load(), ("rig",)
    kept = [
        case
        for case in every
        if case.label == case.base == "law: lugre" or case.factor in (cases.STEP_FACTOR, cases.LEVEL_FACTOR)
    ]
    rows = cases.effects(kept, [cases.drives((car, case, tests)) for case in kept])
    of = cases.by_factor(rows)
    step, level = (
        max(abs(row.found.share) for row in of[factor]) for factor in (cases.STEP_FACTOR, cases.LEVEL_FACTOR)
    )
    assert step < 1e-3
    assert level > 0.1
    assert cases.summary(of[cases.LEVEL_FACTOR]).largest.case.factor == cases.LEVEL_FACTOR


def test_paired_differences_by_hand():
    gap, half = cases.paired_difference([2.0, 3.0, 5.0], [1.0, 1.0, 2.0])
    assert gap == pytest.approx(2.0)
    assert half == pytest.approx(4.302652729911275 / math.sqrt(3.0))  # Student's t for two degrees of freedom
    assert math.isnan(cases.paired_difference([1.0], [0.0])[1])


def test_the_laws_are_told_apart_where_they_should_be():
    laws = {name: friction.make(name) for name in ("lugre", "dahl", "masing")}
    apart = distinction.differences(laws, "lugre")
    assert apart["saturated"]["masing"] < 0.01 < apart["nested"]["masing"]
    assert apart["nested"]["dahl"] < 1e-3 < distinction.DISTINCTION_THRESHOLD < apart["quick"]["dahl"]
    assert apart["slow"]["dahl"] < apart["usual"]["dahl"] < apart["quick"]["dahl"]


def _record(noise=0.0):
    """Dahl friction over a motion of 8 s, and another law's that differs where it is judged."""
    dt = 0.02
    t = dt * np.arange(4800)
    x = np.radians(2.0) * np.sin(2.0 * np.pi * t / 8.0)
    friction_of = friction.response("dahl", x, dt) + noise * np.random.default_rng(0).standard_normal(t.size)
    return FrictionRecord(x, friction_of, dt, {"displacement": "rad", "torque": "N m"})


def test_a_law_leaves_what_is_not_its_own():
    record = _record(0.01)
    own, other = records.judge((record, ["coulomb", "dahl"]))
    assert (own.law, other.law, own.alike) == ("dahl", "coulomb", ())
    mean = np.mean(np.abs(record.friction))
    assert own.error == pytest.approx(0.01 / mean, rel=0.05)
    assert own.low < own.error < own.high
    assert other.error > 5.0 * own.error
    # the difference of two noises
    assert records.repeatability(record) == pytest.approx(math.sqrt(2.0) * 0.01 / mean, rel=0.05)


def test_a_law_without_a_fit_says_why(monkeypatch):
    def refuse(*_):
        raise ValueError("no")

    monkeypatch.setattr("steer_env.friction.identification.compare.fitted", refuse)
    (found,) = records.judge((_record(), ["dahl"]))
    assert found.parameters is None
    assert math.isnan(found.error)
    assert found.remarks == ("no",)


def test_the_true_law_remains_and_another_does_not():
    laws = {name: friction.make(name) for name in ("dahl", "coulomb")}
    kind = next(iter(records.RECORDS))
    found = records.confuse((kind, laws, "dahl", 0.01, 0))
    assert found.remain == ("dahl",)
    assert found.errors["dahl"] == pytest.approx(0.01, rel=0.2)
    table = records.shares([found, found._replace(remain=("dahl", "coulomb"))], kind, 0.01)
    assert table == {"dahl": {"dahl": 1.0, "coulomb": 0.5}}


def _results(every):
    """Results of three laws, by hand where a simulation would take long."""
    laws = {name: friction.make(name) for name in LAWS}
    record = _record()
    judged = [
        records.Judged("dahl", laws["dahl"], 0.05, 0.04, 0.06, (), ()),
        records.Judged("lugre", laws["lugre"], 0.10, 0.09, 0.11, ("sigma_1",), ("told",)),
        records.Judged("coulomb", None, math.nan, math.nan, math.nan, (), ("no reversal",)),
    ]
    row = SchemeRow("midpoint", 1e-3, 1e-4, True)
    tables = {law: [row, row._replace(scheme="explicit Euler", error=0.5)] for law in laws}
    base, other = (Value(v, v, v, "N m", repeats=(v, v, v)) for v in (2.0, 3.0))
    driven = []
    for case in every:
        value = other if case.factor == cases.LEVEL_FACTOR else base
        drive = cases.Drive({"torque_at_0p1g": value}, {}, 0.1, None)
        driven.append({"weave": drive, "slow-ramp": drive})
    confused = [
        records.Confusion(kind, law, 0.01, 0, dict.fromkeys(laws, 0.01), (law,))
        for kind in records.RECORDS
        for law in laws
    ]
    ripples = [friction_results.Ripple(law, "strong friction", 1e-4, 0.1) for law in laws]
    return friction_results.Results(
        car=cars.load(),
        scope=Scope(("weave", "slow-ramp"), (1e-3,), tuple(records.RECORDS), (0.01,), 1, 2),
        noticed=0.15,
        laws=laws,
        record=record,
        judged=judged,
        repeatability=0.025,
        road=fitted(),
        tables=tables,
        times=faked(dict.fromkeys(laws, 100.0) | {"dahl": 1370.0}, ["dahl"]),
        cases=every,
        effects=cases.effects(every, driven),
        apart=distinction.differences(laws, "lugre"),
        held=ripples,
        driven=[cases.DriverEpisodes(law, "steer_env/AssistWeave-v3", {"rms_hand_torque": [1.0, 1.1]}) for law in laws],
        confusion=confused,
    )


@pytest.fixture(scope="module")
def results(every):
    return _results(every)


def test_findings_are_those_of_the_numbers(results):
    accuracy = friction_study.accuracy(results)
    assert [each.law for each in accuracy["leaders"]] == ["dahl"]
    assert accuracy["leaders"][0].error == pytest.approx(0.05, rel=0.2)
    assert accuracy["sure"].law == "dahl"  # the best law is determined
    assert [step for step, _ in friction_study.steps(results)["explicit"]] == [None]
    laws = friction_study.of_laws(results)["remembering"]
    assert (laws.large, laws.compared) == (0, 2)
    factors = friction_study.of_factors(results)
    assert factors["stronger"][cases.LEVEL_FACTOR] == 1.0
    assert factors["noticed"] == [cases.LEVEL_FACTOR]
    assert not friction_study.laws_told_apart(results)["shaking"]
    loop = friction_study.in_loop(results)
    assert (loop["large"], loop["comparisons"]) == (0, 1)
    assert not any(each["taken"] for each in friction_study.confusion(results))


def test_other_numbers_give_other_findings(results):
    first, second, third = results.judged
    turned = results._replace(judged=[second._replace(error=0.02, high=0.03), first, third])
    accuracy = friction_study.accuracy(turned)
    assert [each.law for each in accuracy["leaders"]] == ["lugre"]
    assert accuracy["undetermined"] == ["lugre"]
    assert accuracy["sure"].law == "dahl"
    loud = [each._replace(ripple=0.05, lasting=1.0) for each in results.held if each.law == "dahl"]
    others = [each for each in results.held if each.law != "dahl"]
    assert friction_study.laws_told_apart(results._replace(held=loud + others))["shaking"] == ["dahl"]
    taken = [each._replace(remain=LAWS) for each in results.confusion]
    found, *_ = friction_study.confusion(results._replace(confusion=taken))
    assert found["taken"]["dahl"] == ["lugre", "coulomb"]


@pytest.mark.parametrize("times", [None, NONE], ids=["measured", "not measurable"])
def test_a_page_is_made_whether_times_are_measurable_or_not(results, times):
    shown = results if times is None else results._replace(times=times)
    assert "<dd></dd>" not in friction_study.make_page(shown).html()
    assert bool(friction_study.as_json(shown)["real_time"]["costs"]) == (times is None)


def test_a_law_is_drawn_with_the_offset_that_was_fitted_with_it(results):
    shifted = replace(results.record, friction=results.record.friction + 0.3)
    (dahl,) = records.judge((shifted, ["dahl"]))
    (x, measured), laws = friction_study.last_loops(results._replace(record=shifted, judged=[dahl]))
    np.testing.assert_allclose(laws["dahl"][0], x)
    assert np.sqrt(np.mean((laws["dahl"][1] - measured) ** 2)) < 0.02


@pytest.mark.whole
def test_the_quick_study_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr(friction, "available", lambda: ("coulomb", "dahl", "lugre", "masing"))
    out = tmp_path / "friction"
    assert main(["study", "friction", "--quick", "--workers", "1", "--out", str(out)]) == 0
    data = json.loads((out / "friction.json").read_text())
    assert all(name in data["record"]["laws"] for name in ("lugre", "masing", "dahl"))
    assert data["record"]["laws"]["masing"]["error"] < 0.5 * data["record"]["laws"]["dahl"]["error"]


@pytest.mark.whole
def test_the_page_of_a_paper_is_written_and_made_again(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(friction, "available", lambda: ("dahl", "lugre", "masing", "viscous"))
    assert main(["study", "canudas1995", "--out", str(tmp_path / "out")]) == 0
    assert traces.read(tmp_path / "out" / "index.html")["command"][:2] == ["study", "canudas1995"]
    assert main(["rerun", str(tmp_path / "out" / "canudas1995.json")]) == 0
    assert "equal to the bit" in capsys.readouterr().out
