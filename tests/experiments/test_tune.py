"""Tuning: a study that is shared, killed and resumed; what it does with bad input; what its sets show."""

import json
import math
import shlex
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import optuna
import pytest

from steer_env import friction, manoeuvres, metrics, targets
from steer_env.experiments.calibration import feasibility, problem, search, storage
from steer_env.experiments.calibration.search import WorkerOf
from steer_env.experiments.cli.main import main, parsed
from steer_env.targets import Band
from steer_env.tuning.reward import MAX_DISTANCE
from steer_env.vehicle import cars
from tests.experiments.quick_search import RANGES, job

COMPLETE, RUNNING = optuna.trial.TrialState.COMPLETE, optuna.trial.TrialState.RUNNING


def study_of(one):
    with search.quiet(), storage.exclusive_folder(search.Path(one.out)):
        return search.current(one, storage.open_storage(search.Path(one.out), one.address))


def process(out, budget, seconds, *more):
    command = [sys.executable, "-m", "tests.experiments.quick_search", *map(str, (out, budget, seconds, *more))]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def wait_for(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end
        time.sleep(0.02)
    return found


@pytest.mark.parametrize("sampler", ["surface", *(pytest.param(x, marks=pytest.mark.whole) for x in ("tpe", "nsga2"))])
def test_killed_and_resumed_it_tries_the_same_sets(tmp_path, sampler):
    """Killed among its first sets and among those that the sampler chooses; every set is the uninterrupted one's."""
    budget = 30
    whole, killed = (job(tmp_path / name, budget, name=sampler, sampler=sampler) for name in ("whole", "killed"))
    for one in (whole, killed):
        storage.Path(one.out).mkdir()
    search.work(WorkerOf(whole, 1))
    for hangs, count in ((5, 4), (22, 25)):
        with process(killed.out, budget, 0.0, sampler, hangs) as running:
            wait_for(lambda count=count: len(search.finished_sets(study_of(killed))) == count)
            wait_for(lambda: study_of(killed).get_trials(deepcopy=False, states=(RUNNING,)))
            running.kill()
    assert search.work(WorkerOf(killed, 1)) == 5
    first, again = (search.finished_sets(study_of(one)) for one in (whole, killed))
    assert len(first) == len(again) == budget
    one, other = (sorted((t.params["x"], t.params["y"]) for t in trials) for trials in (first, again))
    assert one == other
    assert search.best(again).params == search.best(first).params


def test_begins_with_the_starting_point_and_widens_where_the_optimum_is_on_a_limit(tmp_path):
    one = job(tmp_path, 45)
    search.work(WorkerOf(one, 0))
    study = study_of(one)
    done = search.finished_sets(study)
    assert done[0].params == {"x": 0.9, "y": 1.0}
    x = search.ranges(study)[0]
    assert x.low == 0.0
    assert x.high > 1.0
    assert search.best(done).params["x"] > 1.0
    assert int(study.study_name[-1]) > 1


def test_a_larger_budget_widens_too(tmp_path):
    search.work(WorkerOf(job(tmp_path, 12), 0))
    more = job(tmp_path, 60)
    search.work(WorkerOf(more, 0))
    assert search.ranges(study_of(more))[0].high > 1.0


@pytest.mark.parametrize("sampler", ["random", "tpe"])
def test_seeds_give_sets_of_their_own(tmp_path, sampler):
    found = []
    for seed in (0, 1, 2):
        one = job(tmp_path / str(seed), 30, name=sampler, sampler=sampler, seed=seed, widens=False)
        (tmp_path / str(seed)).mkdir()
        search.work(WorkerOf(one, 0))
        found += [tuple(t.params.values()) for t in search.finished_sets(study_of(one))]
    assert len(set(found)) == 3 * 30 - 2  # the starting point is common


def test_a_round_that_was_not_made_whole_is_made_again(tmp_path):
    one = job(tmp_path, 6)
    search.work(WorkerOf(one, 0))
    with search.quiet():
        optuna.create_study(study_name="surface-2", storage=storage.open_storage(tmp_path), directions=["minimize"])
    study = study_of(one)
    assert study.study_name == "surface-1"
    assert len(search.finished_sets(study)) == 6


def test_ranges_end_where_the_parameter_does():
    wider = search.widen_ranges(RANGES, {"x": 0.5, "y": 9.99})
    assert wider == RANGES
    low = search.widen_ranges(RANGES, {"x": 1.0, "y": 0.1})
    assert (low[0].low, low[0].high) == (0.0, 1.5)
    assert low[1].low == pytest.approx(0.01)


@pytest.mark.filterwarnings("ignore::steer_env.vehicle.cars.UnusualCar")
@pytest.mark.parametrize("value", [0.06, 12.0])
def test_an_own_value_beyond_the_usual_limits_stays_in_a_range_that_is_widened(value):
    own = cars.load("compact", {"assist.return_gain": 5.0, "assist.return_saturation": value})
    (r,) = problem.tuning_ranges(own.assist, ("return_saturation",))
    (wider,) = search.widen_ranges((r,), {"return_saturation": value})
    assert wider.low <= value <= wider.high


@pytest.mark.whole
def test_processes_share_a_study_and_lose_no_set_of_a_killed_one(tmp_path):
    budget, one = 20, job(tmp_path, 20)

    def taken():
        trials = study_of(one).get_trials(deepcopy=False, states=(RUNNING,))
        return [t.params for t in trials if f"-{killed.pid}-" in t.user_attrs.get("process", "")]

    with process(tmp_path, budget, 60.0) as killed:
        (lost,) = wait_for(taken)
        with process(tmp_path, budget, 0.1) as other:
            wait_for(lambda: len(search.finished_sets(study_of(one))) > 1)
            killed.kill()
            shared = int(other.communicate(timeout=120)[0])
    trials = study_of(one).get_trials(deepcopy=False)
    done = [t for t in trials if t.state is COMPLETE]
    assert len(done) == shared == budget
    assert not [t for t in trials if t.state is RUNNING]
    assert [t.params for t in done if "again" in t.user_attrs] == [lost]


def test_torn_journal(tmp_path):
    one = job(tmp_path, 5)
    search.work(WorkerOf(one, 0))
    path, told = tmp_path / storage.JOURNAL, []
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"op_code": 4, "trial')
    storage.require_whole(path, told.append)
    assert path.read_bytes() == whole
    assert "ended within a line" in told[0]
    assert len(search.finished_sets(study_of(one))) == 5


def test_locked_journal(tmp_path):
    held, wanted = (storage.FileLock(tmp_path / "journal.log.lock", patience) for patience in (1.0, 0.05))
    with held, pytest.raises(OSError, match=r"locked by another process for 0.05 s: end that process, or wait"):
        wanted.acquire()
    with wanted:
        assert not storage.FileLock(wanted.path).try_lock()


def test_a_database_takes_a_study(tmp_path):
    address = f"sqlite:///{tmp_path / 'study.db'}"
    one = job(tmp_path, 6, address=address)
    assert search.work(WorkerOf(one, 0)) == 6
    assert len(search.finished_sets(study_of(one))) == 6
    assert not (tmp_path / storage.JOURNAL).exists()
    with pytest.raises(ValueError, match=r"--storage nonsense cannot be opened .* leave it out for a journal"):
        storage.open_storage(tmp_path, "nonsense")


def sets(*rows):
    """Evaluated sets with values of the metrics a and b in two conditions, and whether they keep the margins."""
    return [
        SimpleNamespace(
            number=i,
            constraints={"phase_margin": -0.1 if kept else 0.1},
            user_attrs={
                "objectives": [0.0 if kept else 1.0, float(i)],
                "details": {"metrics": {"calm": {"a": a[0], "b": b[0]}, "rough": {"a": a[1], "b": b[1]}}},
            },
        )
        for i, (a, b, kept) in enumerate(rows)
    ]


BANDS = {name: Band((0.0, 1.0), (-1.0, 2.0)) for name in "ab"}


def test_what_the_sets_show():
    def judged(*rows):
        return feasibility.judge(SimpleNamespace(bands=BANDS), sets(*rows), ("a", "b"))

    assert judged(((0.5, 0.5), (0.5, 1.0), True), ((9.0, 9.0), (9.0, 9.0), True)).reached
    found = judged(((0.5, 0.5), (0.5, 1.5), True), ((0.5, 2.0), (0.5, 0.6), True))
    assert not found.reached
    assert not found.never
    assert found.pairs[0].metrics == ("a", "b")
    found = judged(((0.5, 1.5), (0.5, 0.5), True), ((0.5, 0.5), (0.5, 0.5), False))
    assert [c.metric for c in found.never] == ["a"]


def test_where_no_set_keeps_the_constraints_the_nearest_is_told():
    far, near = sets(((0.5, 0.5), (0.5, 0.5), False), ((2.0, 2.0), (0.5, 0.5), False))
    far.constraints = {"phase_20": 0.4, "gain_20": -1.0}
    near.constraints = {"phase_20": 0.1, "gain_140": 0.05, "stable": 0.0}
    found = feasibility.judge(SimpleNamespace(bands=BANDS), [far, near], ("a", "b"))
    assert [name for name, _ in found.nearest] == ["phase_20", "gain_140"]


def test_a_metric_that_is_refused_everywhere_is_written():
    never = feasibility.Closest("yaw_lag", 3.0, 3.0, math.nan, math.nan, ("calm",))
    found = feasibility.Feasibility(2, False, (never,), (), ("yaw_lag",), 0)
    written = json.loads(json.dumps(feasibility.as_json(found), allow_nan=False))
    assert written["never"][0]["low"] is None


@pytest.fixture(scope="module")
def posed():
    return problem.make(cars.load("compact"), targets.load("compact"))


def test_a_set_is_the_car_file(posed):
    values = {**problem.own_values(posed), "boost_level": 1.2, "return_gain": 1.5, "lead_zero": 17.0}
    car = problem.tuned_car(posed, values)
    again = cars.load(car.data())
    assert feasibility_of(car.assist) == feasibility_of(problem.assist(posed, values))
    assert feasibility_of(again.assist) == feasibility_of(car.assist)


def feasibility_of(assist):
    """An assist as something that can be compared to the bit."""
    return json.dumps(assist, default=lambda x: x.tolist())


@pytest.mark.whole
def test_functions_that_the_car_does_not_have_change_little_where_they_are_weak(posed):
    one = posed._replace(conditions=posed.conditions[:1])
    usual, weak = (problem.evaluate(one, values) for values in ({}, {"return_gain": 1e-6}))
    label = one.conditions[0].label
    assert None not in usual.metrics[label].values()
    for name, value in usual.metrics[label].items():
        assert weak.metrics[label][name] == pytest.approx(value, rel=1e-3, abs=1e-3), name
    assert usual.margins["stable"] == 1.0
    assert all(value <= 0.0 for value in problem.constraints.violations(usual.margins).values())


@pytest.mark.whole
def test_margins_that_are_missed(posed):
    found = problem.evaluate(posed, {"boost_level": 2.5, "lead_zero": 5.0}, every_metric=False)
    missed = problem.constraints.violations(found.margins)
    assert missed["stable"] == 1.0
    tuned = problem.assist(posed, {"boost_level": 2.5, "lead_zero": 5.0})
    assert missed["motor_limit"] == pytest.approx(tuned.boost.max() / tuned.limit - 1.0)
    assert missed["motor_limit"] > 0.5
    assert set(found.refused) == set(posed.bands)
    assert problem.objectives(posed, found, tuple(posed.bands))["effort"] == 2 * MAX_DISTANCE


def refused(capfd, *words):
    assert main(["tune", *words]) == 2
    return capfd.readouterr().err


@pytest.mark.filterwarnings("ignore::steer_env.vehicle.cars.UnusualCar")
def test_bad_input(tmp_path, capfd):
    out = ["--out", str(tmp_path / "study")]
    with pytest.raises(SystemExit):
        main(["tune", "--budget", "0"])
    assert "must be a whole number of at least 1, got '0'" in capfd.readouterr().err
    car = cars.load("compact")
    table = car.assist.boost.copy()
    table[2, 4] = 0.5 * table[2, 3]
    falls = f"assist.boost={table.tolist()}"
    assert "correct this row in the car file" in refused(capfd, "--set", falls, *out)
    table[2, 4] = np.inf
    assert "boost must be finite" in refused(capfd, "--set", f"assist.boost={table.tolist()}", *out)
    unstable = refused(capfd, "--set", "assist.boost_scale=6", *out)
    assert "the starting point, 'compact', cannot be driven" in unstable
    assert "begin with at most 0.432 times its boost: multiply assist.boost_scale" in unstable
    text = (targets.FOLDER / "compact.toml").read_text(encoding="utf-8")
    line = next(line for line in text.splitlines() if line.startswith("torque_gradient_ratio"))
    contradicting = tmp_path / "own.toml"
    high = 'torque_gradient_ratio = { unit = "1", good = [3.0, 4.0], fair = [2.0, 5.0] }'
    contradicting.write_text(text.replace(line, high), encoding="utf-8")
    assert "contradict each other" in refused(capfd, "--targets", str(contradicting), *out)
    assert "parameters must be some of" in refused(capfd, "--parameters", "colour", *out)


@pytest.mark.whole
def test_command(tmp_path, capfd):
    words = ["tune", "--budget", "2", "--workers", "1", "--out", str(tmp_path / "study")]
    assert main([*words, "--parameters", "boost_level", "return_gain"]) == 0
    first = json.loads((tmp_path / "study" / "tune.json").read_text(encoding="utf-8"))
    printed = capfd.readouterr().out
    assert printed.startswith(first["verdict"][0])
    for line in printed.splitlines()[-2:]:  # the reports of the car before and after
        (law,) = parsed(shlex.split(line)[1:]).friction
        assert law.parameters == friction.resolve("lugre@column_eps")
    assert not first["feasibility"]["reached"]
    assert len(first["sets"]) == 1
    car = cars.load(tmp_path / "study" / "best.toml")
    assert car.name == "compact_best"
    driven = metrics.evaluate(manoeuvres.drive(car, manoeuvres.make("release")))
    told = first["best"]["metrics"]["friction x 1, unladen"]
    for name in ("yaw_rate_after_1s", "release_overshoot", "residual_handwheel_angle"):
        assert told[name] == pytest.approx(driven[name].value, rel=1e-3), name  # of two releases, here of more
    assert main(words) == 2
    assert "has the study of another problem" in capfd.readouterr().err
