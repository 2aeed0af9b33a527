"""What a tuning makes of all studies in a folder, of the set that it takes last, and of a car that cannot be driven.

The sets are evaluated by a formula in place of the drives: a band is reached where its parameter is, and the handwheel
angles of the set itself shift every metric by a little.
"""

import json
import math
import re
import subprocess
from types import SimpleNamespace

import numpy as np
import optuna  # noqa: F401, which a tuning takes
import pytest

from steer_env import friction, targets
from steer_env.experiments.calibration import (
    constraints,
    margin_map,
    own_angles,
    problem,
    search,
    storage,
    tuning,
    tuning_page,
)
from steer_env.experiments.calibration.pace import Pace
from steer_env.experiments.calibration.problem import Evaluation
from steer_env.experiments.cli import tune
from steer_env.experiments.cli.main import main, parsed
from steer_env.tuning.reward import MAX_DISTANCE
from steer_env.vehicle import cars
from steer_env.vehicle.steering.margins import Margins

pytestmark = pytest.mark.filterwarnings("ignore::steer_env.vehicle.cars.UnusualCar")

MARGINS = {
    "column_phase_0": 50.0, "column_gain_0": 9.0, "phase_100": 45.0, "gain_100": 8.0, "free_damping_100": 0.1,
    "free_pulse_100": 1.0, "motor_limit": 0.8, "stable": 1.0,
}  # fmt: skip
PARAMETERS = ("boost_level", "damping_level")
SHIFT = 0.25  # of a metric by a set's own handwheel angles [widths of the band]


def formula(posed, values, every_metric=True):
    """Metrics in the middle of their bands where boost, or damping for those of the return, is 2.5 times the car's."""
    own, start = posed.car.name.endswith("_best"), cars.load("compact").assist
    tried = problem.assist(posed, values)
    factors = tried.boost[0, -1] / start.boost[0, -1], tried.damping[0] / start.damping[0]
    metrics = {}
    for name, (low, high) in ((n, b.good) for n, b in posed.bands.items()):
        place = factors[posed.groups[name] == "return"] - 2.0 - (SHIFT if own else 0.0)
        metrics[name] = low + (high - low) * place
    return Evaluation({c.label: dict(metrics) for c in posed.conditions}, MARGINS, {})


def cell(phase, torque=3.5):
    """A point of the map with a phase margin [rad]."""
    return margin_map.Cell(20.0, torque, "off", margin_map.SLIDING, Margins(4.0, phase, 0.01, 0.4, 5.0, True))


def here(function, cases, **options):
    """A sweep in this process."""
    return [function(case) for case in cases]


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(problem, "evaluate", formula)
    monkeypatch.setattr(problem, "prepare_problem", lambda posed: None)
    monkeypatch.setattr(margin_map, "seconds", lambda *car: 1.0)
    monkeypatch.setattr(tuning, "map_margins", lambda case, points=None: [cell(math.radians(50.0))])


@pytest.fixture(scope="module")
def posed():
    return problem.make(cars.load("compact"), targets.load("compact"), names=PARAMETERS)


def tuned(posed, out, budget=6, **options):
    return tuning.tune(posed, out, budget, here, **options)


def params(trials):
    return [t.params for t in trials]


@pytest.mark.whole
@pytest.mark.parametrize("database", [False, True])
def test_another_sampler_or_seed_keeps_the_sets_of_all_studies(tmp_path, posed, quick, database):
    options = {"address": f"sqlite:///{tmp_path / 'study.db'}"} if database else {}
    first = tuned(posed, tmp_path, 24, **options)
    other = tuned(posed, tmp_path, 3, sampler="random", seed=5, **options)
    assert list(other.trials) == ["surface", "random"]
    assert params(other.trials["surface"]) == params(first.trials["surface"])
    assert len(other.trials["random"]) == 3
    assert search.total(other.best) <= search.total(first.best)
    assert other.feasibility.sets == len(first.trials["surface"]) + 3 - 1  # the starting point is common
    for r, before in zip(other.ranges, first.ranges):
        assert r.low <= before.low
        assert r.high >= before.high
    assert other.widened == first.widened
    again = tuned(posed, tmp_path, 3, seed=7, sampler="random", **options)
    assert params(again.trials["random"]) == params(other.trials["random"])
    _, data = tuning_page.build_page(other)
    assert sorted(map(len, data["sets"].values())) == sorted(map(len, other.trials.values()))
    assert again.best.params == other.best.params


def test_the_budget_counts_the_finished_sets_of_one_sampler(tmp_path, posed, quick):
    tuned(posed, tmp_path, 4, sampler="random")
    found = tuned(posed, tmp_path, 6, sampler="random")
    assert [len(trials) for trials in found.trials.values()] == [6]
    found = tuned(posed, tmp_path, 5, sampler="tpe")
    assert {name: len(trials) for name, trials in found.trials.items()} == {"random": 6, "tpe": 5}


def test_a_search_and_a_confirmation_by_the_same_optimiser_are_both_told(tmp_path, posed, quick):
    tuned(posed, tmp_path, 3, sampler="random", confirm=True)
    found = tuned(posed, tmp_path, 4, sampler="nsga2")
    assert {name: len(trials) for name, trials in found.trials.items()} == {"random": 3, "second nsga2": 3, "nsga2": 4}
    _, data = tuning_page.build_page(found)
    assert data["own_angles"]["best"]["difference"] == found.checks["best"].difference


def test_the_best_set_has_the_metrics_with_its_own_handwheel_angles(tmp_path, posed, quick):
    found = tuned(posed, tmp_path, 12, sampler="random")
    before, check = found.checks["best"].searched, found.checks["best"]
    assert before in found.trials["random"]
    assert (found.best.params, found.best.number) == (before.params, before.number)
    expected = formula(posed._replace(car=tuning.rounded(posed, before.params)), {})
    assert found.best.user_attrs["details"]["metrics"] == expected.metrics
    assert found.best.user_attrs["details"]["margins"] == before.user_attrs["details"]["margins"]
    assert found.best.user_attrs["objectives"] == list(problem.objectives(posed, expected, found.counted).values())
    assert check.difference == pytest.approx(SHIFT, abs=1e-3)  # and what the rounded numbers of the file change
    assert check.metric in found.counted
    far = {n: problem.distance(x, posed.bands[n]) for n, x in next(iter(expected.metrics.values())).items()}
    assert set(found.feasibility.missed) == {n for n in found.counted if far[n] > 1e-9}
    assert found.checks["start"].difference == pytest.approx(SHIFT)
    assert found.own.params == problem.own_values(posed)


def test_the_file_of_the_best_car_has_rounded_numbers(posed):
    own = problem.own_values(posed)
    assert tuning.rounded(posed, own).data()["assist"] == problem.tuned_car(posed, own).data()["assist"]
    exact = problem.tuned_car(posed, {**own, "boost_level": 1.234567 * own["boost_level"]}).data()["assist"]
    found = tuning.rounded(posed, {**own, "boost_level": 1.234567 * own["boost_level"]}).data()["assist"]
    for given, kept in zip(np.ravel(exact["boost"]), np.ravel(found["boost"])):
        assert kept == float(f"{given:.4g}")


def test_an_interrupted_search_says_how_it_goes_on(tmp_path, monkeypatch, capfd):
    def interrupted(*given, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(tuning, "tune", interrupted)
    words = ["tune", "--parameters", *PARAMETERS, "--out", str(tmp_path)]
    assert main(words) == 130
    assert f"go on with the same command: steer-env {' '.join(words)}" in capfd.readouterr().err


def test_a_search_that_finds_nothing_better_says_so(tmp_path, posed, quick):
    page, data = tuning_page.build_page(tuned(posed, tmp_path, 1))
    assert page.values["answer"].alone
    assert not data["answer"]["start"]


BROKEN = {"column_phase_0": 20.0, "column_gain_0": 5.0, "free_damping_100": -0.1, "free_pulse_100": 0.0}
BROKEN |= {"motor_limit": 1.5, "stable": 0.0}


@pytest.mark.parametrize(("whose", "missed"), [("start", BROKEN), ("all", {"column_gain_0": 5.0})])
def test_the_limits_that_are_broken_are_told(tmp_path, posed, quick, monkeypatch, missed, whose):
    def breaking(posed, values, every_metric=True):
        found = formula(posed, values, every_metric)
        start = np.array_equal(problem.assist(posed, values).boost, cars.load("compact").assist.boost)
        return found._replace(margins=MARGINS | missed) if start or whose == "all" else found

    monkeypatch.setattr(problem, "evaluate", breaking)
    page, data = tuning_page.build_page(tuned(posed, tmp_path, 6))
    words = {constraints.kind(name) for name in missed}
    assert set(data["answer"]["start"]) == words
    assert set(data["answer"]["broken"]) == (words if whose == "all" else set())
    assert data["answer"]["kept"] == (whose == "start")
    gain = page.values["compared"]["gain"]
    assert [side.kept for side in gain] == [False, whose == "start"]
    assert tuning_page._digits_to_limit(5.9996, 6.0) == ("5.9996", False)
    assert tuning_page._digits_to_limit(1.2, 1.0, highest=True) == ("1.2", False)


def test_a_distance_that_grew_for_a_limit_is_given_up_and_no_gain(tmp_path, posed, quick, monkeypatch):
    """The start reaches all bands, but breaks a limit; what keeps it is farther from the bands."""

    def breaking(posed, values, every_metric=True):
        found = formula(posed, values, every_metric)
        start = np.array_equal(problem.assist(posed, values).boost, cars.load("compact").assist.boost)
        inside = {name: sum(band.good) / 2.0 for name, band in posed.bands.items()}
        where = dict.fromkeys(found.metrics, inside)
        return found._replace(metrics=where, margins=MARGINS | {"column_gain_0": 5.0}) if start else found

    monkeypatch.setattr(problem, "evaluate", breaking)
    shares = dict.fromkeys(posed.bands, 1.0)
    monkeypatch.setattr(tuning, "largest_effects", lambda posed, sweep: shares)
    found = tuned(posed, tmp_path, 6)
    _, data = tuning_page.build_page(found)
    assert search.total(found.own) == 0.0
    assert data["answer"]["farther"] == pytest.approx(search.total(found.best))
    assert data["answer"]["given_up"] == tuple(n for n in found.counted if n not in data["answer"]["reached"])


def test_parameters_tell_ends_of_ranges_and_functions_that_are_off(tmp_path, quick):
    names = ("boost_level", "damping_level", "return_gain", "return_saturation")
    posed = problem.make(cars.load("compact"), targets.load("compact"), names=names)
    found = tuned(posed, tmp_path, 6)
    cut = [r._replace(high=found.best.params[r.name]) if r.name == "boost_level" else r for r in found.ranges]
    shown = tuning_page.build_page(found._replace(ranges=tuple(cut)))[0].values["parameters"]
    assert "boost_level" in shown["ends"]
    assert shown["count"] == 6
    returning = cars.load("compact").data() | {
        "assist": problem.keys(posed, problem.own_values(posed) | {"return_gain": 1.0})
    }
    assert problem.without_effect(posed.car.assist) == {"return_saturation"}
    assert problem.without_effect(cars.load(returning).assist) == set()


def test_a_range_that_ends_where_the_assist_does_is_no_limit(posed):
    r = posed.ranges[0]
    assert tuning_page.at_end(r, r.low) == "best on the lower limit"
    assert not tuning_page.at_end(r, r.own)
    assert not tuning_page.at_end(r._replace(limits=(r.low, r.high)), r.low)


def test_a_set_that_misses_the_whole_map_is_passed_over(tmp_path, posed, quick, monkeypatch):
    first = tuned(posed, tmp_path, 12, sampler="random")
    ranked = search.rank(first.trials["random"])
    assert first.best.params == ranked[0].params
    values = tuning_page.build_page(first)[0].values
    assert not values["missed"]
    assert values["passed"] == {"count": 0}

    whole = []

    def mapped(case, points=None):
        bad = case[1] in [t.params for t in ranked[:3]]
        cells = [cell(math.radians(50.0), 1.0), cell(math.radians(20.0 if bad else 50.0))]
        if points is None:
            whole.append(case[1])
            return cells
        return [c for c in cells if c.where in [p.where for p in points]]

    monkeypatch.setattr(tuning, "map_margins", mapped)
    found = tuned(posed, tmp_path, 12, sampler="random")
    # The start before the search; of the best, the others miss what the first one does.
    assert whole == [problem.own_values(posed), ranked[0].params, ranked[3].params]
    assert found.best.params == ranked[3].params
    assert not margin_map.cells_below_limits(found.cells)
    page, data = tuning_page.build_page(found)
    assert page.values["passed"]["count"] == 3
    assert [bool(each["missed"]) for each in data["tried"]] == [True, True, True, False]


def test_where_no_set_keeps_the_whole_map_the_one_with_the_fewest_misses_is_told(tmp_path, posed, quick, monkeypatch):
    ranked = search.rank(tuned(posed, tmp_path, 12, sampler="random").trials["random"])

    def mapped(case, points=None):
        k = [t.params for t in ranked].index(case[1])
        bad = [float(k)] if k == 2 else [float(k), k + 0.5]  # each at other points
        if points is not None:
            return [cell(math.radians(20.0 if p.torque in bad else 50.0), p.torque) for p in points]
        return [cell(math.radians(20.0), torque) for torque in bad]

    monkeypatch.setattr(tuning, "map_margins", mapped)
    found = tuned(posed, tmp_path, 12, sampler="random")
    assert len(found.tried) == min(tuning.MAPS, len(ranked))
    assert found.best.params == ranked[2].params
    (missed,) = tuning_page.build_page(found)[0].values["missed"]
    assert (missed.speed_kph, missed.torque) == (20.0, 2.0)


def test_points_that_are_read_again_are_those_of_the_map(monkeypatch):
    monkeypatch.setattr(margin_map, "SPEEDS", (40.0,))
    monkeypatch.setattr(margin_map, "TORQUES", (2.0, 9.0))
    car, law = cars.load("compact"), friction.resolve("lugre")
    cells = margin_map.of_car(car, law, (0.0, 300.0), "single_track")
    assert {c.margins is None for c in cells} == {False, True}  # 9 N m are not reached
    assert margin_map.map_points(cells, car, law, "single_track") == cells


def test_a_band_that_changes_side_is_told(posed):
    inside = {name: 0.5 * sum(band.good) for name, band in posed.bands.items()}
    outside = {**inside, "yaw_lag": posed.bands["yaw_lag"].good[1] + 1.0}
    refused = {**inside, "release_overshoot": None}
    trials = [
        SimpleNamespace(user_attrs={"details": {"metrics": {"calm": inside, "rough": values}}})
        for values in (inside, outside, refused)
    ]
    counted = tuple(posed.bands)
    same = own_angles.compare_angles(posed, counted, trials[0], trials[0])
    assert (same.difference, same.metric, same.changed) == (0.0, "", ())
    left = own_angles.compare_angles(posed, counted, trials[0], trials[1])
    assert left.changed == (("yaw_lag", "rough", False),)
    assert own_angles.compare_angles(posed, counted, trials[1], trials[0]).changed == (("yaw_lag", "rough", True),)
    lost = own_angles.compare_angles(posed, counted, trials[0], trials[2])
    assert lost.difference == MAX_DISTANCE
    assert lost.changed == (("release_overshoot", "rough", False),)
    text = json.dumps(own_angles.as_json({"best": lost}))
    assert json.loads(text)["best"]["changed"] == [["release_overshoot", "rough", False]]


def test_targets_whose_bands_are_all_in_one_group(tmp_path, quick):
    file = tmp_path / "parking.toml"
    text = (targets.FOLDER / "compact.toml").read_text(encoding="utf-8")
    head, *sections = re.split(r"^(?=\[)", text, flags=re.MULTILINE)
    file.write_text(head + "".join(s for s in sections if s.startswith("[parking")), encoding="utf-8")
    one = problem.make(cars.load("compact"), targets.load(str(file)), names=PARAMETERS)
    assert set(one.groups.values()) == {"effort"}
    for sampler in ("surface", "nsga2"):
        found = tuned(one, tmp_path / sampler, 5, sampler=sampler)
        assert len(found.best.user_attrs["objectives"]) == 1
        assert set(tuning_page.build_page(found)[1]["importances"]) <= {"effort"}


def test_nothing_is_left_behind_where_there_is_nothing_to_resume(tmp_path, posed, quick, capfd):
    for address in (None, f"sqlite:///{tmp_path / 'study.db'}"):
        with pytest.raises(ValueError, match="has no study that could be resumed"):
            tuned(posed, tmp_path / "not" / "here", resume=True, address=address)
        assert not (tmp_path / "not").exists()
    assert main(["tune", "--resume", "--workers", "1", "--out", str(tmp_path / "nothere")]) == 2
    assert "leave --resume out" in capfd.readouterr().err
    assert not (tmp_path / "nothere").exists()


@pytest.mark.whole
@pytest.mark.parametrize(
    ("key", "own"),
    [("boost_scale", 6.0), ("boost_scale", [6.0] * 4 + [3.0] * 4), ("return_gain", 200.0)],
)
def test_the_remedy_for_an_unstable_start_works(key, own):
    """The factor is one on what the car has, whatever scale its file has, and the largest one."""
    data = cars.load("compact").data()

    def check(factor):
        given = {**data["assist"], key: np.multiply(factor, own).tolist()}
        problem.require_stable(problem.make(cars.load({**data, "assist": given}), targets.load("compact")))

    with pytest.raises(ValueError, match=r"cannot be driven: .* is unstable .*; begin with at most") as caught:
        check(1.0)
    factor, of = re.search(r"begin with at most ([\d.e-]+) times its (.*)$", str(caught.value)).groups()
    assert of.startswith("boost: multiply assist.boost_scale, which is 1" if key == "boost_scale" else key)
    check(float(factor))
    with pytest.raises(ValueError, match="cannot be driven"):
        check(1.02 * float(factor))


def test_the_advice_for_a_torn_journal_can_be_run(tmp_path, posed, quick):
    out = tmp_path / "my study"
    found = tuned(posed, out, 5, sampler="random")
    path = out / storage.JOURNAL
    lines = path.read_bytes().splitlines(keepends=True)
    at = next(i for i, line in enumerate(lines) if b'"op_code":6' in line.replace(b" ", b"") and i > len(lines) // 2)
    path.write_bytes(b"".join([*lines[:at], b"\0\r\0" + lines[at][:9] + b"\n", *lines[at + 1 :]]))
    with pytest.raises(ValueError, match=f"line {at + 1} of {len(lines)}, is torn") as caught:
        storage.require_whole(path)
    command = re.search(r"with `(.*?)`", str(caught.value)).group(1)
    subprocess.run(command, shell=True, check=True, cwd="/")
    storage.require_whole(path)
    assert path.read_bytes() == b"".join(lines[:at])
    kept = tuned(posed, out, 5, sampler="random").trials["random"]
    assert len(kept) == 5
    assert [t.params for t in kept][:2] == params(found.trials["random"])[:2]
    assert not (out / "whole.log").exists()


def test_a_set_that_reaches_every_band_but_misses_the_map_does_not_end_the_search(tmp_path, posed, quick, monkeypatch):
    ended = tuned(posed, tmp_path / "first", 60)
    count = len(ended.trials["surface"])
    assert count < 60
    assert search.bands_reached(ended.trials["surface"])
    monkeypatch.setattr(tuning, "map_margins", lambda case, points=None: [cell(math.radians(20.0))])
    found = tuned(posed, tmp_path / "second", count + 8)
    assert len(found.trials["surface"]) == count + 8
    assert not found.feasibility.reached
    assert not tuning_page.build_page(found)[1]["feasibility"]["reached"]
    missed = [t for t in found.trials["surface"] if t.constraints["whole_map"] > 0.0]
    assert missed
    assert not any(map(search.keeps_constraints, missed))


def test_an_unstable_point_counts_more_than_missed_margins(posed, monkeypatch):
    slack, unstable = cell(math.radians(29.0)), cell(math.radians(50.0))
    unstable = unstable._replace(margins=unstable.margins._replace(stable=False))
    maps = [[unstable], [slack, slack._replace(torque=1.0)]]
    monkeypatch.setattr(tuning, "map_margins", lambda case, points=None: maps[case[1]] if points is None else [])
    ranked = [SimpleNamespace(params=k) for k in range(2)]
    assert tuning._safest(posed, ranked, here, Pace())[0] is ranked[1]


def test_parameters_that_move_no_band_are_refused(tmp_path, quick):
    posed = problem.make(cars.load("compact"), targets.load("compact"), names=("lead_zero", "lead_pole"))
    with pytest.raises(ValueError, match="no parameter of lead_zero, lead_pole moves a metric by"):
        tuned(posed, tmp_path)


def test_a_metric_that_only_the_start_refuses_is_moved(posed, monkeypatch):
    def refused(posed, values, every_metric=True):
        found = formula(posed, values)
        if values == problem.own_values(posed):
            found.metrics[posed.conditions[0].label]["release_overshoot"] = None
        return found

    monkeypatch.setattr(problem, "evaluate", refused)
    assert tuning.largest_effects(posed, here)["release_overshoot"] == MAX_DISTANCE


def test_a_study_that_has_only_begun_is_left_out(tmp_path, posed, quick):
    first = tuned(posed, tmp_path, 4)
    job = tuning.make_job(posed, first.moved, tmp_path, 4)._replace(name="second nsga2", sampler="nsga2")
    with search.quiet():
        search.current(job, storage.open_storage(tmp_path))
    found = tuned(posed, tmp_path, 5)
    assert list(found.trials) == ["surface"]
    tuning_page.build_page(found)


def test_nothing_waits_for_a_set_of_a_machine_that_went_down(tmp_path, posed, quick, monkeypatch):
    job = tuning.make_job(posed, tuning.largest_effects(posed, here), tmp_path, 12)._replace(stops=False)
    with search.quiet():
        study = search.current(job, storage.open_storage(tmp_path))
        study.ask(search.distributions(search.ranges(study))).set_user_attr("process", "elsewhere-1-dead")
    monkeypatch.setattr(search.time, "sleep", lambda seconds: pytest.fail("it waits"))
    assert search.work(search.WorkerOf(job, 0)) == 11


def test_a_database_in_the_folder_and_modules_of_ones_own(tmp_path):
    words = ["tune", "--import", "json", "--storage", f"sqlite:///{tmp_path / 'study.db'}", "--out", str(tmp_path)]
    (tmp_path / "study.db").touch()
    with pytest.raises(ValueError, match="has no study that could be resumed"):
        tune.run(parsed([*words, "--resume"]))
    told = tune._words(parsed(words), cars.load(), "best.toml", "after")
    assert told[1:5] == ["--import", "json", "--friction", "lugre@column_eps"]
